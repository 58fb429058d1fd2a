"""Tests of MuJoCo alone; `test_peers.py` has the tests of all peers."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint_bench.export.peers import PEERS
from tests.conftest import MODELS
from tests.export.own import Case, both_accelerations, exported, needs, vehicle


def test_a_standing_guide_needs_no_mass(tmp_path: Path) -> None:
    folder = exported("mujoco", vehicle("iavsd_inphase_5"), tmp_path)
    names = [body.get("name") for body in ElementTree.parse(folder / "iltis.xml").iter("body")]
    assert len(names) == 17
    assert "rack" not in names


@needs("mujoco")
def test_a_body_called_world(tmp_path: Path) -> None:
    text = (MODELS / "pendulum.yaml").read_text(encoding="utf-8").replace("bob", "world")
    model = read_model_text(text, "pendulum.yaml")
    found, own = both_accelerations("mujoco", Case(model=model, scene=find_scene(model, None), parameters={}), tmp_path)
    np.testing.assert_allclose(found, own, atol=1e-7)


WELDED = """
cutjoint: 1
name: welded
gravity: [0, 0, -9.81]
bodies:
  left: {mass: 1, centre_of_mass: [0.1, 0, -0.5], inertia: [0.1, 0.1, 0.1]}
  right: {mass: 2, centre_of_mass: [0.9, 0, -0.5], inertia: [0.1, 0.1, 0.1]}
joints:
  first: {kind: spherical, bodies: [ground, left], at: [0, 0, 0]}
  second: {kind: universal, bodies: [ground, right], at: [1, 0, 0], axis: [1, 0, 0], axis_2: [0, 0, 1]}
  weld: {kind: fixed, bodies: [right, left], at: [0.5, 0, -0.5], cut: true}
outputs: [left.x]
scenes: {fall: {end: 1, rates: {second.angle_1_rate: 1}, numerics: {penalty: 1.0e+6}}}
"""


@needs("mujoco")
def test_a_loop_closed_by_a_weld(tmp_path: Path) -> None:
    """Soft constraints leave 1e-4 of the unconstrained acceleration, which is that of gravity."""
    model = read_model_text(WELDED, "welded.yaml")
    found, own = both_accelerations("mujoco", Case(model=model, scene=find_scene(model, None), parameters={}), tmp_path)
    assert np.abs(found - own).max() < 0.01


PRESS = """
cutjoint: 1
name: press
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0, 0.1], inertia: [1, 1, 1]}
  slider: {mass: 1, centre_of_mass: [0, 0, 0.2], inertia: [1, 1, 1]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0, 0, 0.2], axis: [1, 0, 0]}
  eye: {kind: point_on_line, bodies: [crank, slider], at: [0, 0, 0.2], axis: [0, 0, 1], cut: true}
outputs: [crank.x]
scenes: {turn: {end: 1}}
"""


def test_a_cut_joint_that_mujoco_does_not_have() -> None:
    model = read_model_text(PRESS, "press.yaml")
    with pytest.raises(ModelError) as refused:
        PEERS["mujoco"].export(model, find_scene(model, None), {}, ())
    assert str(refused.value) == (
        "press.yaml:11:3: joint 'eye': MuJoCo has no equality constraint for a cut joint of kind point_on_line; close the loop with a "
        "joint of kind revolute or spherical: 'cut: true' there"
    )
