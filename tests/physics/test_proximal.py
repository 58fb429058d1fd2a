"""Runs with the closure "proximal": constraints to rounding at any penalty, order 2, singular poses, redundant equations, equal motion."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Numerics
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint_bench.generic.artifact import compile_generic
from cutjoint_bench.studies.problems import PROBLEMS, Problem, measure_errors, observed_orders
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.mechanisms.overconstrained import parallel_cranks_text
from tests.physics.simulation import compile_scene, completed, simulate
from tests.physics.test_four_bar import largest_error

PROBLEMS_WITH_LOOPS = [p for p in PROBLEMS if p.name in ("A02", "A03", "SC3D")]


@cache
def compiled(path: Path, scene: str | None = None) -> Artifact:
    """A model with the closure "proximal", whatever penalty its scene gives."""
    model = read_model(path)
    chosen = with_closure(find_scene(model, scene), "proximal")
    return compile_scene(model, replace(chosen, numerics=replace(chosen.numerics, penalty=None, by_step={})))


@cache
def compiled_text(text: str) -> Artifact:
    """A model whose scene says nothing of how steps are."""
    model = read_model_text(text, "chain.yaml")
    (scene,) = model.scenes.values()
    return compile_scene(model, replace(scene, numerics=Numerics()))


def measured(artifact: Artifact, folder: Path, **changes: float) -> tuple[Trajectory, float, float]:
    """A run, and its largest residuals of positions and of speeds over all steps."""
    run = completed(simulate(artifact, steps=folder / "steps.csv", **changes))
    table = np.genfromtxt(folder / "steps.csv", delimiter=",", names=True)
    return run, float(table["position"].max()), float(table["velocity"].max())


SCENES = [
    ("four_bar", None, 2.0), ("slider_crank", None, 2.0), ("andrews", None, 0.05), ("iltis", "simul1", 1.5),
    ("iltis", "iavsd_inphase_5", 0.5),
]  # fmt: skip


def test_a_mechanism_without_cut_joints_runs_as_with_a_penalty() -> None:
    run = completed(simulate(compiled(MODELS / "pendulum.yaml"), end=1.0))
    model = read_model(MODELS / "pendulum.yaml")
    other = completed(simulate(compile_scene(model, with_closure(find_scene(model, None), "penalty")), end=1.0))
    assert {name: list(column) for name, column in run.columns.items()} == {name: list(column) for name, column in other.columns.items()}


@pytest.mark.parametrize("penalty", [10.0, 100.0, 1e12])
@pytest.mark.parametrize(("model", "scene", "end"), SCENES)
def test_constraints_hold_at_any_penalty(tmp_path: Path, model: str, scene: str | None, end: float, penalty: float) -> None:
    """The bound for loops is 1e-10 m; projections end with 1e-12.

    A penalty is an upper bound of the value by the masses, 1e3 to 1e4 here: 10 and 100 act, 1e12 is as good as none.
    """
    _, position, velocity = measured(compiled(MODELS / f"{model}.yaml", scene), tmp_path, end=end, penalty=penalty)
    assert position < 1e-12
    assert velocity < 1e-10


@pytest.mark.parametrize(("model", "scene", "end"), SCENES)
def test_a_penalty_is_an_upper_bound(model: str, scene: str | None, end: float) -> None:
    """To the last bit the same run with 1e6 and 1e12, another with 10."""
    artifact = compiled(MODELS / f"{model}.yaml", scene)
    low, high, highest = (completed(simulate(artifact, end=end, penalty=penalty)).columns for penalty in (10.0, 1e6, 1e12))
    assert all(np.array_equal(high[column], highest[column]) for column in high)
    assert not all(np.array_equal(low[column], high[column]) for column in high)


@pytest.mark.parametrize("problem", PROBLEMS_WITH_LOOPS, ids=lambda p: p.name)
def test_second_order(problem: Problem) -> None:
    artifact = compiled(problem.path)
    runs = [completed(simulate(artifact, dt=dt, end=problem.smooth)) for dt in problem.steps]
    assert observed_orders([measure_errors(problem, run) for run in runs]) == pytest.approx([2, 2], abs=0.15)


@pytest.mark.parametrize("dt", [0.004, 0.002, 0.001])
@pytest.mark.parametrize("windows", [1, 2, 10])
def test_singular_poses_are_passed_in_order(tmp_path: Path, windows: int, dt: float) -> None:
    """Seven or more crossings: the error stays that of the rule, 4 to 6 dt^2, where the closure "penalty" has up to 100 dt^2."""
    path = tmp_path / "chain.yaml"
    path.write_text(four_bar_text(windows), encoding="utf-8")
    run, position, _ = measured(compiled(path), tmp_path, dt=dt, end=10.0)
    assert largest_error(run, windows) < 10 * dt**2
    assert position < 1e-12


@pytest.mark.parametrize("dt", [0.002, 0.001, 0.0005])
def test_forty_windows_pass_as_one_does(dt: float) -> None:
    """The mass that counts where a direction vanishes does not grow with the number of windows; forty directions vanish at once."""
    artifact = compiled_text(four_bar_text(40))
    assert largest_error(completed(simulate(artifact, dt=dt, end=10.0)), 40) < 10 * dt**2


def test_redundant_equations_do_no_harm(tmp_path: Path) -> None:
    """Two of five cranks would do: the others repeat what these say.  All turn alike, and energy stays."""
    path = tmp_path / "cranks.yaml"
    path.write_text(
        parallel_cranks_text(5) + "outputs: [pin_0.angle, pin_0.angle_rate, pin_4.angle]\n"
        "scenes: {run: {end: 0.5, output_step: 10 ms, rates: {pin_0.angle_rate: -1}, numerics: {closure: proximal}}}\n"
    )
    run, position, velocity = measured(compiled(path), tmp_path)
    assert position < 1e-12
    assert velocity < 1e-12
    assert run["pin_4.angle"] == pytest.approx(run["pin_0.angle"], abs=1e-12)
    # kinetic energy (5 (1/4 + 0.1) + 1)/2 rate^2 and the heights of five cranks' centres and the coupler: (5/2 + 1) g cos(angle)
    energy = (5 * 0.35 + 1) / 2 * run["pin_0.angle_rate"] ** 2 + 3.5 * 9.81 * np.cos(run["pin_0.angle"])
    assert energy == pytest.approx(energy[0], abs=1e-4)


def test_the_vehicle_moves_as_with_a_penalty(tmp_path: Path) -> None:
    """Over the steps of simul1; both closures are 1.4e-4 m from the limit of small steps at 7.5 ms, and differ by less."""
    path = MODELS / "iltis.yaml"
    model = read_model(path)
    scene = find_scene(model, "simul1")
    plain = completed(simulate(compile_scene(model, scene), end=3.0))
    run = completed(simulate(compiled(path, "simul1"), end=3.0))
    assert run["chassis.z"] == pytest.approx(plain["chassis.z"], abs=1e-4)
    assert run["chassis.pitch"] == pytest.approx(plain["chassis.pitch"], abs=1e-4)
    assert plain.evaluations < 4 * plain.steps
    assert run.evaluations < 9.5 * run.steps  # multipliers that are corrected for four iterations are what these wait for


def test_what_does_not_know_the_closure_says_so() -> None:
    model = read_model(MODELS / "slider_crank.yaml")
    scene = with_closure(find_scene(model, None), "proximal")
    with pytest.raises(RunError, match="the generic solver knows closure: penalty only, not proximal; use --implementation generated"):
        compile_generic(model, scene)
