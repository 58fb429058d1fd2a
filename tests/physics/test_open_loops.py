"""Gaps of loops that no step makes smaller: errors of the steps do not see them, and runs say so."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from cutjoint.run.artifact import Artifact
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_text, simulate

pytestmark = needs_cpp

#: A four-bar whose crank is guided, and begins to turn at once at 0.25 s by a table, whose times steps do not know, or from rest.
FOUR_BAR = """\
cutjoint: 1
name: crank_and_rocker
parameters: {turn: {value: 0, binding: input}}
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0, 0.25], inertia: [0.1, 0.1, 0.1]}
  rod: {mass: 2, centre_of_mass: [1, 0, 0.75], inertia: [0.2, 0.7, 0.7]}
  rocker: {mass: 1, centre_of_mass: [2, 0, 0.5], inertia: [0.1, 0.1, 0.1]}
joints:
  drive: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0], guide: "GUIDE"}
  big_end: {kind: revolute, bodies: [crank, rod], at: [0, 0, 0.5], axis: [0, 1, 0]}
  pin: {kind: revolute, bodies: [rod, rocker], at: [2, 0, 1], axis: [0, 1, 0], cut: true}
  post: {kind: revolute, bodies: [ground, rocker], at: [2, 0, 0], axis: [0, 1, 0]}
outputs: [rod.x, rod.z, post.angle]
scenes:
  turn: {end: 0.5, output_step: 0.01, numerics: {penalty: 1.0e+7}}
"""
JUMP = {"turn": {"t": [0, 0.25, 0.5], "value": [0, 0, 0.5], "interpolation": "linear"}}
SMOOTH = "where(t < 0.25, 0, 4*(t - 0.25)**2)"


@cache
def turning(guide: str) -> Artifact:
    with TemporaryDirectory() as folder:
        return compile_text(Path(folder), FOUR_BAR.replace("GUIDE", guide))


def test_a_gap_behind_a_guide_that_jumps_is_reported_and_counted() -> None:
    """Two steps agree on what neither has right, a run that closes its loops shows it: estimates are near the true errors."""
    run, finer = (simulate(turning("turn"), inputs=JUMP, integrator="trapezoidal", dt=dt) for dt in (5e-4, 2.5e-4))
    exact = simulate(turning("turn"), inputs=JUMP, integrator="dormand-prince", tolerance=1e-9, error=False)
    true = float(np.max(np.abs(run["post.angle"] - exact["post.angle"])))
    assert true > 10 * float(np.max(np.abs(run["post.angle"] - finer["post.angle"])))
    for name in run.columns:
        true = float(np.max(np.abs(run[name] - exact[name])))
        assert true / 5 < run.error[name] < 5 * true
    assert any("violation of loops up to" in text and "the errors include its effect" in text for text in run.error.warnings)


def test_a_gap_counts_against_the_tolerance() -> None:
    """Steps that follow from a tolerance come no nearer to closed loops, and the run says so."""
    error = simulate(turning("turn"), inputs=JUMP, integrator="trapezoidal").error
    assert not error.converged
    assert error["post.angle"] > 1e-4


@pytest.mark.parametrize("how", [{"integrator": "rk4", "dt": 5e-4}, {"integrator": "dormand-prince", "tolerance": 1e-6}])
def test_loops_that_are_closed_are_not(how: dict[str, float | str]) -> None:
    run = simulate(turning("turn"), inputs=JUMP, **how)  # type: ignore[arg-type]
    assert run.error.converged
    assert not any("constraint violation of loops" in warning for warning in run.error.warnings)


@pytest.mark.parametrize("dt", [2e-3, 5e-4])
def test_gaps_that_fall_with_the_steps_are_no_warning(dt: float) -> None:
    run = simulate(turning(SMOOTH), integrator="trapezoidal", dt=dt)
    assert run.error.converged
    assert run.error.warnings == ()
