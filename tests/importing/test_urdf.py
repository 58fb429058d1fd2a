"""URDF with loops: motion beside Pinocchio, which reads the same file; positions in which loops close; what is refused, with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.importing.document import import_file
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Model
from cutjoint.tasks.batch import simulate
from cutjoint.topology.reading import read_model, read_model_text
from cutjoint_bench.robots import PinocchioRobot
from cutjoint_bench.studies.imports import Subject, Worst, begin
from tests.conftest import needs_cpp

LEG = Path(__file__).with_name("leg.urdf")
BODIES = ("thigh", "shank", "crank", "rod", "rotor")


@needs_cpp
def test_accelerations_are_those_of_pinocchio() -> None:
    imported = import_file(LEG)
    angles = [f"{joint}.{quantity}" for joint in imported.joints if joint != "sole" for quantity in ("angle", "angle_rate")]
    columns = [*angles, *(f"{body}.a{c}" for body in BODIES for c in "xyz")]
    text = imported.text.replace("outputs: [motor.angle]", f"outputs: [{', '.join(columns)}]")
    text = text.replace("motion: {end: 1}", "motion: {end: 1, output_step: 0.05, rates: {yaw.angle_rate: 1, motor.angle_rate: 2}}")
    model = read_model_text(text, "leg.yaml")
    run = simulate(compile_interpreted(model, model.scenes["motion"]), accuracy=1e-9)
    oracle = PinocchioRobot(LEG)
    damped = oracle.model.joints[oracle.model.getJointId("yaw")].idx_v
    for row in range(len(run["t"])):
        q, v = oracle.state({name: (run[f"{name}.angle"][row], run[f"{name}.angle_rate"][row]) for name in oracle.model.names[1:]})
        tau = np.zeros(oracle.model.nv)
        tau[damped] = -0.2 * v[damped]
        expected = oracle.solve(q, v, tau)
        assert (expected.freedom, expected.gap < 1e-9, expected.slip < 1e-6) == (2, True, True)
        for body in BODIES:
            assert [run[f"{body}.a{c}"][row] for c in "xyz"] == pytest.approx(expected.accelerations[body], abs=1e-9)


def test_what_a_file_becomes(tmp_path: Path) -> None:
    imported = import_file(LEG)
    assert imported.left_out == {"collision": 1, "limit": 1}
    model = read_model(LEG)
    assert [b.name for b in model.bodies] == ["thigh", "shank", "crank", "rod", "rotor", "rotor_excess"]
    assert [m.name for m in model.markers] == ["toe"]
    assert (model.gears[0].joints, float(model.gears[0].ratio)) == (("geared", "motor"), -5)
    assert import_file(LEG).text == imported.text


def robot(links: str, joints: str) -> str:
    return f'<robot name="r">\n{links}\n{joints}\n</robot>\n'


def link(name: str, mass: float = 1, inertia: str = 'ixx="0.1" iyy="0.1" izz="0.1"') -> str:
    return f'<link name="{name}"><inertial><mass value="{mass}"/><inertia {inertia}/></inertial></link>'


def hinge(name: str, parent: str, child: str, xyz: str, more: str = "") -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="0 0 1"/>{more}</joint>'
    )


LINKS = '<link name="base"/>' + link("a") + link("b") + link("c")


def test_loops_in_a_file_beside_close_from_afar(tmp_path: Path) -> None:
    """A five-bar whose zero position is stretched out: the ends of both arms meet in the position found, by frames that are joints."""
    ends = '<link name="end"/>'
    arms = hinge("j1", "base", "a", "0 0 0") + hinge("j2", "a", "b", "1 0 0") + hinge("j3", "base", "c", "0.5 0 0")
    tips = '<joint name="tip" type="fixed"><parent link="b"/><child link="end"/><origin xyz="1 0 0"/></joint>'
    other = '<link name="mark"/><joint name="tip2" type="fixed"><parent link="c"/><child link="mark"/><origin xyz="0.8 0 0"/></joint>'
    path = tmp_path / "five.urdf"
    path.write_text(robot(LINKS + ends + other, arms + tips))
    path.with_suffix(".yaml").write_text("closed_loop: [[tip, mark]]\ntype: ['3d']\nname_mot: [j1]\n")
    model = read_model(path)
    joints = {joint.name: joint for joint in model.joints}
    place = [float(x) for x in joints["loop_1"].at]
    assert joints["loop_1"].kind == "spherical"
    assert np.hypot(place[0] - 0.5, place[1]) == pytest.approx(0.8, abs=1e-9)
    elbow = [float(x) for x in joints["j2"].at]
    assert np.hypot(place[0] - elbow[0], place[1] - elbow[1]) == pytest.approx(1, abs=1e-9)
    assert np.hypot(*elbow[:2]) == pytest.approx(1, abs=1e-9)
    assert [parameter.name for parameter in model.parameters] == ["j1_drive"]


def test_a_moment_that_no_body_has_is_kept(tmp_path: Path) -> None:
    """The mass matrix is that of the file, though a principal moment is larger than the sum of the others."""
    path = tmp_path / "plate.urdf"
    path.write_text(robot('<link name="base"/>' + link("a", 2, 'ixx="0" iyy="0" izz="0.5"'), hinge("j", "base", "a", "0 0 0")))
    model: Model = read_model(path)
    shaft = next(body for body in model.bodies if body.name == "a_excess")
    assert (float(shaft.mass), float(shaft.inertia[2])) == (0, 0.5)


def turning(name: str, parent: str, child: str, axis: str, xyz: str = "0 0 0", more: str = "") -> str:
    text = hinge(name, parent, child, xyz, more).replace('<axis xyz="0 0 1"/>', f'<axis xyz="{axis}"/>')
    return text.replace('type="revolute"', 'type="continuous"')


#: A rod between a crank and a rocker: a ball at one end, three hinges at the other one.
SOUND = 'ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"'
ROD = (
    '<link name="base"/><link name="r1"/><link name="r2"/>' + "".join(link(name, inertia=SOUND) for name in ("crank", "rod", "rocker")),
    turning("drive", "base", "crank", "0 1 0")
    + turning("ball_rev0", "crank", "r1", "1 0 0", "0.2 0 0.1")
    + turning("ball_rev1", "r1", "r2", "0 1 0")
    + turning("ball_rev2", "r2", "rod", "0 0 1")
    + turning("swing", "base", "rocker", "0 1 0.3", "0.8 0 0"),
    '<loop name="end" type="spherical"><predecessor link="rod"><origin xyz="0.6 0.1 0.4"/></predecessor>'
    '<successor link="rocker"><origin xyz="0 0.1 0.5"/></successor></loop>',
)


@needs_cpp
def test_three_hinges_that_meet_are_a_ball(tmp_path: Path) -> None:
    """The machine moves as Pinocchio's with the three hinges does."""
    path = tmp_path / "rod.urdf"
    path.write_text(robot(ROD[0], ROD[1] + ROD[2]))
    subject, worst = Subject(path), Worst()
    assert {joint.name: joint.kind for joint in read_model(path).joints} == {
        "drive": "revolute", "ball": "spherical", "swing": "revolute", "end": "spherical"
    }  # fmt: skip
    for state in subject.states(4, 1):
        worst.take(subject, begin(state, 1e-10, 0.0))
    assert (worst.degrees_of_freedom, worst.singular) == ({2}, 0)
    assert (worst.place < 1e-12, worst.acceleration < 1e-9) == (True, True)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('child link="rod"/><origin xyz="0 0 0"', 'child link="rod"/><origin xyz="0 0.01 0"'),
        ('<axis xyz="0 0 1"/></joint><joint name="swing"', '<axis xyz="1 1 0"/></joint><joint name="swing"'),
        ('<axis xyz="0 0 1"/></joint><joint name="swing"', '<axis xyz="0 0 1"/><dynamics damping="1"/></joint><joint name="swing"'),
        ("</robot>", '<transmission name="t"><joint name="ball_rev1"/></transmission></robot>'),
        ("</robot>", '<link name="eye"/><joint name="e" type="fixed"><parent link="r1"/><child link="eye"/></joint></robot>'),
        ('<link name="r1"/>', link("r1")),
        (ROD[2], ""),
    ],
    ids=["apart", "in a plane", "damped", "driven", "eye", "heavy", "no loop"],
)
def test_three_hinges_that_stay_so(tmp_path: Path, old: str, new: str) -> None:
    text = robot(ROD[0], ROD[1] + ROD[2])
    assert old in text
    path = tmp_path / "rod.urdf"
    path.write_text(text.replace(old, new))
    assert "ball_rev1: {kind: revolute" in import_file(path).text


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (robot(LINKS, hinge("j", "base", "d", "0 0 0")), 3, "names the link 'd', which is not there"),
        (robot(LINKS, hinge("j", "base", "a", "0 0")), 3, "has '0 0' where 3 numbers stand"),
        (robot(LINKS, hinge("j", "base", "a", "0 0 nan")), 3, "has '0 0 nan' where 3 numbers stand"),
        (robot(LINKS, hinge("j", "base", "a", "0 0 0") + hinge("k", "b", "c", "0 0 0")), 1, "has 2 links without a parent"),
        (robot(LINKS, hinge("j", "base", "a", "0 0 0") + hinge("k", "b", "a", "0 0 0")), 3, "which another joint carries too"),
        (robot(LINKS + link("a"), ""), 2, "has the name of another"),
        (robot(link("base") + link("a", -1), hinge("j", "base", "a", "0 0 0")), 2, "negative mass"),
        (robot(LINKS, '<joint name="j" type="planar"><parent link="base"/><child link="a"/></joint>'), 3, "is of type planar"),
        (robot(LINKS, hinge("j", "base", "a", "0 0 0", '<mimic joint="k"/>')), 3, "follows the joint 'k', which is not there"),
        ("<robot name='r'>\n<link name='a'>\n</robot>", 3, "is no XML"),
        ("<model/>", 1, "is no URDF"),
        ('<!DOCTYPE robot [<!ENTITY a "x">]>\n<robot name="&a;"/>', 1, "document types and entities are not read"),
        ("<robot>" + "<link>" * 100 + "</link>" * 100 + "</robot>", 1, "60 within each other"),
    ],
)
def test_faults_have_their_line(tmp_path: Path, text: str, line: int, message: str) -> None:
    path = tmp_path / "faulty.urdf"
    path.write_text(text)
    with pytest.raises(ModelError, match=message) as caught:
        read_model(path)
    assert caught.value.problems[0].span.line == line


def test_a_loop_that_cannot_close_is_named(tmp_path: Path) -> None:
    ends = '<predecessor link="a"><origin xyz="9 0 0"/></predecessor><successor link="b"><origin xyz="0 0 1"/></successor>'
    joints = hinge("j", "base", "a", "0 0 0") + hinge("k", "base", "b", "1 0 0") + hinge("l", "b", "c", "0 1 0")
    path = tmp_path / "far.urdf"
    path.write_text(robot(LINKS, f'{joints}<loop name="far">{ends}</loop>'))
    with pytest.raises(ModelError, match="loop 'far': does not close"):
        read_model(path)


@pytest.mark.parametrize(("axis", "written"), [("1e-6 0 1", [1e-6, 0, 1]), ("0 2.7e-8 -1", [0, 2.7e-8, -1]), ("4.9e-12 0 1", [0, 0, 1])])
def test_directions_are_those_of_the_file(tmp_path: Path, axis: str, written: list[float]) -> None:
    """Half of pi with eleven digits is the axis itself, with eight digits it is not."""
    path = tmp_path / "tilted.urdf"
    path.write_text(robot('<link name="base"/>' + link("a"), turning("j", "base", "a", axis)))
    unit = np.array(written) / np.linalg.norm(written)
    assert [float(x) for x in read_model(path).joints[0].axes[0]] == pytest.approx(list(unit), abs=1e-15)


def test_pictures_that_are_a_little_tilted_are_drawn(tmp_path: Path) -> None:
    """A frame that is turned by 0.8 mrad about one axis and by 0.4 microrad about another has axes that are perpendicular as written."""
    path = tmp_path / "tilted.urdf"
    visual = '<visual><origin rpy="1.5707963267948966 -4.2e-7 -8e-4"/><geometry><mesh filename="a.stl"/></geometry></visual></link>'
    (tmp_path / "a.stl").write_bytes(b"")
    path.write_text(robot('<link name="base"/>' + link("a").replace("</link>", visual), hinge("j", "base", "a", "0 0 0")))
    assert "x: [0.99999968, -0.000799999914667, 4.2e-07], y: [-4.199998656e-07, " in import_file(path).text
    read_model(path)


@pytest.mark.parametrize(("kind", "axis"), [("revolute", "0 1 0"), ("ball", ""), ("fixed", "")])
def test_a_joint_in_gazebo_closes_a_loop(tmp_path: Path, kind: str, axis: str) -> None:
    """As <loop> does, whose frames are those of the zero position: b is 1 m before a, which is 1 m before the base."""
    tree = hinge("j", "base", "a", "1 0 0") + hinge("k", "a", "b", "1 0 0")
    given = f"<axis><xyz>{axis}</xyz></axis>" if axis else ""
    joint = f'<joint name="tie" type="{kind}"><pose>0.5 0 0.2 0 0 0</pose><parent>base</parent><child>b</child>{given}</joint>'
    gazebo = f"<gazebo>{joint}</gazebo><gazebo><plugin/></gazebo>"
    ends = '<predecessor link="base"><origin xyz="2.5 0 0.2"/></predecessor><successor link="b"><origin xyz="0.5 0 0.2"/></successor>'
    loop = f'<loop name="tie" type="{kind.replace("ball", "spherical")}">{ends}{f"<axis xyz={axis!r}/>" if axis else ""}</loop>'
    texts = []
    for more in (gazebo, loop):
        path = tmp_path / "r.urdf"
        path.write_text(robot(LINKS.replace(link("c"), ""), tree + more))
        texts.append("\n".join(line for line in import_file(path).text.splitlines() if not line.startswith("# Left out")))
    assert texts[0] == texts[1]
    path.write_text(robot(LINKS.replace(link("c"), ""), tree + gazebo.replace(f'"{kind}"', '"screw"')))
    assert "left out is the loop that the joint 'tie' in <gazebo> closes: it is of type 'screw'" in import_file(path).notes


def test_elements_that_share_a_name_and_friction_of_a_fixed_joint_are_noted(tmp_path: Path) -> None:
    dynamics = '<dynamics damping="0.1" friction="0.2"/>'
    joint = '<joint name="{0}" type="{2}"><parent link="{1}"/><child link="{0}"/>{3}</joint>'
    path = tmp_path / "r.urdf"
    path.write_text(robot(link("base") + link("crank") + link("tool"),
                          joint.format("crank", "base", "continuous", "") + joint.format("tool", "crank", "fixed", dynamics)))
    imported = import_file(path)
    assert "names that are shared or not legal have been changed: joint crank is crank_joint, joint tool is tool_joint" in imported.notes
    assert "tool is fixed: damping and friction of its <dynamics> have no effect" in imported.notes
    assert not any(word.startswith("dynamics") for word in imported.left_out)
