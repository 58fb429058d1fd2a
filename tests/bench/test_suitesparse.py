"""Solvers of Eigen and SuiteSparse in a driver; `points.SOLVERS` has them in the tests of all solvers."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.pipeline import compile_model
from cutjoint.methods import METHODS, names_of
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import require_choice
from cutjoint.run.simulation import simulate
from cutjoint_bench.driver import ADDED_SOLVERS, ALL_SOLVERS
from tests.conftest import MODELS
from tests.physics.simulation import completed
from tests.physics.test_lagrangian import LAGRANGIAN, PLACE, apart
from tests.runtime.points import CLASSICAL, PENDULUM, run_file, simulator, start
from tests.runtime.test_lagrangian_failures import refusal

pytestmark = pytest.mark.heavy


@pytest.mark.parametrize("method", LAGRANGIAN)
def test_solvers_agree(method: str) -> None:
    """Every library finds the motion that the emitted factorisation finds; with the widest vectors, whose memory is aligned otherwise."""
    flags = ("-O1", "-march=native")
    artifact = compile_model(MODELS / "iltis.yaml", scene="simul3", method=method, additions=ADDED_SOLVERS, flags=flags)
    runs = {
        solver: completed(simulate(artifact, end=2.0, solver=solver))
        for solver in names_of(ALL_SOLVERS, lambda s: s.suits(METHODS[method]))
    }
    for solver, run in runs.items():
        assert run.statistics.solver == solver
        assert apart(run, runs["emitted"], PLACE) < 1e-9


def test_the_plain_driver_does_without_suitesparse(tmp_path: Path) -> None:
    plain, comparing = simulator(()), simulator(ADDED_SOLVERS)
    for library in (solver.name for solver in ALL_SOLVERS.values() if solver.double_only):
        assert library in linked_by(comparing)
        assert library not in linked_by(plain)
    done = start(tmp_path, run_file({**PENDULUM, "method": CLASSICAL}, "simulate", out=str(tmp_path / "table.csv")), plain)
    assert done.returncode == 0, done.stderr


def linked_by(binary: Path) -> str:
    return subprocess.run(["ldd", binary], capture_output=True, text=True, check=True).stdout


def test_solvers_that_do_not_fit(tmp_path: Path) -> None:
    assert refusal(tmp_path, CLASSICAL, "cholmod", ADDED_SOLVERS) == (
        "error: solver 'cholmod' factors symmetric matrices, and that of the classical method is not; use emitted, eigen-lu, klu, umfpack"
    )
    assert "no solver 'gauss'" in refusal(tmp_path, CLASSICAL, "gauss", ADDED_SOLVERS)
    with pytest.raises(RunError, match=r"^the solver klu is in double alone, not in quad$"):
        require_choice("classical", "quad", ["klu"])


def test_the_command_line_has_them(tmp_path: Path) -> None:
    how = ["--method", "classical", "--solver", "klu", "--end", "0.1", "--out", str(tmp_path / "out.csv")]
    done = CliRunner().invoke(main, ["simulate", str(MODELS / "four_bar.yaml"), *how])
    assert (done.exit_code, (tmp_path / "out.csv").exists()) == (0, True), done.output
