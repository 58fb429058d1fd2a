"""Newton's iteration on the recursion: steps that the fixed point cannot take, order, constraints, singular poses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory, read_table
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp
from tests.physics.simulation import compile_model

pytestmark = needs_cpp


@cache
def compiled(name: str, scene: str | None = None) -> Artifact:
    return compile_model(MODELS / f"{name}.yaml", scene=scene, method="recursive-newton")


def finished(artifact: Artifact, **how: object) -> Trajectory:
    run = simulate(artifact, **how, check=False)
    assert run.failure is None, run.failure
    return run


def test_long_steps_on_stiff_bumpers() -> None:
    """The fixed point diverges at 5 and at 7.5 ms on bumpers of 1e7 N/m."""
    artifact = compiled("iltis", "simul1s")
    for dt in (0.005, 0.0075, 0.01):
        run = finished(artifact, dt=dt)
        assert run.statistics.residuals.position < 1e-10
        assert np.isfinite(np.array(list(run.columns.values()))).all()


@pytest.mark.parametrize(("dt", "at_most"), [(0.005, 3.2), (0.0075, 4.0), (0.01, 4.4)])
def test_iterations_on_stiff_bumpers(dt: float, at_most: float) -> None:
    """Measured: 3.02, 3.70, 4.29 on average.  Four were asked for at each; 10 ms is the known shortfall."""
    run = finished(compiled("iltis", "simul1s"), dt=dt)
    assert run.statistics.iterations < at_most * run.steps


def test_operations_of_an_iteration_stay_what_they_are() -> None:
    """Figures to notice changes by, 2 % above those of today; instructions take four suspensions in lanes for one."""
    program = compiled("iltis", "simul1s").program
    assert program.operations("dynamic_residual") < 1.02 * 6019
    assert program.instructions("dynamic_residual") < 1.02 * 1669
    assert program.operations("linearise") < 1.02 * 49611
    assert program.instructions("linearise") < 1.02 * 13182


@pytest.mark.parametrize("dt", [0.015, 0.02, 0.03])
def test_very_long_steps_on_stiff_bumpers(dt: float) -> None:
    """Contacts that the iteration does not find its way through at once, which steps in parts do."""
    run = finished(compiled("iltis", "simul1s"), dt=dt)
    assert run.statistics.residuals.position < 1e-10
    assert run.statistics.residuals.velocity < 1e-5


def test_steps_in_parts() -> None:
    """Steps for which the iteration has too few passes are taken in parts: rows and motions stay as they were."""
    artifact = compiled("iltis", "simul1")
    numerics = replace(artifact.scene.numerics, iterations=2)
    whole = finished(artifact, dt=0.005, end=4.0)
    parts = finished(replace(artifact, scene=replace(artifact.scene, numerics=numerics)), dt=0.005, end=4.0)
    assert whole.statistics.substeps == 0
    assert parts.statistics.substeps >= 2
    assert parts.steps == whole.steps
    assert parts.t == pytest.approx(whole.t, abs=1e-12)
    assert parts.statistics.residuals.position < 1e-10
    assert parts.columns["chassis.z"] == pytest.approx(whole.columns["chassis.z"], abs=2e-4)


def test_a_step_whose_parts_fail_ends_the_run() -> None:
    """No part converges in one iteration; the state is that before the step."""
    artifact = compiled("iltis", "simul1")
    numerics = replace(artifact.scene.numerics, iterations=1)
    run = simulate(replace(artifact, scene=replace(artifact.scene, numerics=numerics)), dt=0.005, tolerance=1e-13, check=False)
    assert run.failure is not None
    assert run.failure.message == "recursive-newton: Newton's iteration did not converge in 1 iterations"
    assert len(run.t) == run.failure.step


def test_short_steps_keep_their_factors() -> None:
    """A tangent in less than four of ten steps, where it would cost as much as three or four iterations; no step is taken in parts."""
    run = finished(compiled("iltis", "simul1"), dt=0.00125, end=5.0)
    assert run.statistics.factorisations < 0.4 * run.steps
    assert run.statistics.iterations < 2.8 * run.steps
    assert run.statistics.substeps == 0


def test_accuracy_does_not_depend_on_kept_factors() -> None:
    """Whenever tangents are renewed, a run is as near to that of a small tolerance as its own says."""
    artifact = compiled("iltis", "simul1")
    run, close = (finished(artifact, dt=0.0025, end=5.0, tolerance=tolerance) for tolerance in (1e-6, 1e-10))
    for column in ("chassis.x", "chassis.z"):
        assert run.columns[column] == pytest.approx(close.columns[column], abs=5e-6)


def test_long_steps_of_the_vehicle() -> None:
    """Beyond 17.5 ms, where the fixed point ends at 9 ms; equations are closed and the road is felt as at shorter steps."""
    artifact = compiled("iltis", "simul1")
    long, short = (finished(artifact, dt=dt, end=1.4) for dt in (0.02, 0.0025))
    for column in ("chassis.z", "chassis.pitch"):
        assert long.columns[column][-1] == pytest.approx(short.columns[column][-1], abs=2e-4)
    run = finished(artifact, dt=0.03)
    assert run.statistics.residuals.position < 1e-10


def test_order_two_on_the_stiff_governor() -> None:
    """Flyball governor, eigenvalue -8075/s, at steps of up to ten milliseconds, against the reference."""
    artifact = compiled("flyball")
    t, reference = read_table(Path(__file__).parents[1] / "data" / "ref_a05_flyball.csv")
    errors = []
    for dt in (0.01, 0.005, 0.0025):
        run = finished(artifact, dt=dt, end=5.0)
        s = np.interp(run.t, t, reference[next(iter(reference))])
        name = next(c for c in run.columns if c.endswith("slider.z"))
        errors.append(float(np.abs(run.columns[name] - s)[np.isin(np.round(run.t, 9), np.round(t, 9))].max()))
    orders = [np.log2(a / b) for a, b in pairwise(errors)]
    assert errors[-1] < 1e-4
    assert orders == pytest.approx([2.0, 2.0], abs=0.1), errors


def test_same_discrete_solution_as_the_fixed_point() -> None:
    """On a tree, the trapezoidal rule has one solution whatever iteration finds it."""
    newton = finished(compiled("pendulum"), dt=0.01)
    fixed_point = simulate(compile_model(MODELS / "pendulum.yaml", method="recursive"), dt=0.01, tolerance=1e-13)
    for column, values in fixed_point.columns.items():
        assert newton.columns[column] == pytest.approx(values, abs=1e-9)


@pytest.mark.parametrize("integrator", ["trapezoidal", "generalised-alpha"])
@pytest.mark.parametrize(("dt", "gap"), [(0.0025, 1e-10), (0.004, 2e-9), (0.005, 1e-10), (0.008, 2e-9), (0.01, 1e-10)])
def test_four_bar_steps_over_its_singular_poses(dt: float, gap: float, integrator: str) -> None:
    """Through the poses where all bars are in line, by steps that do not come near them.

    Loops are closed to 1e-11 m, but where a step ends within 0.002 rad of a pose, as it does of these at 4 and 8 ms: there to 7e-10 m.
    """
    run = finished(compiled("four_bar"), dt=dt, integrator=integrator)
    assert np.hypot(run.columns["tip.x"], run.columns["tip.y"]) == pytest.approx(np.ones(len(run.t)), abs=1e-9)
    assert np.abs(run.columns["tip.y"] - np.cos(parallelogram(run.t))).max() < (30 if gap > 1e-10 else 10) * dt**2
    assert run.statistics.residuals.position < gap
    assert run.statistics.residuals.velocity < 1e-6


@pytest.mark.parametrize("integrator", ["trapezoidal", "generalised-alpha"])
@pytest.mark.parametrize("dt", [0.002, 0.714355529292960 / 40, 0.714355529292960 / 143])
def test_four_bar_says_where_it_meets_a_singular_pose(dt: float, integrator: str) -> None:
    """The last two step sizes meet the first pose exactly; 2 ms goes over six poses and comes too near the seventh."""
    run = simulate(compiled("four_bar"), dt=dt, integrator=integrator, check=False)
    assert run.failure is not None
    assert "the pose is singular, or nearly" in run.failure.message
    assert run.failure.advice == "try: another dt, or the methods augmented and recursive, which can cross such poses"
    assert np.abs(run.columns["tip.y"] - np.cos(parallelogram(run.t))).max() < 10 * dt**2
    assert run.statistics.residuals.position < 2e-9


def with_penalty(artifact: Artifact, penalty: float) -> Artifact:
    """As a scene says it: methods: {recursive-newton: {penalty: ...}}."""
    numerics = replace(artifact.scene.numerics, methods={"recursive-newton": {"penalty": penalty}})
    return replace(artifact, scene=replace(artifact.scene, numerics=numerics))


#: A model, the length of its run, and the least penalty of those tried that its steps go with: dt^2/4 of it is about the masses.
LEAST_PENALTIES = [
    ("four_bar", None, 0.6, 1e8), ("slider_crank", None, 2.0, 1e8), ("andrews", None, 0.05, 1e9), ("iltis", "simul1", 1.5, 1e8),
]  # fmt: skip


@pytest.mark.parametrize(("model", "scene", "end", "least"), LEAST_PENALTIES, ids=[x[0] for x in LEAST_PENALTIES])
def test_constraints_hold_at_any_penalty_from_the_least_on(model: str, scene: str | None, end: float, least: float) -> None:
    """The issue's bound is 1e-10 m; 2e-12 is the most of these, Andrews' mechanism at 1e9."""
    runs = [finished(with_penalty(compiled(model, scene), penalty), end=end) for penalty in (least, 1e10, 1e12)]
    assert [run.statistics.penalty for run in runs] == [least, 1e10, 1e12]
    assert all(run.statistics.residuals.position < 1e-11 for run in runs)
    assert runs[0].statistics.iterations > runs[1].statistics.iterations  # it does act
    for column in runs[0].columns:
        size = np.abs(runs[2].columns[column]).max()
        assert runs[0].columns[column] == pytest.approx(runs[2].columns[column], abs=1e-4 * (1 + size)), column


@pytest.mark.parametrize(("model", "scene", "penalty"), [("slider_crank", None, 1e6), ("andrews", None, 1e8), ("iltis", "simul1", 1e6)])
def test_a_penalty_below_the_masses_ends_the_run_at_its_first_step(model: str, scene: str | None, penalty: float) -> None:
    """Known, and docs/how-to/troubleshooting.md says so: what is left of a gap by one projection is taken for a singular pose."""
    failure = simulate(with_penalty(compiled(model, scene), penalty), end=0.1, check=False).failure
    assert failure is not None
    assert failure.step == 1
    assert "the pose is singular, or nearly" in failure.message


def parallelogram(t: np.ndarray) -> np.ndarray:
    """The crank's angle from the vertical: th'' = c sin th, by SciPy at a tight tolerance."""
    c = 9.81 * (3 / 2 + 2) / (3 / 3 + 2)
    return solve_ivp(lambda _, y: [y[1], c * np.sin(y[0])], (0, t[-1]), [0.0, 1.0], "DOP853", t, rtol=1e-12, atol=1e-12).y[0]
