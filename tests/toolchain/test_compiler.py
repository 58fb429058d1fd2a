"""The compiler that is called: that of $CXX, as `make` takes it, or an error that names it."""

from __future__ import annotations

import re
import shutil
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.package.errors import ToolchainError
from cutjoint.package.locations import runtime_folder
from cutjoint.toolchain.cmake import build_project, zig_tools
from cutjoint.toolchain.compiler import find_compiler, must_interpret
from tests.conftest import MODELS
from tests.toolchain.test_locks import Site, output, pytestmark, site

__all__ = ["pytestmark", "site"]


@pytest.fixture
def launcher(tmp_path: Path) -> Path:
    """A program as ccache is: it runs what it is asked to, and writes that down."""
    path = tmp_path / "launcher"
    path.write_text(f'#!/bin/sh\necho "$*" >> "{tmp_path}/calls"\nexec "$@"\n', encoding="utf-8")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("g+++", r"CXX=g\+\+\+: there is no program 'g\+\+\+'; set \$CXX"),
        ("/nowhere/g++ -O0", "CXX=/nowhere/g.. -O0: there is no program '/nowhere/g..'"),
        ("/", "CXX=/: there is no program '/'"),
        ("g++ '", "CXX=g.. ': No closing quotation"),
        ("/bin/false", "/bin/false --version: it prints no version"),
        ("sh -c :", "sh -c : --version: it prints no version"),
        ("SCRIPT", "Exec format error"),
    ],
)  # fmt: skip
def test_what_is_no_compiler(asked: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "SCRIPT").write_text("no program", encoding="utf-8")
    (tmp_path / "SCRIPT").chmod(0o755)
    monkeypatch.setenv("CXX", asked.replace("SCRIPT", str(tmp_path / "SCRIPT")))
    with pytest.raises(ToolchainError, match=message) as caught:
        find_compiler()
    assert "set $CXX to a C++20 compiler, or unset it" in str(caught.value)
    result = CliRunner().invoke(main, ["simulate", str(MODELS / "pendulum.yaml"), "--out", str(tmp_path / "run.csv")])
    assert result.exit_code == 1
    assert re.search(message, result.output.replace("\n", ""))
    assert not (tmp_path / "run.csv").exists()


@pytest.mark.parametrize("asked", ["", "  "])
def test_no_compiler_asked_for(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", asked)
    assert find_compiler().command == (shutil.which("g++") or shutil.which("clang++"),)


def test_without_a_compiler_that_of_pypi_is_called(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package ziglang beside this one, with CMake and Ninja in the folder of this Python's programs: none is in the PATH."""
    for name in ("ziglang/zig", "programs/cmake", "programs/ninja", "ziglang/__init__.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text('#!/bin/sh\necho "called with $*"\n', encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr("sysconfig.get_path", lambda name: "/nowhere")
    with pytest.raises(ToolchainError, match=r"missing: cmake, ninja" + ("" if find_spec("ziglang") else r", a C\+\+ compiler")):
        find_compiler()
    monkeypatch.setattr("sysconfig.get_path", lambda name: str(tmp_path / "programs"))
    monkeypatch.syspath_prepend(tmp_path)
    compiler = find_compiler()
    zig = str(tmp_path / "ziglang" / "zig")
    assert compiler.command == (zig, "c++", "-mcpu=baseline")
    assert (compiler.version, compiler.zig, compiler.words) == ("called with c++ -mcpu=baseline --version", (zig,), ("-mcpu=baseline",))
    tools = zig_tools(tmp_path, zig, target=("-target", "aarch64-linux-gnu.2.17"))
    said = {name: subprocess.run([tools[name], "a b"], capture_output=True, text=True, check=True).stdout for name in ("c++", "ar")}
    assert said == {"c++": "called with c++ -target aarch64-linux-gnu.2.17 a b\n", "ar": "called with ar a b\n"}


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("/bin/cat", r"cmake failed: .*\(/bin/cat does not compile C\+\+: set \$CXX to a C\+\+20 compiler, or unset it\)"),
        ("/bin/true", r"cmake does not know this compiler \(/bin/true does not compile C\+\+: set \$CXX"),
    ],
)
def test_a_program_that_does_not_compile(asked: str, message: str, site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    monkeypatch.setenv("CXX", asked)
    with pytest.raises(ToolchainError, match=message):
        site.build("one")
    monkeypatch.delenv("CXX")
    assert output(site.build("one")) == "one\n"


def test_flags_and_launchers_are_part_of_the_compiler(launcher: Path, site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    plain = site.build("one")
    monkeypatch.setenv("CXX", f"{launcher} g++ -O0 '-DTEXT=\"a b\"'")
    other = site.build("one")
    assert other.path != plain.path
    assert other.compiler == f"{plain.compiler}, called by {launcher} g++ -O0 '-DTEXT=\"a b\"'"
    assert output(other) == "one\n"
    compilations = [line for line in (site.folder / "calls").read_text(encoding="utf-8").splitlines() if "main.cpp" in line]
    assert compilations
    assert all(line.startswith('g++ -O0 -DTEXT="a b" ') for line in compilations)
    assert not site.build("one").fresh


@pytest.mark.parametrize("name", ["my tools", "a;b $(touch elsewhere)"])
def test_a_compiler_in_any_folder(name: str, tmp_path: Path, site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    (tmp_path / name).mkdir()
    path = tmp_path / name / "c++"
    path.write_text('#!/bin/sh\nexec g++ "$@"\n', encoding="utf-8")
    path.chmod(0o755)
    for asked in (str(path), f"'{path}' -O1"):
        monkeypatch.setenv("CXX", asked)
        assert output(site.build("one")) == "one\n"
    assert not Path("elsewhere").exists()


def test_variables_that_compilers_read_are_part_of_the_key(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    plain = site.build("one").path
    monkeypatch.setenv("CXXFLAGS", "-O0")
    assert site.build("one").path != plain


def test_headers_of_the_package_come_before_those_of_the_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A configuration that fails shows that CMake has taken it."""
    place = tmp_path / "headers" / "share" / "eigen3" / "cmake"
    place.mkdir(parents=True)
    (place / "Eigen3Config.cmake").write_text('message(FATAL_ERROR "an error of this one")\n', encoding="utf-8")
    (place / "Eigen3ConfigVersion.cmake").write_text("set(PACKAGE_VERSION_COMPATIBLE TRUE)\n", encoding="utf-8")
    monkeypatch.setattr("cutjoint.toolchain.cmake.binaries_folder", lambda: tmp_path)
    definitions = ("-DCUTJOINT_PRECISION=double", "-DCUTJOINT_REAL=double")
    with pytest.raises(ToolchainError, match="an error of this one"):
        build_project(runtime_folder() / "driver" / "alone", tmp_path / "out", find_compiler(), ("-O1",), *definitions)


def test_without_tools_a_package_with_simulators_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("sysconfig.get_path", lambda name: str(tmp_path))
    monkeypatch.setattr("cutjoint.toolchain.compiler.find_zig", lambda: None)
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr("cutjoint.toolchain.compiler.binaries_folder", lambda: tmp_path / "none")
    assert not must_interpret()
    with pytest.raises(ToolchainError, match=r"^missing: cmake, ninja, a C"):
        find_compiler()
    monkeypatch.setattr("cutjoint.toolchain.compiler.binaries_folder", lambda: tmp_path)
    assert must_interpret()
    with pytest.raises(ToolchainError, match=r"^this needs generated code; missing: cmake, ninja, a C"):
        find_compiler()
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(ToolchainError, match="there is no program 'no-such-compiler'"):
        must_interpret()
