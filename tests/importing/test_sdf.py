"""SDF: frames relative to others, axes in their own frames, joints that close loops, gearboxes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.importing.document import import_file
from cutjoint.model.errors import ModelError
from cutjoint.topology.build import build_topology
from cutjoint.topology.reading import read_model

FOUR_BAR = """<sdf version="1.9"><model name="four-bar">
  <link name="crank"><pose>0 0 1 0 0 0</pose><inertial><mass>2</mass></inertial></link>
  <link name="rod"><pose relative_to="crank">1 0 0 0 0 1.5707963267948966</pose><inertial><mass>1</mass>
    <inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.15</izz></inertia></inertial></link>
  <link name="rocker"><pose>2 0 1 0 0 0</pose><inertial><pose>0 0 0.1 0 0 0</pose><mass>1</mass></inertial></link>
  <frame name="end" attached_to="rod"><pose>0.5 -1 0 0 0 0</pose></frame>
  <joint name="j1" type="revolute"><parent>world</parent><child>crank</child><axis><xyz>0 1 0</xyz>
    <dynamics><damping>0.5</damping><spring_stiffness>3</spring_stiffness><spring_reference>0.1</spring_reference></dynamics></axis></joint>
  <joint name="j2" type="revolute"><parent>crank</parent><child>rod</child><axis><xyz expressed_in="__model__">0 1 0</xyz></axis></joint>
  <joint name="j3" type="revolute"><parent>world</parent><child>rocker</child><axis><xyz>0 1 0</xyz></axis></joint>
  <joint name="j4" type="revolute"><pose relative_to="end"/><parent>rocker</parent><child>rod</child><axis><xyz>1 0 0</xyz></axis></joint>
</model></sdf>
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "model.sdf"
    path.write_text(text)
    return path


def test_a_link_that_two_joints_carry_closes_a_loop(tmp_path: Path) -> None:
    model = read_model(written(tmp_path, FOUR_BAR))
    joints = {joint.name: joint for joint in model.joints}
    assert {name: joint.kind for name, joint in joints.items()} == dict.fromkeys(("j1", "j2", "j3", "j4"), "revolute")
    # the frame stands at the rod's (0.5, -1, 0), which is (1, 0.5, 0) beyond the elbow in global axes
    assert [float(x) for x in joints["j4"].at] == pytest.approx([2, 0.5, 1])
    assert [float(x) for x in joints["j4"].axes[0]] == pytest.approx([0, 1, 0])
    assert len(build_topology(model).loops) == 1
    (spring,) = model.forces
    assert spring.joint_of == "j1"


def test_links_without_a_joint_move_freely(tmp_path: Path) -> None:
    text = FOUR_BAR.replace("<parent>world</parent><child>crank</child>", "<parent>rocker</parent><child>crank</child>")
    text = "".join(line for line in text.splitlines(keepends=True) if 'name="j3"' not in line)
    model = read_model(written(tmp_path, text))
    assert [joint.name for joint in model.joints if joint.kind == "free"] == ["rocker_free"]


def test_a_gearbox_relates_turns_about_its_reference(tmp_path: Path) -> None:
    text = """<sdf version="1.6"><model name="g">
      <link name="a"><inertial><mass>1</mass></inertial></link><link name="b"><inertial><mass>1</mass></inertial></link>
      <link name="c"><inertial><mass>1</mass></inertial></link>
      <joint name="base" type="fixed"><parent>world</parent><child>a</child></joint>
      <joint name="turn" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>
      <joint name="out" type="revolute"><parent>a</parent><child>c</child><axis><xyz>0 0 -1</xyz></axis></joint>
      <joint name="box" type="gearbox"><parent>b</parent><child>c</child><gearbox_ratio>5</gearbox_ratio>
        <gearbox_reference_body>a</gearbox_reference_body><axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 1</xyz></axis2></joint>
    </model></sdf>"""
    (gear,) = read_model(written(tmp_path, text)).gears
    # theta_c = -5 theta_b about z, and "out" counts about -z
    assert (gear.joints, float(gear.ratio)) == (("out", "turn"), 5)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('relative_to="crank"', 'relative_to="nowhere"', "placed relative to 'nowhere', which is not there"),
        ('relative_to="crank"', 'relative_to="end"', "placed relative to itself"),
        ("<child>rod</child>", "<child>rot</child>", "names the link 'rot', which is not there"),
        ('name="j1" type="revolute"', 'name="j1" type="universal"', "is of type 'universal'"),
        ('expressed_in="__model__"', 'expressed_in="x"', "expressed in 'x', which is not there"),
        ("<xyz>0 1 0</xyz>\n", "<xyz>0 0 0</xyz>\n", "an axis without length"),
        ("</model>", "<model name='inner'/></model>", "stands inside another model"),
    ],
)
def test_faults_are_told(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in FOUR_BAR
    with pytest.raises(ModelError, match=message):
        read_model(written(tmp_path, FOUR_BAR.replace(old, new)))


def test_gravity_of_a_world_counts(tmp_path: Path) -> None:
    world = '<world name="w"><gravity>0 0 -1.6</gravity>'
    text = FOUR_BAR.replace("<model", f"{world}<model").replace("</sdf>", "</world></sdf>")
    assert "gravity: [0, 0, -1.6]" in import_file(written(tmp_path, text)).text
    assert np.allclose([float(x) for x in read_model(written(tmp_path, text)).gravity], [0, 0, -1.6])
