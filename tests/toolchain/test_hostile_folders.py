"""A folder of a stranger, in which a user calls the program: none of its files is run, and none changes what is built."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cutjoint.toolchain.compiler import find_compiler, find_tool, find_zig
from tests.conftest import MODELS
from tests.toolchain.test_locks import Site, output, pytestmark, site

__all__ = ["pytestmark", "site"]

#: Names by which a build calls its programs.
PROGRAMS = (
    "cmake", "ninja", "ninja-build", "samu", "make", "g++", "c++", "clang++", "gcc", "cc", "as", "ld", "collect2", "cc1plus", "ar",
    "ranlib", "sh", "python3", "bin/cmake",
)  # fmt: skip

#: Modules that the program and what it starts import, and files that CMake, GCC and Clang look for beside themselves.
MODULES = (
    "site.py", "sitecustomize.py", "json.py", "yaml.py", "numpy.py", "sympy.py", "typing.py", "subprocess.py", "_thread.py",
    "cutjoint/__init__.py", "ziglang/__init__.py",
)  # fmt: skip
BESIDE = (
    "Modules/CMake.cmake", "share/cmake-3.25/Modules/CMake.cmake", "CMakeLists.txt", "CMakePresets.json", "CMakeCache.txt",
    "build.ninja", "specs", "clang++.cfg", "vector", "cmath",
)  # fmt: skip


@pytest.fixture
def hostile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder whose files leave a trace beside it if they are run, or break what reads them."""
    folder, trace = tmp_path / "hostile", tmp_path / "trace"
    for name in (*PROGRAMS, *MODULES, *BESIDE, "ziglang/zig"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        code = f'#!/bin/sh\necho "$0" >> {trace}\nexit 1\n' if name in PROGRAMS or name == "ziglang/zig" else "no such language"
        code = f"open({str(trace)!r}, 'a').write(__file__ + '\\n')\nraise SystemExit(3)\n" if name in MODULES else code
        (folder / name).write_text(code, encoding="utf-8")
        (folder / name).chmod(0o755)
    yield folder
    assert not trace.exists(), trace.read_text(encoding="utf-8")


@pytest.mark.parametrize("path", ["{}", "./:.::{}:"])
def test_builds_take_nothing_from_the_present_folder(path: str, hostile: Path, site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    monkeypatch.chdir(hostile)
    monkeypatch.setenv("PATH", path.format(os.environ["PATH"]))
    for name in ("CXX", "PYTHONPATH"):
        monkeypatch.delenv(name, raising=False)
    assert output(site.build("one", ("-O0", "-fno-math-errno"))) == "one\n"  # these flags are tried first
    assert Path(find_compiler().command[0]).parent != hostile
    assert sorted(p.name for p in hostile.iterdir()) == sorted({name.split("/")[0] for name in (*PROGRAMS, *MODULES, *BESIDE)})


def test_folders_of_the_path_beside_the_present_one_are_searched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "some-tool").write_text("#!/bin/sh\n", encoding="utf-8")
    (tmp_path / "tools" / "some-tool").chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"tools:{os.environ['PATH']}")
    assert find_tool("some-tool") == str(tmp_path / "tools" / "some-tool")


def test_zig_of_the_present_folder_is_not_taken(hostile: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(hostile)
    for first in ("", str(hostile), "."):
        monkeypatch.setattr(sys, "path", [first, *(p for p in sys.path if p)])
        assert not str(find_zig()).startswith(str(hostile))


def test_the_command_imports_nothing_from_the_present_folder(hostile: Path) -> None:
    program = Path(sys.executable).with_name("cutjoint")
    (hostile / "model.yaml").write_text((MODELS / "pendulum.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([program, "check", "model.yaml"], cwd=hostile, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
