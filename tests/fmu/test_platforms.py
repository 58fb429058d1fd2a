"""Binaries for other platforms: the same numbers there, and nothing beside them; ARM is run by qemu, Windows by Wine."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path
from shutil import which

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.toolchain.platforms import PLATFORMS
from tests.conftest import MODELS, needs_cpp

from .hosts import host, hosted, require_equal, rows_of
from .slaves import fmu_of, names_in, packed

pytestmark = needs_cpp

ARM, WINDOWS = "linux-aarch64", "windows-x86_64"


def needs(platform: str) -> pytest.MarkDecorator:
    """A cross-compiler, unless this is the platform."""
    known = PLATFORMS[platform]
    return pytest.mark.skipif(not known.is_here() and which(f"{known.tools}-g++") is None, reason=f"needs {known.package}")


@pytest.fixture(scope="module")
def wine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """The environment in which Wine has a place of its own, of 700 MB."""
    if which("wine") is None:
        pytest.skip("needs wine64 and wine")
    place = tmp_path_factory.mktemp("wine")
    yield {**os.environ, "WINEPREFIX": str(place), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree=;mshtml=;winemenubuilder.exe=d"}
    shutil.rmtree(place, ignore_errors=True)


def table(platform: str | None, place: Path, *call: str, environment: dict[str, str] | None = None) -> np.ndarray:
    """Outputs of the press on a platform, by a host in C, one row a step."""
    fmu, tools = fmu_of("press", 3, integrator="trapezoidal"), "" if platform is None else f"{PLATFORMS[platform].tools}-"
    program = host(place, tools, *([] if platform == WINDOWS else ["-ldl"]))
    return rows_of(hosted(fmu, fmu.build(platform=platform), [*call, str(program)], environment=environment))


@needs(ARM)
@pytest.mark.skipif(which("qemu-aarch64") is None, reason="needs qemu-user")
def test_arm_has_the_numbers_of_this_machine(tmp_path: Path) -> None:
    require_equal(table(ARM, tmp_path, "qemu-aarch64", "-L", f"/usr/{PLATFORMS[ARM].tools}"), table(None, tmp_path))


@pytest.mark.heavy
@needs(WINDOWS)
def test_windows_has_the_numbers_of_this_machine(tmp_path: Path, wine: dict[str, str]) -> None:
    require_equal(table(WINDOWS, tmp_path, "wine", environment=wine), table(None, tmp_path))


@needs(WINDOWS)
@pytest.mark.parametrize("version", [2, 3])
def test_a_dll_shows_the_standards_functions_alone_and_needs_windows_alone(version: int) -> None:
    made = fmu_of("press", version).build(platform=WINDOWS, target="both")
    text = subprocess.run([f"{PLATFORMS[WINDOWS].tools}-objdump", "-p", made], capture_output=True, text=True, check=True).stdout
    names = text.partition("[Ordinal/Name Pointer] Table")[2].splitlines()[1:]
    shown = [line.split()[-1] for line in names if line.strip().startswith("[")]
    assert f"fmi{version}DoStep" in shown
    assert all(name.startswith(f"fmi{version}") for name in shown)
    assert {line.split()[-1].lower() for line in text.splitlines() if "DLL Name" in line} == {"kernel32.dll", "msvcrt.dll"}
    code = subprocess.run([f"{PLATFORMS[WINDOWS].tools}-objdump", "-d", made], capture_output=True, text=True, check=True).stdout
    assert "ymm" in code
    assert "vmova" not in code  # moves of AVX that need what GCC does not do there: align the stack
    assert "vmovdqa" not in code
    assert "Time/Date stamp \t\t0" in text  # the same bytes each time


@pytest.mark.heavy
@needs(ARM)
def test_a_binary_for_arm_needs_the_c_library_alone() -> None:
    made = fmu_of("press", 3).build(platform=ARM)
    text = subprocess.run([f"{PLATFORMS[ARM].tools}-objdump", "-p", made], capture_output=True, text=True, check=True).stdout
    assert {line.split()[1] for line in text.splitlines() if "NEEDED" in line} <= {"libm.so.6", "libc.so.6", "ld-linux-aarch64.so.1"}


@pytest.mark.heavy
@needs(ARM)
@needs(WINDOWS)
def test_an_archive_has_several(tmp_path: Path) -> None:
    out = tmp_path / "press.fmu"
    words = [word for name in (WINDOWS, ARM, ARM) for word in ("--platform", name)]
    done = CliRunner().invoke(main, ["export", str(MODELS / "press.yaml"), "--to", "fmu", "--binary", *words, "--out", str(out)])
    assert done.exit_code == 0, done.output
    binaries = [name for name in names_in(out.read_bytes()) if name.startswith("binaries/")]
    assert binaries == ["binaries/win64/press.dll", "binaries/aarch64-linux/press.so"]
    of_three = packed(fmu_of("press", 3), sources=False, binary=True, platforms=[WINDOWS])
    assert "binaries/x86_64-windows/press.dll" in names_in(of_three)
    dll = zipfile.ZipFile(io.BytesIO(of_three)).read("binaries/x86_64-windows/press.dll")
    assert dll == fmu_of("press", 3).build(platform=WINDOWS, target="baseline").read_bytes()


def refused(tmp_path: Path, *words: str) -> tuple[int, str]:
    done = CliRunner().invoke(main, ["export", str(MODELS / "press.yaml"), "--to", *words, "--out", str(tmp_path / "press.fmu")])
    return done.exit_code, " ".join(done.output.split())


def test_a_compiler_that_is_missing_is_named_with_its_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tools = [which(name) for name in ("cmake", "ninja")]
    for tool in tools:
        assert tool is not None
        (tmp_path / Path(tool).name).symlink_to(tool)
    monkeypatch.setenv("PATH", str(tmp_path))
    status, text = refused(tmp_path, "fmu", "--binary", "--platform", WINDOWS)
    assert status == 1
    assert "missing: x86_64-w64-mingw32-g++, which compiles for Windows on x86_64; apt-get install g++-mingw-w64-x86-64" in text


def test_platforms_are_for_binaries_of_fmus(tmp_path: Path) -> None:
    status, text = refused(tmp_path, "fmu", "--sources", "--platform", WINDOWS)
    assert (status, "--platform is for binaries; leave out --sources" in text) == (2, True)
    status, text = refused(tmp_path, "mujoco", "--platform", WINDOWS)
    assert (status, "--platform is for --to fmu, not for --to mujoco" in text) == (2, True)
