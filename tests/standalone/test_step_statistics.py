"""The effort of a step, and limits of it."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import cutjoint
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.driven import DRIVEN

pytestmark = needs_cpp

PRESS = MODELS / "press.yaml"

#: Two masses on rails with a spring between them, and one to the ground.
COUPLED = """
cutjoint: 1
name: coupled
gravity: [0, 0, 0]
bodies: {left: {mass: 2, centre_of_mass: [0, 0, 0]}, right: {mass: 3, centre_of_mass: [1, 0, 0]}}
joints:
  one: {kind: prismatic, bodies: [ground, left], at: [0, 0, 0], axis: [1, 0, 0]}
  two: {kind: prismatic, bodies: [ground, right], at: [1, 0, 0], axis: [1, 0, 0]}
forces:
  spring: {kind: point_spring, bodies: [left, right], from: [0, 0, 0], to: [1, 0, 0], law: {stiffness: 800, free_length: 1}}
outputs: [left.x]
scenes: {swing: {end: 1, rates: {one.displacement_rate: 0.001}}}
"""


@pytest.fixture
def press() -> cutjoint.Simulation:
    return cutjoint.load(PRESS, integrator="trapezoidal")


def test_gaps_and_rates_are_those_of_the_jacobian(press: cutjoint.Simulation) -> None:
    press.reset(iterations=2)
    press.run(40)
    step = press.last_step
    assert (step.violation, step.equation) == press.constraint_violation
    assert step.violation > 0
    assert step.violation_rate == pytest.approx(np.abs(press.constraint_jacobian @ press.speeds.array).max(), abs=1e-14)


def test_the_change_is_that_by_one_more_iteration(press: cutjoint.Simulation) -> None:
    press.reset(iterations=0)
    press.run(10)
    before, found = press.snapshot(), []
    for iterations in (3, 4):
        press.restore(before)
        assert press.library.set_iterations(press.address, iterations) == 0
        press.step()
        found.append(press.accelerations.array.copy())
        assert (press.last_step.iterations, press.last_step.evaluations) == (iterations, iterations)
    less, more = found
    assert press.last_step.change == pytest.approx(np.abs(more - less).max() / (1 + np.abs(more).max()), rel=1e-12)
    assert press.last_step.pivot == np.inf


def test_the_pivot_is_that_of_the_elimination(tmp_path: Path) -> None:
    path, dt = tmp_path / "coupled.yaml", 0.05
    path.write_text(COUPLED)
    sim = cutjoint.load(path, method="recursive-newton", integrator="trapezoidal").reset(dt=dt)
    sim.step()
    stiffness = 800 * dt**2 / 4
    tangent = np.array([[2 + stiffness, -stiffness], [-stiffness, 3 + stiffness]])
    assert sim.last_step.pivot == pytest.approx(np.linalg.det(tangent) / tangent[0, 0] / tangent[1, 1], rel=1e-5)  # turns aside: 1e-6


def test_a_step_beyond_a_limit_is_made_and_told(press: cutjoint.Simulation) -> None:
    free = cutjoint.load(PRESS, integrator="trapezoidal").reset()
    press.reset()
    free.run(20)
    most = free.last_step.iterations
    press.set_limits(iterations=most - 1)
    reported = set()
    for _ in range(20):
        try:
            press.step()
        except cutjoint.SimulationError as error:
            reported.add((error.status, str(error).partition(" s: ")[2]))
    head, advice = rf"a step exceeds a limit: 'iterations' is [2-9], the limit {most - 1}", "try: a smaller dt, or another limit"
    assert {status for status, _ in reported} == {32}
    assert all(re.fullmatch(f"{head}; the step is made, and the motion may go on; {advice}", text) for _, text in reported)
    assert press.time == free.time
    assert np.array_equal(press.coordinates.array, free.coordinates.array)
    copy = press.copy()
    with pytest.raises(cutjoint.SimulationError, match="'iterations'"):
        copy.advance(press.time + 0.1)
    press.set_limits(iterations=np.inf, violation=1e-30)
    with pytest.raises(cutjoint.SimulationError, match=r"'violation' is [1-9]\.\d\de-\d+, the limit 1\.00e-30, at 'elbow\.") as caught:
        press.run(100)
    reported_violation = float(str(caught.value).partition("'violation' is ")[2].partition(",")[0])
    assert reported_violation == pytest.approx(press.last_step.violation, rel=0.005)
    press.set_limits(violation=np.inf, pivot=0.5, violation_rate=1.0, change=1.0, evaluations=100)
    press.advance(press.time + 0.1)  # a method without factors has no pivot that is too small
    with pytest.raises(KeyError, match="no 'gab'; there is violation"):
        press.set_limits(gab=1.0)
    with pytest.raises(cutjoint.SimulationError, match="not finite, or out of its range"):
        press.set_limits(violation=-1.0)


def test_a_step_in_parts_is_made_too(tmp_path: Path) -> None:
    """Behind a guide that jumps steps have parts, each of which exceeds the limit."""
    path = tmp_path / "driven.yaml"
    path.write_text(DRIVEN)
    free, limited = (cutjoint.load(path, scene="free", integrator="trapezoidal").reset(dt=1e-3) for _ in range(2))
    limited.set_limits(iterations=0)
    reported = set()
    for i in range(10):
        for sim in (free, limited):
            sim.inputs["lift"] = 0.01 * (i > 3)
            call = partial(sim.advance, sim.time + 3e-4) if i % 2 else sim.step  # one step each, with ends that are no whole ones
            try:
                call()
            except cutjoint.SimulationError as error:
                reported.add(error.status)
    assert reported == {32}
    assert limited.time == free.time
    assert np.array_equal(limited.coordinates.array, free.coordinates.array)
    assert np.array_equal(limited.speeds.array, free.speeds.array)


def test_a_call_ends_at_the_step_beyond_a_limit() -> None:
    sim = cutjoint.load(PRESS, integrator="rk4").reset(dt=1e-3)
    sim.set_limits(violation_rate=0.0)
    with pytest.raises(cutjoint.SimulationError, match="'violation_rate'"):
        sim.advance(0.1)
    assert 0 < sim.time < 0.1
    sim.set_limits(violation_rate=np.inf)
    sim.advance(0.1)
    sim.step()
    assert sim.time == pytest.approx(0.101)
