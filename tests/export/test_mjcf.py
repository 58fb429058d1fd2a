"""Models as MJCF files: read again they have the same code, and MuJoCo moves them as it moves the file that they came from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.pipeline import generate
from cutjoint.export.mjcf import write_mjcf
from cutjoint.importing.document import import_file
from cutjoint.model.errors import ModelError
from cutjoint.topology.reading import read_model, read_model_text
from tests.export.test_urdf import HINGE, MODEL
from tests.importing.test_mjcf import TREE

mujoco = pytest.importorskip("mujoco")

#: Loops by a ball, a hinge and a weld, relations of two and of three joints, one that bends, sites, bounded drives, one
#: on two joints, and a key.
LOOPS = """<mujoco model="loops">
  <option gravity="0 0.5 -9.81"/>
  <default><geom type="capsule" size="0.02" density="3000" contype="0" conaffinity="0"/></default>
  <worldbody>
    <site name="eye" pos="0 0 2"/>
    <body name="crank" pos="0 0 1"><joint name="motor" axis="0 1 0" frictionloss="0.3"/><geom fromto="0 0 0 0.2 0 0.1"/>
      <body name="rod" pos="0.2 0 0.1"><joint name="knee" axis="0 1 0" damping="0.1"/><geom fromto="0 0 0 0.5 0.1 0"/></body></body>
    <body name="rocker" pos="0.7 0 0.7"><joint name="pivot" axis="0 1 0" stiffness="3" springref="0.2"/><geom fromto="0 0 0 0 0 0.4"/>
      <site name="tip" pos="0 0.02 0.4"/></body>
    <body name="a" pos="0 1 1" euler="10 20 30"><joint name="ja" axis="1 2 3"/><geom fromto="0 0 0 0.3 0 0"/></body>
    <body name="b" pos="0 1.2 1"><joint name="jb" axis="0 0 1"/><geom fromto="0 0 0 0 0 0.5"/>
      <body name="c" pos="0 0 0.5"><joint name="jc" axis="1 0 0" armature="0.01"/><geom fromto="0 0 0 0 0.2 0"/></body></body>
    <body name="d" pos="1 1 1"><joint name="jd" type="slide" axis="0 0 1"/><geom fromto="0 0 0 0 0.2 0"/></body>
    <body name="e" pos="2 1 1"><freejoint name="je"/><geom fromto="0 0 0 0.1 0.2 0"/></body>
    <body name="f" pos="2.1 1.2 1"><freejoint name="jf"/><geom fromto="0 0 0 0.1 0.2 0.1"/></body>
  </worldbody>
  <tendon><fixed name="sum"><joint joint="ja" coef="1"/><joint joint="jb" coef="2"/><joint joint="jc" coef="-4"/></fixed>
    <fixed name="split"><joint joint="motor" coef="0.7"/><joint joint="jc" coef="-0.3"/></fixed></tendon>
  <equality>
    <connect name="end" body1="rod" body2="rocker" anchor="0.5 0 0"/>
    <connect name="end_2" body1="rod" body2="rocker" anchor="0.5 0.1 0"/>
    <weld name="both" body1="e" body2="f" anchor="0.1 0 0"/>
    <tendon name="three" tendon1="sum"/>
    <joint name="bent" joint1="jd" joint2="jb" polycoef="0 0.2 0.1 0 -0.05"/>
  </equality>
  <actuator>
    <motor name="m" joint="motor" gear="3" ctrllimited="true" ctrlrange="-1 2"/>
    <position name="p" joint="ja" kp="30" kv="2" forcelimited="true" forcerange="-5 6" ctrllimited="true" ctrlrange="-0.5 0.5"/>
    <general name="w" tendon="split" gear="1.5" forcerange="-50 50" ctrlrange="0 2" gainprm="0.3 0 0" biastype="affine"
             biasprm="0 -2 -0.1"/>
    <velocity name="v" joint="jb" kv="3" gear="2"/>
  </actuator>
</mujoco>
"""
KEYED = TREE.replace("</mujoco>", '<keyframe><key name="up" qpos="0.1 0.15 0.3 1 0 0 0"/></keyframe></mujoco>')


def lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if not line.startswith("#")]


@pytest.mark.parametrize("text", [KEYED, LOOPS], ids=["tree", "loops"])
def test_a_file_that_goes_out_and_comes_back_has_the_same_code(tmp_path: Path, text: str) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(text)
    first = import_file(path).text
    model = read_model_text("\n".join(lines(first)), "robot.yaml")
    written, left_out = write_mjcf(model)
    assert left_out == ()
    path.write_text(written)
    returned = import_file(path).text
    assert lines(returned) == lines(first)
    models = (model, read_model_text("\n".join(lines(returned)), "robot.yaml"))
    sources = [generate(m, m.scenes["motion"], m.scenes["motion"].outputs).source.files for m in models]
    assert sources[0] == sources[1]
    compared = [mujoco.MjModel.from_xml_string(one) for one in (text, written)]
    random = np.random.default_rng(1)
    scalar = compared[0].jnt_dofadr[compared[0].jnt_type > int(mujoco.mjtJoint.mjJNT_BALL)]  # balls turn in their bodies' own axes
    place, speed = np.zeros((2, compared[0].nv))
    place[scalar], speed[scalar] = random.uniform(-1, 1, (2, len(scalar)))
    control = random.uniform(-1, 1, compared[0].nu)
    moved = [accelerations(one, place, speed, control)[scalar] for one in compared]
    assert moved[1] == pytest.approx(moved[0], rel=1e-9, abs=1e-9 * np.abs(moved[0]).max())
    for name in ("dof_frictionloss", "dof_armature", "jnt_stiffness", "actuator_forcerange", "actuator_ctrlrange"):
        assert getattr(compared[1], name) == pytest.approx(getattr(compared[0], name)), name
    assert sorted(compared[1].eq_type) == sorted(compared[0].eq_type)


def accelerations(model: mujoco.MjModel, place: np.ndarray, speed: np.ndarray, control: np.ndarray) -> np.ndarray:
    """MuJoCo's accelerations of joints without its soft constraints, at a place so far from its zero position."""
    data = mujoco.MjData(model)
    mujoco.mj_integratePos(model, data.qpos, place, 1.0)
    data.qvel[:], data.ctrl[:] = speed, control
    mujoco.mj_forward(model, data)
    return np.asarray(data.qacc_smooth)


def tetrahedron(path: Path) -> None:
    """An STL file of four triangles."""
    corners = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1]], dtype="<f4")
    faces = np.zeros(4, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    faces["corners"] = corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    path.write_bytes(bytes(80) + np.uint32(4).tobytes() + faces.tobytes())


def test_a_mesh_stays_where_it_is(tmp_path: Path) -> None:
    tetrahedron(tmp_path / "part.stl")
    geom = '<geom type="mesh" mesh="part" mass="1" pos="0.1 0.2 0.3" euler="20 30 40" rgba="1 0 0 1"/>'
    bodies = f'<body name="a" pos="0 0 1" euler="5 6 7"><joint name="j"/>{geom}</body>'
    asset = '<asset><mesh name="part" file="part.stl" scale="0.1 0.1 0.1"/></asset>'
    path = tmp_path / "robot.xml"
    path.write_text(f"<mujoco>{asset}<worldbody>{bodies}</worldbody></mujoco>")
    first = import_file(path).text
    assert "mesh: part.stl" in first
    path.write_text(write_mjcf(read_model(path))[0])
    assert lines(import_file(path).text) == lines(first)


BEHIND = "{kind: revolute, bodies: [b, a], at: [1, 0, 0], axis: z}"


def test_points_and_rods_move_in_mujoco_as_bodies_that_are_nearly_so() -> None:
    """A pendulum of two points of 1 kg, out of line: M and the force by hand at rest."""
    text = MODEL.format(HINGE, BEHIND, "").replace("gravity: [0, 0, 0]", "gravity: [0, -10, 0]")
    model = mujoco.MjModel.from_xml_string(write_mjcf(read_model_text(text, "m.yaml"))[0])
    found = accelerations(model, np.zeros(2), np.zeros(2), np.zeros(0))
    mass = np.array([[1 + 2, -1.0], [-1.0, 1.0]])  # of j, and of k, which turns b against its axis
    assert found == pytest.approx(np.linalg.solve(mass, [-10.0, 0.0]), abs=1e-9)


@pytest.mark.parametrize(
    ("joint", "more", "message"),
    [
        ("{kind: planar, bodies: [a, b], at: [1, 0, 0], axis: z}", "", "joint 'k': MuJoCo has no joint of kind planar there"),
        ("{kind: free, bodies: [a, b], at: [1, 0, 0]}", "", "joint 'k': a free joint of MuJoCo is one of the ground"),
        (BEHIND.replace("}", ", guide: 0*t}"), "", "joint 'k': MuJoCo has no guides"),
        (BEHIND, "gears:\n  g: {joints: [j, k], law: sin(position)}\n", "gear 'g': is no polynomial of the fourth degree"),
        (BEHIND, "gears:\n  g: {joints: [j, k], law: position**5}\n", "gear 'g': is no polynomial of the fourth degree"),
    ],
)
def test_what_mujoco_cannot_say(joint: str, more: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        write_mjcf(read_model_text(MODEL.format(HINGE, joint, more), "m.yaml"))


def test_bodies_without_mass_are_refused_by_name() -> None:
    text = MODEL.format(HINGE, BEHIND, "").replace("b: {mass: 1, centre_of_mass: [1, 1, 0]}", "b: {massless: true, inertia: [1, 1, 1]}")
    with pytest.raises(
        ModelError, match="body 'b': MuJoCo has no bodies without mass that move or have inertia; give it some by --link-mass"
    ):
        write_mjcf(read_model_text(text, "m.yaml"))


def test_what_is_left_out_is_named(tmp_path: Path) -> None:
    forces = "forces:\n  f: {kind: joint_force, joint: j, law: -3*position**3}\n  g: {kind: joint_force, joint: j, law: -3*position}\n"
    path = tmp_path / "m.yaml"
    path.write_text(MODEL.format(HINGE, BEHIND, forces))
    result = CliRunner().invoke(main, ["export", str(path), "--to", "mjcf", "--out", str(tmp_path / "m.xml")])
    said = " ".join(result.output.split())
    assert said.startswith("left out, since MJCF has linear springs, dampers, dry friction and drives of joints here: f 2 bodies")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml")).jnt_stiffness[0] == 3
    assert "an MJCF is one file whose name ends in .xml" in " ".join(
        CliRunner().invoke(main, ["export", str(path), "--to", "mjcf", "--out", str(tmp_path / "m.urdf")]).output.split()
    )


def test_springs_of_balls_come_back_or_are_named(tmp_path: Path) -> None:
    """A ball's spring that rests in the design position is the joint's; one that rests elsewhere, or closes a loop, is left out by name."""
    text = """
cutjoint: 1
name: balls
gravity: [0, 0, -9.81]
bodies:
  one: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.1, 0.1]}
  two: {mass: 1, centre_of_mass: [1.5, 0, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  hip: {kind: spherical, bodies: [one, ground], at: [0, 0, 0], spring: {stiffness: 3, damping: 0.1}}
  knee: {kind: spherical, bodies: [one, two], at: [1, 0, 0], spring: {stiffness: 3, free_rotation: [0.1, 0, 0]}}
  tip: {kind: spherical, bodies: [ground, two], at: [2, 0, 0], spring: {damping: 0.2}}
scenes: {run: {end: 1}}
"""
    written, notes = write_mjcf(read_model_text(text, "balls.yaml"))
    assert '<joint name="hip" type="ball" stiffness="3.0" damping="0.1"' in written
    (left,) = (note for note in notes if "springs" in note)
    assert left.endswith(": knee_spring, tip_spring")
