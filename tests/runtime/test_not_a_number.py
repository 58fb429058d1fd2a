"""An acceleration that is not a number ends a run, whatever the others do."""

from __future__ import annotations

import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate
from tests.physics.simulation import compile_scene

#: Two masses that know nothing of each other; the force on the first is no number beyond 1 m.
MODEL = """
cutjoint: 1
name: apart
gravity: [0, 0, 0]
bodies:
  first: {mass: 1, centre_of_mass: [0, 0, 0]}
  second: {mass: 1, centre_of_mass: [0, 0, 0]}
joints:
  slide: {kind: prismatic, bodies: [ground, first], at: [0, 0, 0], axis: [1, 0, 0]}
  rail: {kind: prismatic, bodies: [ground, second], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  push: {kind: joint_force, joint: slide, law: "sqrt(1 - position)"}
  pull: {kind: joint_force, joint: rail, law: "-position"}
outputs: [first.x, second.y]
scenes:
  go: {end: 5, output_step: 0.5, positions: {rail.displacement: 1}, rates: {slide.displacement_rate: 1}, numerics: {dt: 0.01}}
"""


@pytest.mark.parametrize("method", ["recursive", "augmented"])
def test_no_number_beside_others_that_are(method: str) -> None:
    model = read_model_text(MODEL, "apart.yaml")
    run = simulate(compile_scene(model, find_scene(model, None), CompileOptions(method=method)), check=False)
    assert run.failure is not None
    assert run.failure.element == "push"
    assert "sqrt" in str(run.failure)
    assert 0.4 < run.t[-1] < 1.0
    assert abs(run.columns["first.x"][-1]) <= 1.0
