"""Rotors of drives whose inertia is a parameter, beside uniform acceleration."""

from pathlib import Path

import pytest

from tests.physics.simulation import compile_text, completed, simulate

_TURNED = """
cutjoint: 1
name: turned
gravity: [0, 0, -9.81]
parameters: {torque: {value: 2, unit: N*m, binding: param}, rotor: {value: 0.3, unit: kg*m^2, binding: param}}
bodies: {arm: {mass: 1, centre_of_mass: [0.2, 0, 0], inertia: [0.1, 0.7, 0.66]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: z, armature: rotor}}
forces: {motor: {kind: joint_force, joint: pin, law: torque}}
outputs: [pin.angle]
scenes: {turn: {end: 1}}
"""


@pytest.mark.parametrize("rotor", [0.3, 1.3])
def test_an_armature_may_be_any_parameter(tmp_path: Path, rotor: float) -> None:
    """It is the second one: its mass matrix was refused as not symmetric."""
    run = completed(simulate(compile_text(tmp_path, _TURNED), parameters={"rotor": rotor}))
    assert run["pin.angle"][-1] == pytest.approx(2 / (0.66 + 0.04 + rotor) / 2, rel=1e-9)
