"""The N-four-bar (IFToMM A02): order of convergence, singular poses by every integrator, invariance against the place."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import find_scene
from tests.conftest import DATA, MODELS
from tests.mechanisms.four_bar import exact_tip, four_bar_text
from tests.physics.simulation import compile_model, compile_scene, compile_text, completed, read_reference, simulate, with_numerics


def largest_error(run: object, windows: int) -> float:
    exact = exact_tip(windows, run.t)  # type: ignore[attr-defined]
    return float(np.abs(np.stack([run["tip.x"], run["tip.y"]], axis=1) - exact).max())  # type: ignore[index]


@pytest.mark.parametrize("windows", [1, 2, 10])
def test_second_order_before_the_first_singular_pose(tmp_path: Path, windows: int) -> None:
    """Halving dt quarters the error: observed order 2 within 0.1."""
    artifact = with_numerics(compile_text(tmp_path, four_bar_text(windows)), penalty=1e6, tolerance=1e-8)
    errors = [largest_error(completed(simulate(artifact, dt=dt, end=0.6)), windows) for dt in (0.004, 0.002, 0.001)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([2, 2], abs=0.1)


@pytest.mark.parametrize("windows", [1, 2, 10])
def test_stays_on_its_branch_through_ten_seconds_of_singular_poses(tmp_path: Path, windows: int) -> None:
    """Seven or more crossings; 1e-3 of a 1 m bar is 20 times what was measured, a lost branch is 1."""
    run = completed(simulate(compile_text(tmp_path, four_bar_text(windows)), dt=0.001, end=10.0))
    assert largest_error(run, windows) < 1e-3


#: The first time at which all bars are in line (s); ten seconds have ten such poses.
FIRST = 0.714355529292960


@cache
def two_windows(method: str) -> Artifact:
    return compile_model(MODELS / "four_bar.yaml", method=method)


@cache
def light() -> Artifact:
    """Two windows whose closure has a light penalty."""
    model = read_model_text(four_bar_text(2), "four_bar.yaml")
    return compile_scene(model, find_scene(model, None))


@pytest.mark.parametrize("dt", [0.01, 0.004, 0.001, FIRST / 71, FIRST / 143])
@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4"])
def test_equal_steps_of_the_recursion_pass_singular_poses(integrator: str, dt: float) -> None:
    """The last two steps end on the first pose.  Errors are 30 to 130 dt^2 by either rule; a lost branch is 1 m or more."""
    run = completed(simulate(light(), integrator=integrator, dt=dt))
    assert largest_error(run, 2) < 200 * dt**2


@pytest.mark.parametrize("dt", [0.01, 0.004, 0.002, 0.001, 0.0005, 0.0001, FIRST / 71, FIRST / 143])
@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4"])
def test_equal_steps_without_settings_pass_singular_poses_or_stop_there(integrator: str, dt: float) -> None:
    """The model as it stands: only a step that ends on the pose may stop, and says so; up to there the motion is right."""
    run = simulate(two_windows("recursive"), integrator=integrator, dt=dt, check=False)
    assert largest_error(run, 2) < 200 * dt**2
    if run.failure is not None:
        assert FIRST % dt < 1e-9
        assert run.failure.time == pytest.approx(FIRST, abs=1e-9)


@pytest.mark.parametrize("by_step", [False, True])
@pytest.mark.parametrize(("windows", "end"), [(2, 10.0), (10, 5.0), (40, 10.0)])
def test_rk4_keeps_its_order_through_singular_poses(windows: int, end: float, by_step: bool) -> None:
    """Without a penalty, and with 0.005/dt^2; of order 2 errors at 2 ms would be a sixteenth of those at 8 ms.

    Stages of 40 windows come within 5e-5 rad of a pose.  Evaluations go on by plain passes as soon as these are enough: with light
    penalties that is later.
    """
    model = read_model_text(four_bar_text(windows), "four_bar.yaml")
    scene = find_scene(model, None)
    numerics = replace(scene.numerics, closure="solved", **({} if by_step else {"penalty": None, "by_step": {}}))
    artifact = compile_scene(model, replace(scene, end=end, output_step=0.04, numerics=numerics))
    runs = [completed(simulate(artifact, integrator="rk4", dt=dt, error=False)) for dt in (8e-3, 2e-3)]
    long, short = (largest_error(run, windows) for run in runs)
    assert by_step or max(run.evaluations / run.steps for run in runs) < 9
    assert long < 2e-6
    assert short < long / 4**3


def test_a_file_is_compiled_for_the_integrator_that_is_asked_for() -> None:
    """Loops held as for the trapezoidal rule, for which the scene's step stands, would make rk4 err by 3e-4 m."""
    assert largest_error(cutjoint.simulate(MODELS / "four_bar.yaml", integrator="rk4", dt=4e-3, error=False), 2) < 1e-7


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_dormand_prince_passes_singular_poses(tolerance: float) -> None:
    """Errors are 360 to 900 times the tolerance, before the first pose 0.1 to 1 times."""
    run = completed(simulate(two_windows("recursive"), integrator="dormand-prince", tolerance=tolerance))
    assert largest_error(run, 2) < 2000 * tolerance


@pytest.mark.parametrize(("tolerance", "largest"), [(1e-10, 2e-6), (3e-11, 2e-5)])
def test_steps_that_end_near_a_singular_pose_lose_no_speed(tolerance: float, largest: float) -> None:
    """Rounding of the places there, seen along the direction that loops hardly hold, would turn the speeds: errors were 1e-5 and 2e-4 m."""
    model = read_model_text(four_bar_text(2), "four_bar.yaml")
    scene = find_scene(model, None)
    numerics = replace(scene.numerics, closure="solved", penalty=None, by_step={})
    artifact = compile_scene(model, replace(scene, end=10.0, output_step=0.04, numerics=numerics))
    assert largest_error(completed(simulate(artifact, integrator="dormand-prince", tolerance=tolerance, error=False)), 2) < largest


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_dormand_prince_loses_its_branch_at_a_coarse_tolerance(tolerance: float, tmp_path: Path) -> None:
    """Known, and docs/reference/integrators.md says so: the run comes to its end with closed loops, on the other branch."""
    run = completed(simulate(two_windows("recursive"), integrator="dormand-prince", tolerance=tolerance, steps=tmp_path / "steps.csv"))
    assert largest_error(run, 2) > 1
    assert run.statistics.residuals.position < 1e-10


@pytest.mark.parametrize("dt", [0.01, 0.004, 0.001, FIRST / 71])
def test_implicit_steps_of_equal_length_stop_at_a_singular_pose(dt: float) -> None:
    """No step of radau5-fixed goes over the first pose; up to it the motion is right."""
    run = simulate(two_windows("recursive-newton"), integrator="radau5-fixed", dt=dt, check=False)
    assert run.failure is not None
    assert FIRST - 2 * dt < run.failure.time < FIRST
    assert largest_error(run, 2) < 1e-9


def test_radau5_stops_at_a_singular_pose_or_crosses_it() -> None:
    """By a coarse tolerance its steps go over the poses."""
    stops, crosses = (
        simulate(two_windows("recursive-newton"), integrator="radau5", tolerance=tolerance, check=False) for tolerance in (1e-8, 1e-4)
    )
    assert stops.failure is not None
    assert stops.failure.time == pytest.approx(FIRST, abs=1e-6)
    assert largest_error(stops, 2) < 1e-9
    assert largest_error(completed(crosses), 2) < 1e-2


def test_agrees_with_the_published_reference(tmp_path: Path) -> None:
    run = completed(simulate(compile_text(tmp_path, four_bar_text(2)), dt=0.0005, end=10.0))
    reference = read_reference(DATA / "ref_a02_fourbar_N2.csv")
    rows = reference["t"] <= 10.0
    assert run.t == pytest.approx(reference["t"][rows], abs=1e-9)
    assert run["tip.x"] == pytest.approx(reference["x_B0"][rows], abs=5e-4)
    assert run["tip.y"] == pytest.approx(reference["y_B0"][rows], abs=5e-4)


def test_the_place_does_not_matter(tmp_path: Path) -> None:
    """A linkage 10 km away moves as near by: every branch has its pole at its own first joint."""
    near = completed(simulate(compile_text(tmp_path, four_bar_text(2)), dt=0.001, end=2.0))
    far = completed(simulate(compile_text(tmp_path, four_bar_text(2, offset=10000)), dt=0.001, end=2.0))
    # positions of 1e4 m are stored to 2e-12 m; the singular pose at 0.71 s and 1.23 s magnifies differences
    assert far["tip.x"] - 10000 == pytest.approx(near["tip.x"], abs=1e-7)
