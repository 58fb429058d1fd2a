"""Exports run on processors without the vectors of this one, whichever compiler made them: under QEMU, as a Nehalem of 2008."""

from __future__ import annotations

import platform
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from shutil import which

import pytest

from cutjoint.toolchain.compiler import find_compiler, find_zig
from tests.conftest import needs_cpp
from tests.fmu.slaves import fmu_of
from tests.standalone.c_exports import standalone_of

pytestmark = [
    needs_cpp,
    pytest.mark.skipif(which("qemu-x86_64") is None or platform.machine() != "x86_64", reason="needs qemu-user, on x86-64"),
]  # fmt: skip
HOST = Path(__file__).with_name("load_fmu.c")
COMPILERS = {"g++": which("g++"), "clang++": which("clang++"), "zig": (zig := find_zig()) and f"{zig} c++"}


@pytest.fixture(params=[pytest.param(name, marks=pytest.mark.heavy) for name in COMPILERS])
def compiler(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A compiler that $CXX names, with a cache of its own, in which nothing is of an earlier version."""
    if COMPILERS[request.param] is None:
        pytest.skip(f"needs {request.param}")
    monkeypatch.setenv("CXX", str(COMPILERS[request.param]))
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    return str(request.param)


@cache
def _token() -> str:
    (found,) = re.findall(r'guid="([^"]+)"', _description())
    return str(found)


def _description() -> str:
    from io import BytesIO
    from zipfile import ZipFile

    packed = fmu_of("pendulum", 2).pack(sources=True, binary=False)
    return ZipFile(BytesIO(packed)).read("modelDescription.xml").decode()


def on(processor: str, *command: Path | str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["qemu-x86_64", "-cpu", processor, *command], capture_output=True, text=True, check=False)


def test_fmus(compiler: str, tmp_path: Path) -> None:
    """The default, which has code for AVX2 too, and that for all processors."""
    host = tmp_path / "host"
    subprocess.run(["gcc", "-std=c99", "-D_GNU_SOURCE", HOST, "-ldl", "-o", host], check=True)
    for target in ("both", "baseline"):
        made = fmu_of("pendulum", 2).build(("-O1",), target=target)
        for processor in ("Nehalem", "Haswell") if target == "both" else ("Nehalem",):
            done = on(processor, host, made, _token())
            assert (done.returncode, done.stdout) == (0, "stepped\n"), (processor, target, done.stderr)


def test_exported_code(compiler: str, tmp_path: Path) -> None:
    alone = standalone_of("pendulum")
    program = alone.build_simulator(("-O1",))
    (tmp_path / "pendulum.run").write_text(alone.files["pendulum.run"], encoding="utf-8")
    done = on("Nehalem", program, tmp_path / "pendulum.run")
    assert (done.returncode, done.stdout.count("\n") > 10) == (0, True), done.stderr


@pytest.mark.parametrize("words", [("-g",), ("-mcpu=haswell", "-g"), ("-march=native",), ("-target", "x86_64-linux-gnu")])
def test_words_of_zig_stay_and_name_a_processor(words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    zig = find_zig()
    if zig is None:
        pytest.skip("needs ziglang")
    launched = f"{sys.executable} -m ziglang"
    for call in (zig, launched):
        monkeypatch.setenv("CXX", f"{call} c++ {' '.join(words)}")
        compiler = find_compiler()
        assert compiler.zig == tuple(call.split())
        assert compiler.words == (words if words != ("-g",) else ("-mcpu=baseline", "-g"))
        assert any("flags: " in word or "machine: " in word for word in compiler.key) == ("-march=native" in words)
