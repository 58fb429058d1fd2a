"""Wheels for a platform on a machine without tools: an empty PATH, no compiler, no libraries of the system that order matrices."""

from __future__ import annotations

import ctypes
import ctypes.util
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.sparse.plan import LIBRARIES
from cutjoint.toolchain.build import build_interpreter
from cutjoint.toolchain.drivers import DRIVERS, shipped_simulator
from tests.conftest import MODELS, ROOT, needs_cpp, with_heavy
from tests.packaging.test_wheel import install

pytestmark = needs_cpp

#: Calls Python with a program and words, and gives what has come of it.
Bare = Callable[..., subprocess.CompletedProcess[str]]

FOUR_BAR, AXLE, PRESS = (str(MODELS / f"{name}.yaml") for name in ("four_bar", "axle", "press"))
TOOLS = "apt-get install g++ cmake ninja-build, or pip install 'cutjoint[compiler]'"
NEEDS = re.compile(rf"this needs generated code; missing: [^;]*; {re.escape(TOOLS)}")
COMMAND = "from cutjoint.cli import main; main()"

#: The largest difference (SI units) that rounding makes in half a second of the four-bar, whose rows are of size 10 at most.
ROUNDING = 1e-8


def with_this_machines(folder: Path) -> tuple[str, str]:
    """Python and its search path with a wheel that has the simulators and libraries of this machine."""
    binaries = folder / f"linux_{platform.machine()}"
    binaries.mkdir()
    for driver in DRIVERS:
        shutil.copy(build_interpreter(driver).path, binaries / shipped_simulator(driver).name)
    for name in LIBRARIES:
        ctypes.CDLL(ctypes.util.find_library(name))
        mapped = Path("/proc/self/maps").read_text(encoding="utf-8").split()
        shutil.copy(next(word for word in mapped if f"/lib{name}.so" in word), binaries / f"lib{name}.so")
    site = install(ROOT, folder, CUTJOINT_BINARIES=str(binaries))
    (wheel,) = (folder / "wheels").iterdir()
    assert wheel.name.endswith(f"-py3-none-{binaries.name}.whl")
    return sys.executable, str(site)


def with_those_of_the_script(folder: Path, extras: str = "") -> tuple[str, str]:
    """Python of a fresh virtual environment with the wheel that `scripts/wheel` makes."""
    if find_spec("ziglang") is None or platform.machine() != "x86_64":
        pytest.skip("needs ziglang and x86_64; pip install -e '.[wheel]'")
    name = "manylinux2014_x86_64"
    subprocess.run([sys.executable, str(ROOT / "scripts" / "wheel"), "--platform", name, "--out", str(folder / "dist")], check=True)
    subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
    (wheel,) = (folder / "dist").glob(f"*-{name}.whl")
    python = str(folder / "venv" / "bin" / "python")
    subprocess.run([python, "-I", "-m", "pip", "install", "--quiet", f"{wheel}{extras}"], check=True)
    return python, ""


@pytest.fixture(scope="module", params=with_heavy([with_this_machines, with_those_of_the_script], with_those_of_the_script))
def bare(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Bare:
    folder = tmp_path_factory.mktemp("bare")
    return caller(folder, *request.param(folder))


@pytest.fixture(scope="module")
def equipped(tmp_path_factory: pytest.TempPathFactory) -> Bare:
    """The wheel with the tools of PyPI, of which none is in the PATH."""
    folder = tmp_path_factory.mktemp("equipped")
    return caller(folder, *with_those_of_the_script(folder, "[compiler,sweep]"))


def caller(folder: Path, python: str, site: str) -> Bare:
    environment = {"PATH": str(folder / "nowhere"), "HOME": str(folder), "CUTJOINT_CACHE": str(folder / "cache"), "PYTHONPATH": site}

    def call(program: str, *words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [python, "-P", "-c", program, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
        )  # fmt: skip

    return call


def test_the_package_is_that_of_the_wheel(bare: Bare) -> None:
    done = bare("import cutjoint; from cutjoint.package.locations import binaries_folder; print(*sorted(binaries_folder().iterdir()))")
    assert str(ROOT) not in done.stdout
    for name in (*(f"lib{name}.so" for name in LIBRARIES), *(shipped_simulator(driver).name for driver in DRIVERS)):
        assert f"/{name}" in done.stdout, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("method", "integrator"),
    [
        ("recursive", "trapezoidal"), ("recursive", "dop853"), ("recursive-newton", "radau5"), ("augmented", "trapezoidal"),
        ("classical", "trapezoidal"),
    ],
)  # fmt: skip
def test_runs_are_those_of_generated_code(bare: Bare, tmp_path: Path, method: str, integrator: str) -> None:
    out = tmp_path / "rows.csv"
    words = ["simulate", FOUR_BAR, "--method", method, "--integrator", integrator, "--end", "0.5", "--out", str(out)]
    done = bare(COMMAND, *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"no C++ compiler: interpreted; generated code is 5 to 20 times as fast: {TOOLS}" in done.stdout
    run = cutjoint.simulate(cutjoint.compile_model(FOUR_BAR, method=method), integrator=integrator, end=0.5)
    rows = np.genfromtxt(out, delimiter=",", names=True, deletechars="")
    for name in run.columns:
        assert np.abs(rows[name] - run[name]).max() < ROUNDING, name


def test_the_second_run_is_found_in_the_cache(bare: Bare, tmp_path: Path) -> None:
    words = ["simulate", FOUR_BAR, "--end", "0.1", "--out", str(tmp_path / "rows.csv")]
    first = bare(COMMAND, *words)
    program = "import cutjoint.compile.pipeline as p; del p.compile_scene, p.compile_interpreted; " + COMMAND
    again = bare(program, *words)
    assert first.returncode == again.returncode == 0, again.stderr
    assert "no C++ compiler" in again.stdout


@pytest.mark.parametrize(
    "words",
    [
        ("check", AXLE), ("equilibrium", AXLE), ("modes", FOUR_BAR), ("modes", FOUR_BAR, "--at", "0.1"), ("explain", FOUR_BAR),
        ("view", FOUR_BAR, "--out", "page.html"), ("simulate", PRESS, "--out", "press.csv", "--plots", "plots", "--view", "press.html"),
        ("simulate", PRESS, "--out", "press.csv", "--method", "auto", "--accuracy", "1e-3"),
    ],
    ids=lambda words: "-".join(words[::2]).replace(str(MODELS), ""),
)  # fmt: skip
def test_other_commands(bare: Bare, words: tuple[str, ...]) -> None:
    done = bare(COMMAND, *words)
    assert done.returncode == 0, done.stdout + done.stderr


def test_batches_have_the_results_of_generated_code(bare: Bare, tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text("stiffness\n1000\n4000\n", encoding="utf-8")
    done = bare(COMMAND, "batch", PRESS, str(tmp_path / "cases.csv"), "--dt", "0.001", "--out", str(tmp_path / "out.csv"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "one by one" in done.stdout
    expected = cutjoint.simulate_batch(cutjoint.compile_batch(PRESS), [{"stiffness": 1000.0}, {"stiffness": 4000.0}], dt=0.001)
    rows = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True, deletechars="")
    assert rows["slider.x.max"] == pytest.approx(expected.maximum["slider.x"], abs=1e-7)


@pytest.mark.parametrize(
    "words", [
        ("simulate", FOUR_BAR, "--out", "rows.csv", "--implementation", "generated"), ("compile", FOUR_BAR, "--out", "folder"),
        ("realtime", FOUR_BAR),
    ],
    ids=lambda words: words[0],
)  # fmt: skip
def test_what_takes_generated_code_says_so(bare: Bare, words: tuple[str, ...]) -> None:
    done = bare(COMMAND, *words)
    assert done.returncode == 1
    assert NEEDS.match(done.stderr), done.stderr


def test_a_simulation_that_a_host_holds_takes_generated_code(bare: Bare) -> None:
    done = bare("import sys, cutjoint; cutjoint.load(sys.argv[1])", FOUR_BAR)
    assert NEEDS.match(done.stderr.partition("MissingToolsError: ")[2]), done.stderr


@pytest.mark.heavy
def test_with_the_tools_of_pypi_all_of_it_runs(equipped: Bare, tmp_path: Path) -> None:
    """Simulations that hosts hold are those of this machine's compiler; all that takes generated code works."""
    program = "import sys, cutjoint; s = cutjoint.load(sys.argv[1]).reset(); s.run(200); print(*s.outputs.array)"
    done = equipped(program, FOUR_BAR)
    assert done.returncode == 0, done.stdout + done.stderr
    simulation = cutjoint.load(FOUR_BAR).reset()
    simulation.run(200)
    np.testing.assert_allclose(np.array(done.stdout.split(), float), simulation.outputs.array, rtol=0, atol=1e-12)
    study = tmp_path / "study.yaml"
    study.write_text(
        f"cutjoint_study: 1\nmodel: {PRESS}\nparameters: {{stiffness: [1000, 2000]}}\nobjectives: {{peak: {{maximum: slider.x}}}}\n",
        encoding="utf-8",
    )
    for words in (
        ("simulate", FOUR_BAR, "--implementation", "generated", "--out", "rows.csv"), ("sweep", str(study), "--out", "table.parquet"),
        ("realtime", FOUR_BAR), ("compile", FOUR_BAR, "--out", "folder"), ("export", FOUR_BAR, "--to", "fmu", "--out", "four_bar.fmu"),
    ):  # fmt: skip
        done = equipped(COMMAND, *words)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "interpreted" not in done.stdout
