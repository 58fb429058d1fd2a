"""A force that is switched off has a length, and no force."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp

#: A pendulum with a rope that does not act, and a damper whose law reads how long it is.
TEXT = """\
cutjoint: 1
name: slack
gravity: [0, 0, -10]
bodies: {bob: {mass: 2, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.1, 0.1]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: y}}
forces:
  rope: {kind: point_spring, bodies: [ground, bob], from: [0, 0, 2], to: [1, 0, 0], law: 900*length + 4*rate}
  rail: {kind: axial_force, bodies: [ground, bob], origin: [0, 0, 0], point: [1, 0, 0], axis: x, law: 70*travel}
  pad: {kind: bushing, bodies: [ground, bob], at: [1, 0, 0], stiffness: [9, 9, 9, 9, 9, 9]}
  brake: {kind: load, body: bob, torque: [0, "-rope.length*wy", 0]}
outputs: [pin.angle, pin.angle_rate, rope.length, rope.rate, rope.force, rail.travel, rail.force, pad.dz, pad.Fz]
scenes:
  off: {end: 1, output_step: 10 ms, switches: {rope: false, rail: false, pad: false}}
"""


@needs_cpp
@pytest.mark.parametrize("method", METHODS)
def test_what_is_off_is_measured(method: str) -> None:
    """By the angle alone; the brake takes the work that the rope's length says."""
    model = read_model_text(TEXT, "slack.yaml")
    assert model.notes == ()
    run = simulate(compile_interpreted(model, model.scenes["off"], method=method))
    angle, rate = run["pin.angle"], run["pin.angle_rate"]
    x, z = np.cos(angle), -np.sin(angle)
    length = np.hypot(x, z - 2)
    np.testing.assert_allclose(run["rope.length"], length, atol=1e-9)
    np.testing.assert_allclose(run["rope.rate"], (x * -np.sin(angle) - (z - 2) * np.cos(angle)) * rate / length, atol=1e-9)
    np.testing.assert_allclose(run["rail.travel"], x, atol=1e-9)
    np.testing.assert_allclose(run["pad.dz"], z, atol=1e-9)
    for name in ("rope.force", "rail.force", "pad.Fz"):
        assert not run[name].any()
    lost = np.trapezoid(length * rate**2, run.t)
    assert 1.05 * rate[-1] ** 2 == pytest.approx(20 * -z[-1] - lost, abs=2e-2)
