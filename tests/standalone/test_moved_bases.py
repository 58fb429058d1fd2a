"""Linear models by inputs that move joints: closed forms of a mass on a spring over a shaken table."""

from __future__ import annotations

import numpy as np
import pytest

import cutjoint
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.stepping.load import load_scene
from tests.conftest import needs_cpp

pytestmark = needs_cpp

MASS, STIFFNESS, DAMPING = 10.0, 4000.0, 200.0
ISOLATOR = f"""
cutjoint: 1
name: isolator
gravity: [0, 0, 0]
parameters: {{push: {{value: 0, unit: N, binding: input}}, table: {{value: 0, unit: m, binding: input}}}}
bodies:
  plate: {{mass: 5, centre_of_mass: [0, 0, 0]}}
  load: {{mass: {MASS}, centre_of_mass: [0, 0, 0.3]}}
joints:
  shaker: {{kind: prismatic, bodies: [ground, plate], at: [0, 0, 0], axis: z, guide: table}}
  rod: {{kind: prismatic, bodies: [BASE, load], at: [0, 0, 0.3], axis: z}}
forces:
  mount:
    kind: point_spring
    bodies: [plate, load]
    from: [0, 0, 0]
    to: [0, 0, 0.3]
    law: {{stiffness: {STIFFNESS}, damping: {DAMPING}, free_length: drawn}}
  drive: {{kind: joint_force, joint: rod, law: push}}
outputs: [load.z, load.az, plate.az, mount.force]
scenes: {{still: {{end: 1}}}}
"""


@pytest.mark.parametrize("base", ["ground", "plate"])
def test_a_shaken_table_moves_its_load_as_the_closed_form_says(base: str) -> None:
    """The load's rod stands on the ground, or on the table: then the table's acceleration pushes the load's own coordinate."""
    model = read_model_text(ISOLATOR.replace("BASE", base), "isolator.yaml")
    near = load_scene(model, find_scene(model, None), linearise=True).reset().linearise()
    assert isinstance(near, cutjoint.StateSpace)
    for s in 2j * np.pi * np.array([0.1, 3.2, 30.0, 1000.0]):
        load = (DAMPING * s + STIFFNESS) / (MASS * s * s + DAMPING * s + STIFFNESS)
        spring = -(DAMPING * s + STIFFNESS) * (load - 1)
        found = near.transfer(s)[:, near.inputs.index("table")]
        assert found[:3] == pytest.approx([load, s * s * load, s * s], rel=1e-9)
        assert abs(found[3]) == pytest.approx(abs(spring), rel=1e-9)
    assert not near.B_rate[:, near.inputs.index("push")].any()
    assert not near.D_acceleration[:, near.inputs.index("push")].any()
