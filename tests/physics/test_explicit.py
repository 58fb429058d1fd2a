"""Explicit integrators: orders, errors that follow the tolerance, closed loops; test_events.py has the order across events."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from cutjoint.model.read import read_model
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint_bench.studies.problems import PROBLEMS, measure_errors
from tests.conftest import MODELS
from tests.physics.simulation import compile_model, compile_scene, compile_text, completed, simulate
from tests.physics.test_iltis_references import check_in_phase_bump
from tests.physics.test_spin import SPIN, TEXT, attitude, body_rates

BY_NAME = {p.name: p for p in PROBLEMS}


@cache
def compiled(name: str, scene: str | None = None) -> Artifact:
    return compile_model(MODELS / f"{name}.yaml", scene=scene)


def orders(errors: Sequence[float]) -> list[float]:
    """The order of each halving of the step."""
    return [float(np.log2(a / b)) for a, b in pairwise(errors)]


def check_proportional(error: Callable[[float], float], tolerances: Sequence[float], *, within: float = 3.0) -> None:
    """Errors over tolerance stay within a factor, over decades of tolerance: the sign of an order that is kept everywhere."""
    ratios = [error(tolerance) / tolerance for tolerance in tolerances]
    assert np.max(ratios) < within * np.min(ratios), ratios  # of nan too, which max passes over


#: Problem, length of the run (A02 before its singular pose), steps for RK4.
SMOOTH = [("A01", 2.0, (4e-2, 2e-2, 1e-2)), ("A02", 0.6, (4e-2, 2e-2, 1e-2)), ("SC3D", 1.0, (6.25e-4, 3.125e-4, 1.5625e-4))]


@pytest.mark.parametrize(("name", "end", "steps"), SMOOTH, ids=[s[0] for s in SMOOTH])
def test_fourth_order(name: str, end: float, steps: tuple[float, ...]) -> None:
    problem = BY_NAME[name]
    runs = [completed(simulate(compiled(problem.model), integrator="rk4", dt=dt, end=end)) for dt in steps]
    errors = [measure_errors(problem, run).largest for run in runs]
    assert orders(errors) == pytest.approx([4, 4], abs=0.3)


@pytest.mark.parametrize(("name", "end"), [(s[0], s[1]) for s in SMOOTH])
def test_errors_follow_the_tolerance(name: str, end: float) -> None:
    problem = BY_NAME[name]

    def error(tolerance: float) -> float:
        run = completed(simulate(compiled(problem.model), integrator="dormand-prince", tolerance=tolerance, end=end))
        return measure_errors(problem, run).largest

    check_proportional(error, (1e-5, 1e-6, 1e-7, 1e-8, 1e-9), within=6.0)


@pytest.mark.parametrize(("name", "end", "tolerances"), [("A01", 10.0, (1e-8, 1e-10, 1e-12)), ("SC3D", 5.0, (1e-6, 1e-8, 1e-10))])
def test_eighth_order(name: str, end: float, tolerances: tuple[float, ...]) -> None:
    """With rows closer than the pendulum's steps, so that its errors are those of the interpolant too."""
    problem = BY_NAME[name]
    artifact = compiled(problem.model) if name == "SC3D" else with_rows(compiled(problem.model), 5e-3)
    runs = [completed(simulate(artifact, integrator="dop853", tolerance=x, end=end)) for x in tolerances]
    assert name == "SC3D" or all(run.steps < len(run.t) / 7 for run in runs)
    coarse, fine = runs[0], runs[-1]
    order = np.log(measure_errors(problem, coarse).largest / measure_errors(problem, fine).largest) / np.log(fine.steps / coarse.steps)
    assert order == pytest.approx(8, abs=0.6)


@pytest.mark.parametrize(("name", "end"), [("A01", 10.0), ("A02", 0.6), ("SC3D", 5.0)])
def test_fifth_order(name: str, end: float) -> None:
    """With steps of the tolerance's fifth root the error goes with the fifth power of the number of steps.

    SC3D's falls with the sixth: its controller rejects fewer steps the smaller the tolerance is.
    """
    problem = BY_NAME[name]
    tolerances = (1e-7, 1e-9, 1e-11)
    runs = [completed(simulate(compiled(problem.model), integrator="dormand-prince", tolerance=x, end=end)) for x in tolerances]
    errors, steps = [measure_errors(problem, run).largest for run in runs], [run.steps for run in runs]
    found = [np.log(a / b) / np.log(n / m) for (a, b), (m, n) in zip(pairwise(errors), pairwise(steps), strict=True)]
    assert found == pytest.approx([6, 6] if name == "SC3D" else [5, 5], abs=0.3)


def test_fourth_order_on_andrews_mechanism() -> None:
    """Over eight times fewer steps the mean order; single halvings show 4.6 to 5.1."""
    problem = BY_NAME["A03"]
    coarse, fine = (completed(simulate(compiled("andrews"), integrator="rk4", dt=dt, end=0.05)) for dt in (1.25e-4, 1.5625e-5))
    assert np.log(measure_errors(problem, coarse).largest / measure_errors(problem, fine).largest) / np.log(8) > 4


def test_order_of_a_body_that_spins_in_space(tmp_path: Path) -> None:
    """Quaternions: body rates and momentum, through flips that magnify whatever error there is."""
    artifact = compile_text(tmp_path, TEXT)

    def error(**how: float | str) -> float:
        run = completed(simulate(artifact, end=6.0, **how))  # type: ignore[arg-type]
        R = np.array([attitude(*angles) for angles in zip(run["book.roll"], run["book.pitch"], run["book.yaw"], strict=True)])
        w = np.stack([run[f"book.w{a}"] for a in "xyz"], axis=1)
        momentum = np.einsum("nij,j,nkj,nk->ni", R, [1.0, 2.0, 3.0], R, w)
        assert momentum[0] == pytest.approx(np.array([1.0, 2.0, 3.0]) * SPIN, abs=1e-12)
        rates = np.abs(np.einsum("nji,nj->ni", R, w) - body_rates(run.t)).max()
        return float(np.max([rates, np.abs(momentum - momentum[0]).max()]))

    assert orders([error(integrator="rk4", dt=dt) for dt in (1e-2, 5e-3, 2.5e-3)]) == pytest.approx([4, 4], abs=0.3)
    check_proportional(lambda x: error(integrator="dormand-prince", tolerance=x), (1e-5, 1e-6, 1e-7, 1e-8), within=6.0)


def test_rows_do_not_limit_steps() -> None:
    """The pendulum with rows 100 times as far apart: the same steps, and as accurate between them."""
    many, few = (
        completed(simulate(with_rows(compiled("pendulum"), row), integrator="dormand-prince", tolerance=1e-8, end=5.0))
        for row in (1e-3, 1e-1)
    )  # fmt: skip
    assert (many.steps, many.evaluations, many.statistics.rejected) == (few.steps, few.evaluations, few.statistics.rejected)
    assert many["bob.x"][::100] == pytest.approx(few["bob.x"], abs=1e-13)
    errors = [measure_errors(BY_NAME["A01"], run).largest for run in (many, few)]
    assert errors[0] < 3 * errors[1]


def test_rows_ask_for_what_lies_between() -> None:
    """Steps of dop853 are the same with any rows; three more evaluations go to each step that a row lies in."""
    many, few = (
        completed(simulate(with_rows(compiled("pendulum"), row), integrator="dop853", tolerance=1e-8, end=5.0, error=False))
        for row in (1e-3, 1.0)
    )  # fmt: skip
    assert (many.steps, many.statistics.rejected) == (few.steps, few.statistics.rejected)
    assert many.evaluations - few.evaluations == 3 * (many.steps - len(few.t))
    assert many["bob.x"][::1000] == pytest.approx(few["bob.x"], abs=1e-13)


def with_rows(artifact: Artifact, row: float) -> Artifact:
    return replace(artifact, scene=replace(artifact.scene, output_step=row))


@pytest.mark.parametrize("model", ["four_bar", "slider_crank", "andrews"])
@pytest.mark.parametrize(
    "how", [{"integrator": "rk4"}, {"integrator": "dormand-prince", "tolerance": 1e-5}, {"integrator": "dop853", "tolerance": 1e-6}]
)
def test_loops_stay_closed(model: str, how: dict[str, float | str], tmp_path: Path) -> None:
    end = {"four_bar": 0.6, "slider_crank": 2.0, "andrews": 0.05}[model]
    run = completed(simulate(compiled(model), end=end, steps=tmp_path / "steps.csv", **how))  # type: ignore[arg-type]
    assert run.statistics.residuals.position < 1e-10
    assert run.statistics.residuals.velocity < 1e-9


#: Ends of runs; the four-bar's before its first singular pose.
SWEPT = [("four_bar", None, 0.6), ("slider_crank", None, 2.0), ("andrews", None, 0.05), ("iltis", "iavsd_inphase_5", 0.3)]


@pytest.mark.parametrize("penalty", [1e6, 1e9, 1e12])
@pytest.mark.parametrize(("model", "scene", "end"), SWEPT, ids=[x[0] for x in SWEPT])
def test_constraints_hold_at_any_penalty(model: str, scene: str | None, end: float, penalty: float, tmp_path: Path) -> None:
    """The bound is 1e-10 m; projections end with less than 1e-12.  What the motion loses is the next test's.

    Beside 1e12 rounding takes the masses of Andrews' mechanism.  A run may end there without a number, which it says; it holds until then.
    """
    artifact = compiled(model, scene)
    for how in ({"integrator": "dormand-prince", "tolerance": 1e-4}, {"integrator": "rk4"}):
        run = simulate(artifact, end=end, penalty=penalty, steps=tmp_path / "steps.csv", check=False, **how)  # type: ignore[arg-type]
        assert run.statistics.residuals.position < 1e-12, how
        if (model, penalty) != ("andrews", 1e12) or run.failure is None:
            completed(run)
        else:
            assert run.failure.message in ("the equations of motion cannot be solved", "the accelerations have no finite value")


def test_a_larger_penalty_leaves_fewer_digits() -> None:
    """Errors of the four-bar at 1 ms: 3e-11, 3e-8 and 3e-5 m at 1e6, 1e9 and 1e12; and fewer passes."""
    model = read_model(MODELS / "four_bar.yaml")
    artifact = compile_scene(model, with_closure(find_scene(model, None), "penalty"))
    runs = [completed(simulate(artifact, integrator="rk4", dt=1e-3, end=0.6, penalty=x)) for x in (1e6, 1e9, 1e12)]
    errors = [measure_errors(BY_NAME["A02"], run).largest for run in runs]
    assert errors[0] < 1e-9 < errors[1] < 1e-6 < errors[2] < 1e-4
    assert runs[0].evaluations > 1.5 * runs[1].evaluations


def vehicle(tmp_path: Path, **how: float | str) -> Trajectory:
    """Over the bump, bumpers on: kinks of the shock absorbers' laws, breaks of the road, slip that changes sign."""
    return completed(simulate(compiled("iltis", "iavsd_inphase_5"), end=0.6, steps=tmp_path / "steps.csv", **how))  # type: ignore[arg-type]


def test_the_vehicle_over_a_bump(tmp_path: Path) -> None:
    tight = vehicle(tmp_path, integrator="dormand-prince", tolerance=1e-11)
    names = ["chassis.x", "chassis.z", "chassis.pitch"]

    def error(**how: float | str) -> float:
        run = vehicle(tmp_path, **how)
        assert run.statistics.residuals.position < 1e-10
        return float(np.max([np.abs(run[name] - np.interp(run.t, tight.t, tight[name])) for name in names]))

    check_proportional(lambda x: error(integrator="dormand-prince", tolerance=x), (1e-5, 1e-7, 1e-9), within=10.0)
    assert all(order > 3.5 for order in orders([error(integrator="rk4", dt=dt) for dt in (2e-3, 1e-3)]))
    coarse, fine = (completed(simulate(compiled("iltis", "iavsd_inphase_5"), end=0.6, dt=dt)) for dt in (1e-3, 5e-4))
    extrapolated = (4 * fine["chassis.z"] - coarse["chassis.z"]) / 3
    assert tight["chassis.z"] == pytest.approx(extrapolated, abs=1e-6)


def test_the_vehicle_as_published() -> None:
    """As close as the trapezoidal rule is."""
    run = completed(simulate(compiled("iltis", "iavsd_inphase_5"), integrator="dormand-prince"))
    check_in_phase_bump(run)
