"""A YAML beside a URDF says of joints and loops what the URDF could say itself, and so do the older dialects of URDF+."""

from __future__ import annotations

from pathlib import Path

import pytest

from cutjoint.importing.document import Imported, import_file
from cutjoint.model.errors import ModelError
from tests.importing.test_urdf import LINKS, ROD, SOUND, hinge, link, robot, turning

#: A crank and a rocker with a rod between them, by a joint at one end that the YAML changes.
CRANK = '<link name="base"/><link name="tip"/><link name="pin"/>' + "".join(link(x, inertia=SOUND) for x in ("crank", "rod", "rocker"))
ENDS = (
    '<joint name="tip_frame" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="0.6 0.1 0.4"/></joint>'
    '<joint name="pin_frame" type="fixed"><parent link="rocker"/><child link="pin"/><origin xyz="0 0.1 0.5"/></joint>'
)


def model_of(tmp_path: Path, text: str, beside: str = "") -> tuple[str, Imported]:
    """The model file that a URDF becomes, without comments; the YAML beside it, if there is one."""
    path = tmp_path / "machine.urdf"
    path.write_text(text)
    path.with_suffix(".yaml").unlink(missing_ok=True)
    if beside:
        path.with_suffix(".yaml").write_text(beside)
    imported = import_file(path)
    return "\n".join(line for line in imported.text.splitlines() if not line.startswith("#")), imported


def test_a_ball_of_the_yaml_is_one_of_three_hinges(tmp_path: Path) -> None:
    """The machine with three hinges moves as Pinocchio's does (test_urdf.py)."""
    written, _ = model_of(tmp_path, robot(ROD[0], ROD[1] + ROD[2]))
    swing = turning("swing", "base", "rocker", "0 1 0.3", "0.8 0 0")
    short = turning("drive", "base", "crank", "0 1 0") + turning("ball", "crank", "rod", "0 1 1", "0.2 0 0.1") + swing
    beside = "closed_loop: [[tip, pin]]\ntype: [3d]\njoint_name: [ball]\njoint_type: [SPHERICAL]\n"
    said, _ = model_of(tmp_path, robot(CRANK, short + ENDS), beside)
    assert said.replace("loop_1", "end") == written


@pytest.mark.parametrize(("first", "second", "axes"), [("X", "Y", ("1 0 0", "0 1 0")), ("Z", "X", ("0 0 1", "1 0 0"))])
def test_a_cardan_joint_of_the_yaml_is_two_hinges(tmp_path: Path, first: str, second: str, axes: tuple[str, str]) -> None:
    turn = 'xyz="0.2 0 0.1" rpy="0.3 -0.2 0.5"'
    drive, swing = turning("drive", "base", "crank", "0 1 0"), turning("swing", "base", "rocker", "0 1 0.3", "0.8 0 0")
    hinges = turning(f"cardan_{first}", "crank", "cardan_cross", axes[0]).replace('xyz="0 0 0"', turn)
    hinges += turning(f"cardan_{second}", "cardan_cross", "rod", axes[1])
    beside = "closed_loop: [[tip, pin]]\ntype: ['3D']\n"
    written, _ = model_of(tmp_path, robot(CRANK + '<link name="cardan_cross"/>', drive + hinges + swing + ENDS), beside)
    one = turning("cardan", "crank", "rod", "0 1 1").replace('xyz="0 0 0"', turn)
    more = f"joint_name: [cardan]\njoint_type: [UJOINT_{first}{second}]\n"
    said, _ = model_of(tmp_path, robot(CRANK, drive + one + swing + ENDS), beside + more)
    assert said == written
    assert f"cardan_{first}: {{kind: revolute" in said


def test_a_joint_of_the_yaml_is_fixed(tmp_path: Path) -> None:
    joints = hinge("j", "base", "a", "0 0 0") + hinge("k", "a", "b", "1 0 0", '<dynamics damping="1"/>') + hinge("l", "b", "c", "0 1 0")
    beside = "joint_name: [k]\njoint_type: [FIXED]\nname_mot: [l]\nrotor_inertia: [1]\n"
    said, imported = model_of(tmp_path, robot(LINKS, joints), beside)
    fixed = joints.replace('name="k" type="revolute"', 'name="k" type="fixed"')
    written, _ = model_of(tmp_path, robot(LINKS, fixed), "name_mot: [l]\njoint_type: []")
    assert said == written
    assert "left out of machine.yaml: rotor_inertia" in imported.notes


@pytest.mark.parametrize(
    ("beside", "line", "message"),
    [
        ("joint_type: [SPHERICAL]\njoint_name: [z]\n", 2, "names the joint 'z', which is not there"),
        ("joint_name: [j]\njoint_type: [SCREW]\n", 2, "has the unknown type 'SCREW'; use SPHERICAL, FIXED, or UJOINT_XY"),
        ("joint_name: [j]\njoint_type: [UJOINT_XX]\n", 2, "has the unknown type 'UJOINT_XX'"),
        ("joint_name: [j, k]\njoint_type: [SPHERICAL]\n", 2, "has 1 entries for 2 of joint_name"),
        ("closed_loop: 5\n", 1, "is no list"),
        ("closed_loop: []\ntype: {a: 1}\n", 2, "is no list"),
        ("closed_loop: [[a, b]]\ntype: [3d, 6d]\n", 2, "has 2 types for 1 loop"),
        ("closed_loop: [[a, b, c]]\n", 1, "wants pairs of frames"),
        ("closed_loop: [[a, z]]\n", 1, "names 'z', which is neither joint nor link"),
        ("closed_loop: []\nname_mot: [z]\n", 2, "names the joint 'z', which is not there"),
        ("joint_name: [k]\njoint_type: [UJOINT_XY]\n", 0, "is of a joint that the sidecar YAML makes a Cardan joint"),
    ],
)
def test_faults_of_the_yaml_have_their_line(tmp_path: Path, beside: str, line: int, message: str) -> None:
    joints = hinge("j", "base", "a", "0 0 0") + hinge("k", "a", "b", "1 0 0", '<mimic joint="j"/>') + hinge("l", "b", "c", "0 1 0")
    with pytest.raises(ModelError, match=message) as caught:
        model_of(tmp_path, robot(LINKS, joints), beside)
    span = caught.value.problems[0].span
    assert (Path(span.file).name, span.line) == (("machine.yaml", line) if line else ("machine.urdf", 3))


def test_older_dialects_say_the_same(tmp_path: Path) -> None:
    """Loops whose points meet, and wheels that roll."""
    links = LINKS + link("d")
    joints = hinge("j", "base", "a", "0 0 0") + hinge("k", "a", "b", "0.1 0 0")
    joints += hinge("l", "base", "c", "0 0 0") + hinge("m", "base", "d", "0 1 0")
    ends = '<predecessor link="c"><origin xyz="0.3 0 0"/></predecessor><successor link="b"><origin xyz="0.2 0 0"/></successor>'
    wheels = '<predecessor link="a"/><successor link="d"/><ratio value="6"/>'
    new = f'<loop name="o" type="spherical">{ends}</loop><coupling name="g">{wheels}</coupling>'
    middle = f'<constraint name="o" type="position">{ends}</constraint><constraint name="g" type="rolling">{wheels}</constraint>'
    loop = '<parent link="c"/><parent_origin xyz="0.3 0 0"/><child link="b"/><child_origin xyz="0.2 0 0"/>'
    gear = '<parent link="a"/><child link="d"/><gear_ratio value="6"/>'
    old = f'<loop_constraint name="o">{loop}</loop_constraint><joint_constraint name="g">{gear}</joint_constraint>'
    written = [model_of(tmp_path, robot(links, joints + text))[1] for text in (new, middle, old)]
    assert "o: {kind: spherical" in written[0].text
    assert "ratio: 6" in written[0].text
    assert {imported.text for imported in written} == {written[0].text}
    with pytest.raises(ModelError, match="constraint 'g': has the unknown type 'sliding'; write it as <loop> or <coupling>"):
        model_of(tmp_path, robot(links, joints + middle.replace("rolling", "sliding")))


def test_joints_that_nothing_moves_are_reported(tmp_path: Path) -> None:
    follower = hinge("k", "a", "b", "1 0 0").replace("<joint", '<joint independent="false"')
    text = robot(LINKS, hinge("j", "base", "a", "0 0 0") + follower + hinge("l", "b", "c", "0 0 0"))
    assert "free, since the file does not say on which joints they depend: k" in model_of(tmp_path, text)[1].notes
