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
    # in the model's axes, though the joint's frame is that of the rod, a quarter of a turn off
    assert [float(x) for x in joints["j2"].axes[0]] == pytest.approx([0, 1, 0])
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
        ("<inertial><mass>2</mass>", '<inertial auto="true"><density>2</density>', "takes mass and inertia from collisions"),
        ("<inertial><mass>2</mass>", "<gravity>0</gravity><inertial><mass>2</mass>", "<gravity>: is '0'"),
        ("<inertial><mass>2</mass>", "<kinematic>true</kinematic><inertial><mass>2</mass>", "<kinematic>: is 'true'"),
        ('relative_to="crank"', 'relative_to="end"', "placed relative to itself"),
        ("<child>rod</child>", "<child>rot</child>", "names the link 'rot', which is not there"),
        ('name="j1" type="revolute"', 'name="j1" type="universal"', "is of type 'universal'"),
        ('expressed_in="__model__"', 'expressed_in="x"', "expressed in 'x', which is not there"),
        ("<xyz>0 1 0</xyz>\n", "<xyz>0 0 0</xyz>\n", "an axis without length"),
        ("</model>", "<include><uri>model://x</uri></include></model>", "includes another file, which is not read"),
        ('attached_to="rod"', 'attached_to="end"', "placed relative to itself"),
        ('version="1.9"', 'version="1.\u00b2"', "has the version '1.\u00b2'; write for example 1.9"),
        ('version="1.9"', f'version="1.{"9" * 10_000}"', "has the version '1.999"),
        ("<parent>world</parent><child>crank</child>", "<parent>crank</parent><child>crank</child>", "connects 'crank' with itself"),
    ],
)
def test_faults_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in FOUR_BAR
    with pytest.raises(ModelError, match=message):
        read_model(written(tmp_path, FOUR_BAR.replace(old, new)))


@pytest.mark.parametrize(
    ("written_out", "mass", "inertia"),
    [
        ("<inertial><mass>3</mass></inertial>", 3, [1, 1, 1]),
        ("<inertial><inertia><ixx>0.9</ixx><iyy>0.8</iyy></inertia></inertial>", 1, [0.9, 0.8, 1]),
        ("<gravity>true</gravity><kinematic>0</kinematic><inertial auto='false'/>", 1, [1, 1, 1]),
    ],
)
def test_numbers_left_out_are_those_of_the_format(tmp_path: Path, written_out: str, mass: float, inertia: list[float]) -> None:
    model = read_model(written(tmp_path, FOUR_BAR.replace("<inertial><mass>2</mass></inertial>", written_out)))
    (crank,) = (body for body in model.bodies if body.name == "crank")
    assert (float(crank.mass), [float(moment) for moment in crank.inertia[:3]]) == (mass, inertia)


def test_gravity_of_a_world_counts(tmp_path: Path) -> None:
    world = '<world name="w"><gravity>0 0 -1.6</gravity>'
    text = FOUR_BAR.replace("<model", f"{world}<model").replace("</sdf>", "</world></sdf>")
    assert "gravity: [0, 0, -1.6]" in import_file(written(tmp_path, text)).text
    assert np.allclose([float(x) for x in read_model(written(tmp_path, text)).gravity], [0, 0, -1.6])


def test_a_long_chain_of_frames_is_no_circle(tmp_path: Path) -> None:
    count = 200
    relative = ["", *(f' relative_to="j{i}"' for i in range(1, count))]
    links = "".join(f'<link name="l{i}"><pose{relative[i]}>0 0 0.1 0 0 0</pose>{MASS}</link>' for i in range(count))
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><pose relative_to="l{i - 1}">0 0 0.1 0 0 0</pose><parent>l{i - 1}</parent><child>l{i}</child>'
        "<axis><xyz>0 1 0</xyz></axis></joint>" for i in range(1, count)
    )  # fmt: skip
    text = import_file(written(tmp_path, f'<sdf version="1.9"><model name="chain">{links}{joints}</model></sdf>')).text
    assert f"l{count - 1}: {{mass: 1, centre_of_mass: [0, 0, {0.2 * count - 0.1:.12g}]" in text


MASS = "<inertial><mass>1</mass></inertial>"
PENDULUM = (
    f'<link name="arm"><pose>1 0 0 0 0 0</pose>{MASS}</link><frame name="tip" attached_to="arm"><pose>0.5 0 0 0 0 0</pose></frame>'
    '<joint name="turn" type="revolute"><pose relative_to="__model__"/><parent>world</parent><child>tip</child>'
    "<axis><xyz>0 1 0</xyz></axis></joint>"
)


def test_all_models_of_a_world_are_taken_or_one_by_its_name(tmp_path: Path) -> None:
    """The second model stands a quarter turn about z on, so that its hinge's y is the world's -x."""
    second = f'<model name="b"><pose relative_to="here">0 0 0 0 0 1.5707963267948966</pose>{PENDULUM}</model>'
    slab = '<link name="slab"><gravity>0</gravity><inertial auto="true"/></link>'  # has no motion that its mass could change
    ground = f'<model name="floor"><static>1</static>{slab}</model>'
    first, here = f'<model name="a"><pose>0 0 3 0 0 0</pose>{PENDULUM}</model>', '<frame name="here"><pose>0 0 2 0 0 0</pose></frame>'
    tie = '<joint name="tie" type="ball"><parent>a::arm</parent><child>b::tip</child></joint>'
    text = f'<sdf version="1.11"><world name="w">{here}{ground}{first}{second}TIE</world></sdf>'
    path = tmp_path / "two.world"
    path.write_text(text.replace("TIE", ""))
    model = read_model(path)
    assert {joint.name: joint.kind for joint in model.joints} == {"floor_slab_weld": "fixed", "a_turn": "revolute", "b_turn": "revolute"}
    places = {body.name: [float(x) for x in body.centre_of_mass] for body in model.bodies}
    assert places["a_arm"] == pytest.approx([1, 0, 3])
    assert places["b_arm"] == pytest.approx([0, 1, 2])
    (turn,) = (joint for joint in model.joints if joint.name == "b_turn")
    assert [float(x) for x in turn.axes[0]] == pytest.approx([-1, 0, 0], abs=1e-12)
    assert "b_arm" not in import_file(path, model="a").text
    path.write_text(text.replace("TIE", tie))
    assert "tie: {kind: spherical, bodies: [a_arm, b_arm], at: [0, 1.5, 2]}" in import_file(path).text
    assert "tie" not in import_file(path, model="a").text
    with pytest.raises(ModelError, match="world 'w': has no model 'c'"):
        import_file(path, model="c")


def test_models_inside_others_are_those_written_out(tmp_path: Path) -> None:
    """A model that is placed by one of its frames, in another, beside the same links by hand."""
    inner = f'<model name="in" placement_frame="tip"><pose relative_to="base">0 0 1 0 0.3 0</pose>{PENDULUM}</model>'
    base = f'<link name="base"><pose>0 1 0 0 0 0.2</pose>{MASS}</link>'
    joints = '<joint name="hold" type="revolute"><parent>base</parent><child>in::tip</child><axis><xyz>1 0 0</xyz></axis></joint>'
    inner = inner.replace(PENDULUM[PENDULUM.index("<joint") :], "")
    nested = f'<sdf version="1.9"><model name="m">{base}{inner}{joints}</model></sdf>'
    by_hand = (
        f'{base}<link name="in_arm"><pose relative_to="tip">-0.5 0 0 0 0 0</pose>{MASS}</link>'
        '<frame name="tip"><pose relative_to="base">0 0 1 0 0.3 0</pose></frame>'
        + joints.replace("in::tip", "in_arm").replace("><parent>base", '><pose relative_to="tip"/><parent>base')
    )
    texts = []
    for text in (nested, f'<sdf version="1.9"><model name="m">{by_hand}</model></sdf>'):
        texts.append(import_file(written(tmp_path, text)))
    assert texts[0].notes == ("names that are shared or not legal have been changed: body in::arm is in_arm",)
    assert texts[0].text.splitlines()[2:] == texts[1].text.splitlines()[1:]


@pytest.mark.parametrize("colour", ["0.2 0.4 1", "0.2 0.4 1 1"])
def test_colours_of_three_numbers_or_four(tmp_path: Path, colour: str) -> None:
    visual = f"<visual name='v'><material><diffuse>{colour}</diffuse></material></visual>"
    assert 'colour: "#3366ff"' in import_file(written(tmp_path, FOUR_BAR.replace("</link>", f"{visual}</link>", 1))).text
    assert "colour" not in import_file(written(tmp_path, FOUR_BAR.replace("</link>", f"{visual}</link>", 1).replace(colour, "red"))).text
