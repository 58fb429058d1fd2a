"""Inputs that a host gives a simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.compile import c_export as standalone
from tests.conftest import needs_cpp
from tests.mechanisms.driven import DRIVEN, LIFT, PUSH, guided, orders, pushed_text

from .c_exports import ALONE

pytestmark = needs_cpp


#: The largest error of a guide's acceleration: where guides are equations, 1e-11 of the accelerations are left as rounding.
LEFT = {**dict.fromkeys(ALONE, 1e-12), "augmented": 2e-11, "classical": 2e-11}


@pytest.fixture(params=ALONE)
def method(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def driven(tmp_path: Path) -> Path:
    path = tmp_path / "driven.yaml"
    path.write_text(DRIVEN)
    return path


def test_inputs_that_nobody_sets_follow_the_scene(driven: Path, method: str) -> None:
    artifact = cutjoint.compile_model(driven, scene="lawful", method=method)
    run = cutjoint.simulate(artifact, error=False, integrator="trapezoidal", events="crossed")
    sim = cutjoint.load(driven, scene="lawful", method=method).reset()
    for t, x in zip(run.t, run["slider.x"], strict=True):
        sim.advance(t)
        assert sim.outputs["slider.x"] == x
    assert np.isnan(sim.inputs.array).all()
    assert sim.inputs.units == {"lift": "rad", "push": "N"}


def test_steps_keep_their_order_where_a_host_makes_an_input_jump(tmp_path: Path, method: str) -> None:
    path, errors = tmp_path / "damped.yaml", []
    path.write_text(pushed_text("push - 3*rate"))
    for dt in (0.02, 0.01):
        sim = cutjoint.load(path, method=method, integrator="trapezoidal").reset(dt=dt)
        speed, error = 0.0, 0.0
        for k, push in enumerate((3.0, -1.0, 4.0, -5.0, 2.0)):
            sim.inputs["push"] = push
            sim.advance(0.1 * (k + 1))
            speed = push / 3 + (speed - push / 3) * np.exp(-3 / 2 * 0.1)
            error = max(error, abs(sim.outputs["mass.vx"] - speed))
        errors.append(error)
    assert 3.9 < errors[0] / errors[1] < 4.1


#: Masses of 1 kg on parallel slides that a third slide between them couples.
COUPLED = """
cutjoint: 1
name: coupled
gravity: [0, 0, 0]
parameters:
  push: {value: 0, unit: N, binding: input}
bodies:
  mass: {mass: 1, centre_of_mass: [0, 0, 0]}
  other: {mass: 1, centre_of_mass: [0, 0, 1]}
joints:
  slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}
  beside: {kind: prismatic, bodies: [ground, other], at: [0, 0, 1], axis: [1, 0, 0]}
  link: {kind: prismatic, bodies: [mass, other], at: [0, 0, 0.5], axis: [0, 0, 1]}
forces:
  hand: {kind: joint_force, joint: slide, law: "push - 400*position - 30*rate"}
outputs: [mass.x, mass.vx]
scenes:
  free: {end: 1, output_step: 0.1, numerics: {multiplier_updates: 60}}
"""


@pytest.mark.parametrize("text", [pushed_text("push - 400*position - 30*rate"), COUPLED], ids=["single", "coupled"])
def test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps(tmp_path: Path, method: str, text: str) -> None:
    """The trapezoidal rule for 2 kg, which a step this long solves with a tangent of more than twice the mass."""
    path, h, x, v = tmp_path / "sprung.yaml", 0.1, 0.0, 0.0
    path.write_text(text)
    sim = cutjoint.load(path, method=method, integrator="trapezoidal").reset(dt=h)
    for k, push in enumerate((3.0, -1.0, 4.0, -5.0, 2.0)):
        sim.inputs["push"] = push
        sim.advance(h * (k + 1))
        begin = (push - 400 * x - 30 * v) / 2
        x, v = x + h * v + h * h / 4 * begin, v + h / 2 * begin
        end = (push - 400 * x - 30 * v) / (2 + 30 * h / 2 + 400 * h * h / 4)
        x, v = x + h * h / 4 * end, v + h / 2 * end
        assert sim.outputs["mass.x"] == pytest.approx(x, abs=1e-8)
        assert sim.outputs["mass.vx"] == pytest.approx(v, abs=1e-6)


def test_a_host_that_sets_the_laws_of_the_scene_has_its_motion(driven: Path, method: str) -> None:
    lawful = cutjoint.load(driven, scene="lawful", method=method).reset(dt=1e-3)
    free = cutjoint.load(driven, scene="free", method=method)

    def give() -> None:
        for name, course in (("lift", LIFT), ("push", PUSH)):
            free.set_input(name, *(float(x) for x in orders(course, np.float64(free.time))))

    give()
    free.reset(dt=1e-3)
    for _ in range(500):
        give()
        free.step()
        lawful.step()
    # at the end of a step a parabola has lost of a cubic 0.1 h^3, 0.3 h^2 and 0.6 h, and what the latter does to the slider in 0.5 s
    for name, lost in (("shoulder.angle", 2e-10), ("shoulder.angle_rate", 4e-7), ("arm.az", 6e-4), ("slider.x", 2e-5)):
        assert free.outputs[name] == pytest.approx(lawful.outputs[name], abs=lost), name


def test_guides_take_rate_and_acceleration(driven: Path, method: str) -> None:
    sim = cutjoint.load(driven, scene="free", method=method).reset(dt=1e-3)
    sim.set_input("lift", 0.2, 0.5, -2.0)
    sim.advance(0.1)
    now = (np.float64(0.2 + 0.05 - 0.01), np.float64(0.5 - 0.2), np.float64(-2.0))
    for name, value in guided(now, np.float64(0.1)).items():
        assert sim.outputs[name] == pytest.approx(value, rel=1e-12, abs=LEFT[method])


def test_a_value_that_is_written_is_held_whatever_was_given_before(driven: Path, method: str) -> None:
    sim = cutjoint.load(driven, scene="free", method=method).reset()
    sim.set_input("lift", 0.2, 0.5, -2.0)
    sim.advance(0.1)
    sim.inputs["lift"] = 0.3
    sim.advance(0.2)
    assert sim.get_input("lift") == 0.3
    for name, value in guided((np.float64(0.3), np.float64(0), np.float64(0)), np.float64(0.2)).items():
        assert sim.outputs[name] == pytest.approx(value, rel=1e-12, abs=LEFT[method])
    rows = cutjoint.rollout(sim, 5, inputs={"push": [1.0, 4.0]})
    other = sim.copy()
    other.set_input("push", 4.0)
    assert np.array_equal(other.run(5), rows[1])
    assert not np.array_equal(rows[0], rows[1])


def test_simulations_in_lanes_have_inputs_of_their_own(driven: Path, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One follows what was given to a guide, the others hold it; by other methods they go one by one."""
    monkeypatch.setattr(standalone, "_COMPILING", -1e9)
    sim = cutjoint.load(driven, scene="free", method=method).reset()
    sim.set_input("lift", 0.2, 0.5, -2.0)
    sim.advance(0.1)
    pushes, lifts = [1.0, 4.0, 2.0], [np.nan, 0.22, 0.23]
    rows = cutjoint.rollout(sim, 20, inputs={"push": pushes})
    held = cutjoint.rollout(sim, 20, inputs={"push": pushes, "lift": lifts})
    for k, (push, lift) in enumerate(zip(pushes, lifts, strict=True)):
        for found, more in ((rows, {}), (held, {"lift": lift})):
            one = sim.copy()
            for name, value in {"push": push, **more}.items():
                one.inputs[name] = value
            np.testing.assert_allclose(found[k], one.run(20), rtol=1e-9, atol=1e-9)


def test_values_written_into_the_array_are_held(driven: Path, method: str) -> None:
    sim = cutjoint.load(driven, scene="free", method=method).reset()
    other = sim.copy()
    sim.inputs["push"] = 4.0
    other.set_input("push", 4.0)
    sim.advance(0.1)
    other.advance(0.1)
    assert np.array_equal(sim.outputs.array, other.outputs.array)
    moment = sim.snapshot()
    sim.advance(0.2)
    other.inputs["push"] = 0.0
    other.restore(moment)
    other.advance(0.2)
    assert np.array_equal(sim.outputs.array, other.outputs.array)
    with pytest.raises(KeyError, match="no 'pusch'; did you mean 'push'"):
        sim.set_input("pusch", 1.0)
    with pytest.raises(cutjoint.SimulationError, match="not finite"):
        sim.set_input("push", float("inf"))
