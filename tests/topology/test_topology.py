"""Spanning trees, cut joints, loops and classes."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model, read_model_text
from cutjoint.topology import reading
from cutjoint.topology.build import build_topology
from cutjoint.topology.spanning_tree import TopologyError
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text


def test_the_four_suspensions_are_one_class() -> None:
    (found,) = build_topology(read_model(MODELS / "iltis.yaml")).classes
    assert found.size == 4
    assert set(found.roots) == {"front_left.arm", "front_right.arm", "rear_left.arm", "rear_right.arm"}


def test_given_cuts_are_honoured() -> None:
    topology = build_topology(read_model(MODELS / "iltis.yaml"))
    corners = ("front_left", "front_right", "rear_left", "rear_right")
    assert {c.name for c in topology.cuts} == {f"{c}.{j}" for c in corners for j in ("leaf_hinge", "tie_rod_ball")}


def test_every_loop_of_a_suspension_closes_at_the_chassis() -> None:
    topology = build_topology(read_model(MODELS / "iltis.yaml"))
    assert {loop.base for loop in topology.loops} == {"chassis"}
    (leaf,) = [loop for loop in topology.loops if loop.cut == "rear_left.leaf_hinge"]
    assert leaf.bodies == ("rear_left.leaf_link", "rear_left.carrier", "rear_left.arm")
    assert leaf.width == 1


@pytest.mark.parametrize("windows", [1, 2, 10, 40])
def test_chosen_cuts_keep_the_n_four_bar_narrow(windows: int) -> None:
    """With free choice the widest loop couples one body at any N, so that the cost is linear in N."""
    text = four_bar_text(windows).replace(", cut: true", "")
    topology = build_topology(read_model_text(text, "four_bar.yaml"))
    assert len(topology.cuts) == windows
    assert max(loop.width for loop in topology.loops) == 1


def test_cuts_that_tear_a_body_off_are_refused() -> None:
    text, _, _ = (MODELS / "four_bar.yaml").read_text().partition("outputs:")
    text = text.replace("at: start, axis: [0, 0, 1]", "at: start, axis: [0, 0, 1], cut: true")
    with pytest.raises(TopologyError) as error:
        build_topology(read_model_text(text, "four_bar.yaml"))
    assert "body 'crank_0.bar': the cut joints disconnect it from the ground; leave one of its joints uncut" in str(error.value)


def test_a_loop_without_a_joint_to_cut_is_refused() -> None:
    text = (MODELS / "four_bar.yaml").read_text().replace("cut: true", "cut: false")
    text = text.replace("axis: [0, 0, 1]}\n\ninst", "axis: [0, 0, 1], cut: false}\n\ninst")
    with pytest.raises(TopologyError, match="joint 'closure_1': it closes a loop but must not be cut, since it has cut: false"):
        build_topology(read_model_text(text, "four_bar.yaml"))


def test_a_joint_whose_coordinate_is_reported_stays_in_the_tree(tmp_path: Path) -> None:
    text = four_bar_text(3).replace(", cut: true", "")
    topology = build_topology(read_model_text(text, "four_bar.yaml"))
    assert {"crank_0.pin", "crank_1.pin", "crank_2.pin", "crank_3.pin"} <= {t.joint.name for t in topology.tree}


#: A cylinder between a boom and a stick: its slide carries a force, so that one of its eyes is cut.  No joint at the ground is used.
CYLINDER = """\
cutjoint: 1
name: cylinder
gravity: [0, 0, -9.81]
points: {A: [0, 0, 1], B: [1, 0, 1], D: [2, 0, 1], S1: [0.2, 0, 1.3], S2: [1.3, 0, 1.4]}
bodies:
  boom: {mass: 10, centre_of_mass: {midpoint: [A, B]}, inertia: [1, 1, 1]}
  stick: {mass: 10, centre_of_mass: {midpoint: [B, D]}, inertia: [1, 1, 1]}
  tube: {mass: 1, centre_of_mass: S1, inertia: [1, 1, 1]}
  rod: {mass: 1, centre_of_mass: S2, inertia: [1, 1, 1]}
joints:
  foot: {kind: revolute, bodies: [ground, boom], at: A, axis: [0, 1, 0]}
  elbow: {kind: revolute, bodies: [boom, stick], at: B, axis: [0, 1, 0]}
  eye_1: {kind: revolute, bodies: [boom, tube], at: S1, axis: [0, 1, 0]}
  slide: {kind: prismatic, bodies: [tube, rod], at: S1, axis: {from: S1, to: S2}}
  eye_2: {kind: revolute, bodies: [rod, stick], at: S2, axis: [0, 1, 0]}
forces: {pressure: {kind: joint_force, joint: slide, law: "100"}}
scenes: {lift: {end: 1, outputs: [OUTPUTS]}}
"""


@pytest.mark.parametrize("used", ["", "elbow.angle", "eye_1.angle", "eye_2.angle", "elbow.angle, eye_1.angle, eye_2.angle"])
def test_outputs_do_not_change_the_cuts_of_a_planar_loop(used: str) -> None:
    """The force on the slide keeps that in the tree."""
    (cut,) = build_topology(read_model_text(CYLINDER.replace("OUTPUTS", used), "cylinder.yaml")).cuts
    assert cut.name == "eye_2"


def test_a_loop_with_no_joint_that_may_be_cut_is_refused() -> None:
    text = CYLINDER.replace("OUTPUTS", "").replace(
        "lift: {", "lift: {positions: {elbow.angle: 0, eye_1.angle: 0, eye_2.angle: 0, slide.displacement: 0}, "
    )
    reason = "it closes a loop but must not be cut, since scene 'lift' gives its coordinate or speed"
    with pytest.raises(TopologyError, match=reason):
        build_topology(read_model_text(text, "cylinder.yaml"))


def problems_of(text: str) -> list[str]:
    with pytest.raises(ModelError) as error:
        reading.read_model_text(text, "m.yaml")
    return str(error.value).splitlines()


#: The cylinder with every joint held in the tree, so that its loop cannot be cut.
HELD = CYLINDER.replace("OUTPUTS", "").replace(", axis: ", ", cut: false, axis: ")
CLOSES = "joint 'slide': it closes a loop but must not be cut, since it has cut: false"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("boom: {mass: 10", "boom: {mass: -10", "6:3: body 'boom': the mass is negative: -10 kg"),
        ("tube: {mass: 1", "tube: {mass: 1 m", "8:16: body 'tube': mass needs kg, got m"),
        ("tube: {mass: 1", "tube: {mas: 0, mass: 1", "8:10: body 'tube': unknown field 'mas'; did you mean 'mass'?"),
    ],
)
def test_problems_of_loops_come_with_those_of_the_file(old: str, new: str, expected: str) -> None:
    """One list, in the file's order."""
    found = problems_of(HELD.replace(old, new))
    assert found[0] == f"m.yaml:{expected}"
    assert CLOSES in found[1]


def test_torn_bodies_come_with_the_problems_of_the_file() -> None:
    text = HELD.replace("at: A, cut: false", "at: A, cut: true").replace("boom: {mass: 10", "boom: {mass: -10")
    found = problems_of(text)
    assert found[0] == "m.yaml:6:3: body 'boom': the mass is negative: -10 kg"
    assert found[1] == "m.yaml:6:3: body 'boom': the cut joints disconnect it from the ground; leave one of its joints uncut"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("foot: {kind: revolute, bodies: [ground, boom]", "foot: {kind: revolute, bodies: [ground, bom]"),
        ("at: A,", "at: Q,"),
        ("foot: {kind: revolute,", "foot: {kind: revolut,"),
    ],
)
def test_loops_are_not_judged_where_a_joint_cannot_be_read(old: str, new: str) -> None:
    assert not any(CLOSES in line for line in problems_of(HELD.replace(old, new)))


def test_a_wrong_file_and_wrong_loops_in_one_message_of_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "cylinder.yaml"
    path.write_text(HELD.replace("boom: {mass: 10", "boom: {mass: -10"))
    done = CliRunner().invoke(main, ["check", str(path)])
    assert done.exit_code == 1
    assert "the mass is negative" in done.output
    assert CLOSES in done.output
