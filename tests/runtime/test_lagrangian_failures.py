"""Failures of the Lagrangian methods: with the place, the reason, and what was computed before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.overconstrained import IN_LINE, parallel_cranks_text
from tests.runtime.points import (
    AUGMENTED,
    CLASSICAL,
    METHODS,
    ORIGIN,
    PENDULUM,
    SOLVERS,
    four_bar,
    pivot,
    plane,
    point,
    redundant,
    run_file,
    simulate,
    simulator,
    start,
)

pytestmark = needs_cpp


def lying() -> dict[str, Any]:
    """Cranks that lie in line with their couplers: a dependence a loop."""
    bars = four_bar(2, 0.0)
    for i, p in enumerate(bars["points"]):
        p["at"] = [i + 1, 0, 0]
    return bars


@pytest.mark.parametrize(("system", "solver"), [*((redundant(PENDULUM), solver) for solver in SOLVERS[CLASSICAL]), (lying(), "emitted")])
def test_classical_says_that_equations_depend_on_each_other(system: dict[str, Any], solver: str, tmp_path: Path) -> None:
    """The solver need not have noticed: the pivots of a singular matrix are rounding, hardly ever zero."""
    failed = simulate(tmp_path, system, CLASSICAL, solver=solver).summary
    assert failed["message"] == "classical: the tangent is singular"
    assert failed["advice"] == (
        "equations may depend on each other here; try: another dt, or method augmented, which tolerates redundant and momentarily "
        "dependent equations"
    )
    assert (failed["step"], failed["steps"]) == (0, 0)


def test_classical_names_a_coordinate_that_nothing_resists(tmp_path: Path) -> None:
    loose = {**PENDULUM, "points": [*PENDULUM["points"], point(0.0, (5, 0, 0))]}
    failed = simulate(tmp_path, loose, CLASSICAL).summary
    assert failed["message"] == "classical: the tangent is singular"
    assert failed["element"].startswith("p1.")
    assert "without moving mass" in failed["advice"]


@pytest.mark.parametrize("solver", with_heavy(["emitted", "eigen-ldlt", "cholmod"], "eigen-ldlt", "cholmod"))
def test_augmented_names_the_coordinate_whose_pivot_is_not_positive(solver: str, tmp_path: Path) -> None:
    """A spring that pushes by 1e9 N/m outweighs 2 kg over a step of 1 ms, by dt^2/4 1e9 N/m = 250 kg."""
    system = {**PENDULUM, "points": [*PENDULUM["points"], point(2.0, (3, 0, 0))]}
    system["springs"] = [{"a": 1, "b": ORIGIN, "stiffness": -1e9}]
    failed = simulate(tmp_path, system, AUGMENTED, solver=solver).summary
    assert failed["message"] == "augmented: a pivot of the tangent is not positive"
    assert failed["element"].startswith("p1.")
    assert failed["advice"].startswith("a negative stiffness")
    assert failed["step"] == 1


@pytest.mark.parametrize("method", METHODS)
def test_what_was_computed_stays(method: str, tmp_path: Path) -> None:
    """A law that takes the root of the height fails when the point falls below zero, at sqrt(2 z / g) = 0.45 s; rows come each 0.1 s."""
    system: dict[str, Any] = {"points": [point(1.0, (0, 0, 1))], "equations": [], "springs": [{"a": 0, "b": ORIGIN, "root": True}]}
    system["equations"] = [{"a": 0, "b": ORIGIN, "normal": [1, 0, 0]}]
    run = simulate(tmp_path, system, method, output_step=0.1)
    failed = run.summary
    assert failed["status"] == "failed"
    assert failed["message"].startswith(f"{method}: ")
    assert failed["element"] == "p0.z"
    assert failed["step"] == failed["steps"] + 1
    assert failed["time"] == pytest.approx(failed["step"] * 1e-3)
    assert len(run.steps["t"]) == failed["steps"]
    assert run.t.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, failed["steps"] * 1e-3])
    assert np.isfinite(run.vectors()).all()


@pytest.mark.parametrize("method", METHODS)
def test_an_iteration_that_does_not_end(method: str, tmp_path: Path) -> None:
    run = simulate(tmp_path, PENDULUM, method, iterations=1)
    assert run.summary["message"] == f"{method}: Newton's iteration did not converge in 1 iterations"
    assert run.summary["element"] in ("p0.x", "p0.z")
    assert run.summary["advice"] == "it was still getting closer; try: more iterations, or a smaller dt"
    assert run.t.tolist() == [0.0]


def test_an_iteration_that_gets_nowhere(tmp_path: Path) -> None:
    """A tangent without the law's: the spring's stiffness of 1e9 N/m is felt, but not known, so that each iteration overshoots."""
    stiff = {
        "points": [point(2.0, (1, 0, 0))], "equations": [plane(0, (0, 1, 0), ORIGIN)],
        "springs": [{"a": 0, "b": pivot(1, 0, 0), "stiffness": 1e9, "known": False}],
    }  # fmt: skip
    failed = simulate(tmp_path, stiff, AUGMENTED).summary
    assert failed["message"].startswith("augmented: Newton's iteration diverges")
    assert failed["advice"] == "look at the forces on this coordinate, and whether it moves mass; try: a smaller dt"
    assert failed["step"] == 1


@pytest.mark.parametrize("method", METHODS)
def test_a_start_off_its_equations(method: str, tmp_path: Path) -> None:
    off = {**PENDULUM, "points": [point(2.0, (1.1, 0, 0))]}
    failed = simulate(tmp_path, off, method).summary
    assert failed["message"] == f"{method}: the start does not satisfy an equation"
    assert failed["element"] == "e0"


def refusal(folder: Path, method: str, solver: str, additions: tuple[str, ...] = ()) -> str:
    done = start(folder, run_file({**PENDULUM, "method": method}, "simulate", solver=solver), simulator(additions))
    assert done.returncode == 2
    return done.stderr.strip()


def test_solvers_that_do_not_fit(tmp_path: Path) -> None:
    assert refusal(tmp_path, AUGMENTED, "gauss") == (
        "error: no solver 'gauss' in this simulator, which has emitted; one of another package needs a simulator that is compiled with it"
    )


def test_the_compiler_names_the_body_that_classical_cannot_solve_for() -> None:
    """Of cranks in line with their coupler the pins' distances say the same for a moment."""
    model = read_model_text(f"{parallel_cranks_text(2, IN_LINE)}scenes: {{run: {{end: 1}}}}\n", "cranks.yaml")
    place = r"cranks\.yaml:[56]:3: body 'crank_[01]': what holds it at 'closure_[01]' follows from what holds other elements"
    with pytest.raises(RunError, match=rf"^{place} in the design position or near it, .*; use --method augmented or recursive$"):
        generate(model, model.scenes["run"], (), method="classical")
