"""Other systems than Linux: what differs is asked for in one place, and the wheel for Windows has the numbers of this machine, by Wine.

With $CUTJOINT_WINDOWS_PYTHON, a folder with Python 3.11 for Windows (`python.exe`) and the packages that cutjoint needs in `site`, the
commands run there too.
"""

from __future__ import annotations

import ast
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import numpy as np
import pytest

import cutjoint
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import Implementation
from cutjoint.package import system
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import find_case
from cutjoint.run.settings import PLAIN_STEPS
from tests.conftest import MODELS, ROOT, needs_cpp

PACKAGE = ROOT / "compiler" / "cutjoint"

#: Modules and functions that Windows or macOS do not have.
MODULES = {"fcntl", "grp", "pwd", "resource", "termios", "pty", "msvcrt", "winreg", "_winapi"}
FUNCTIONS = {
    "os": {"fchmod", "fork", "geteuid", "getuid", "killpg", "mkfifo", "nice", "posix_spawn", "posix_spawnp", "sched_getaffinity",
           "sched_getparam", "sched_getscheduler", "sched_setaffinity", "sched_setscheduler", "sched_param", "set_blocking", "uname",
           "O_NOFOLLOW", "O_NONBLOCK", "O_NOCTTY", "SCHED_FIFO", "POSIX_SPAWN_OPEN", "statvfs", "chown"},
    "signal": {"SIGHUP", "SIGKILL", "SIGPIPE", "SIGXFSZ", "SIGUSR1", "SIGALRM", "alarm", "setitimer"},
}  # fmt: skip

#: The modules that have them: the one of what differs, and programs and checks that only run where those are.
THEIRS = {
    "package/system.py": "all",
    "toolchain/supervisor.py": "keeps compilers, which there are none of on Windows",
    "toolchain/background.py": "compiles",
    "toolchain/trust.py": "owners and groups of files, behind IS_WINDOWS",
    "tasks/realtime.py": "asks hasattr first",
    "run/stopping.py": "asks hasattr first",
    "run/result_files.py": "blocking pipes, behind IS_WINDOWS",
}


def uses(tree: ast.AST) -> Iterator[str]:
    """The modules and functions of one system that a module names."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            yield str(node.module)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.attr in FUNCTIONS.get(node.value.id, ()):
            yield f"{node.value.id}.{node.attr}"


def test_what_systems_differ_in_stands_in_one_place() -> None:
    trees = {path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")}
    found = {name: sorted(set(uses(tree))) for name, tree in trees.items()}
    assert {name: words for name, words in found.items() if words and name not in THEIRS} == {}
    assert [name for name in THEIRS if not found[name]] == []


def test_libraries_and_programs_have_the_names_of_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    names = {}
    for each in ("linux", "darwin", "win32"):
        monkeypatch.setattr(sys, "platform", each)
        names[each] = system.library_file("amd")
    assert names == {"linux": "libamd.so", "darwin": "libamd.dylib", "win32": "amd.dll"}


def test_flags_that_a_system_lacks_are_left_out() -> None:
    assert system.open_flags("O_RDWR", "O_CREAT", "O_SUCH_THING") == os.O_RDWR | os.O_CREAT


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if find_spec("ziglang") is None or platform.machine() != "x86_64":
        pytest.skip("needs ziglang and x86_64; pip install -e '.[wheel]'")
    if which("wine") is None:
        pytest.skip("needs wine64 and wine")
    out = tmp_path_factory.mktemp("windows")
    subprocess.run([sys.executable, str(ROOT / "scripts" / "wheel"), "--platform", "win_amd64", "--out", str(out)], check=True)
    (made,) = out.glob("*-win_amd64.whl")
    return made


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """The environment in which Wine has a place of its own, as Windows 10."""
    place = tmp_path_factory.mktemp("wine")
    found = {**os.environ, "WINEPREFIX": str(place), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree=;mshtml=;winemenubuilder.exe=d"}
    subprocess.run(["wine", "winecfg", "-v", "win10"], env=found, check=True, capture_output=True)
    yield found
    shutil.rmtree(place, ignore_errors=True)


@pytest.mark.heavy
@needs_cpp
@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_the_simulators_for_windows_have_the_rows_of_this_machine(
    wheel: Path, environment: dict[str, str], tmp_path: Path, method: str
) -> None:  # fmt: skip
    """Both interpret the same program, by another compiler and another C library's sines."""
    with zipfile.ZipFile(wheel) as files:
        names = [name for name in files.namelist() if "/binaries/" in name]
        files.extractall(tmp_path)
    assert {Path(name).name for name in names} >= {
        "simulator-recursive.exe",
        "simulator-lagrangian.exe",
        "amd.dll",
        "colamd.dll",
        "metis.dll",
    }
    model, scene = find_case(cutjoint.read_model(MODELS / "press.yaml"), None)
    artifact = compile_interpreted(model, scene, method=method)
    to_rounding = replace(PLAIN_STEPS, tolerance=1e-13)
    run_file = make_run_file(
        model, scene, {}, task="simulate", method=method, implementation=Implementation.INTERPRETED, options=to_rounding
    ).entries()  # fmt: skip
    tables = []
    for name, program in (("here", [str(artifact.binary.path)]), ("there", ["wine", program_of(tmp_path, method)])):
        out = tmp_path / f"{name}.csv"
        (tmp_path / "run.json").write_text(json.dumps({**run_file, "model": artifact.description, "out": str(out)}), encoding="utf-8")
        subprocess.run([*program, str(tmp_path / "run.json")], env=environment, check=True, capture_output=True)
        assert b"\r" not in out.read_bytes()
        tables.append(np.genfromtxt(out, delimiter=",", names=True, deletechars=""))
    for column in tables[0].dtype.names or ():
        assert np.abs(tables[0][column] - tables[1][column]).max() < 1e-9, column


def program_of(folder: Path, method: str) -> str:
    driver = "recursive" if method == "recursive" else "lagrangian"
    return str(folder / "cutjoint" / "binaries" / f"simulator-{driver}.exe")


@pytest.mark.heavy
@pytest.mark.skipif("CUTJOINT_WINDOWS_PYTHON" not in os.environ, reason="$CUTJOINT_WINDOWS_PYTHON names no folder with Python for Windows")
def test_the_commands_run_on_windows(wheel: Path, environment: dict[str, str], tmp_path: Path) -> None:
    folder, site = Path(os.environ["CUTJOINT_WINDOWS_PYTHON"]), tmp_path / "site"
    install = ["--quiet", "--no-deps", "--target", str(site), "--platform", "win_amd64", "--only-binary", ":all:", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", "install", *install], check=True)
    paths = {"PYTHONPATH": f"Z:{site};Z:{folder / 'site'}", "CUTJOINT_CACHE": f"Z:{tmp_path / 'cache'}", "PYTHONUTF8": "1"}

    def call(*words: str) -> str:
        program = ["wine", str(folder / "python.exe"), "-c", "from cutjoint.cli import main; main()", *words]
        done = subprocess.run(program, cwd=tmp_path, env={**environment, **paths}, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    press, iltis, axle = (f"Z:{MODELS / name}.yaml" for name in ("press", "iltis", "axle"))
    for method in ("recursive", "recursive-newton", "augmented", "classical"):
        said = call("simulate", press, "--method", method, "--end", "0.5", "--out", f"{method}.csv")
        assert re.search(r"no C\+\+ compiler: interpreted;.*Windows Subsystem for Linux", " ".join(said.split()))
        here = cutjoint.simulate(MODELS / "press.yaml", method=method, end=0.5)
        rows = np.genfromtxt(tmp_path / f"{method}.csv", delimiter=",", names=True, deletechars="")
        for column in here:
            assert np.abs(rows[column] - here[column]).max() < 1e-5, (method, column)
    call("simulate", press, "--out", "press.csv", "--plots", "plots", "--view", "press.html")
    for words in (
        ("check", iltis),
        ("equilibrium", iltis, "--scene", "simul1"),
        ("modes", press),
        ("kinematics", axle),
    ):
        call(*words)
