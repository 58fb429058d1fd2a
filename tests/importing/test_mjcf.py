"""MJCF as MuJoCo compiles it: trees move as MuJoCo's, loops are rigid; files outside the folder are refused."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.importing import mjcf_process
from cutjoint.importing.document import import_file
from cutjoint.importing.robot import of_quaternion
from cutjoint.model.errors import ModelError
from cutjoint.tasks.batch import simulate
from cutjoint.topology.reading import read_model, read_model_text
from tests.conftest import needs_cpp

mujoco = pytest.importorskip("mujoco")

TREE = """
<mujoco model="arm">
  <default><joint damping="0.3" armature="0.02"/><geom density="800"/></default>
  <worldbody>
    <body name="base" pos="0 0 1" euler="10 20 30">
      <joint name="pan" axis="0 0 1" pos="0.1 0 0"/>
      <geom type="box" size="0.1 0.2 0.05" pos="0.05 0 0.1"/>
      <body name="lift" pos="0.3 0 0.1" quat="0.9 0.1 0.3 0.2">
        <joint name="slide" type="slide" axis="0 1 1" stiffness="40" springref="0.1" ref="0.05" damping="5"/>
        <joint name="turn" axis="1 0 0" pos="0 0.1 0"/>
        <geom type="capsule" fromto="0 0 0 0.1 0 0.3" size="0.04"/>
        <body name="tip" pos="0 0 0.3">
          <joint name="ball" type="ball" stiffness="3" damping="0.2" armature="0"/>
          <geom type="ellipsoid" size="0.05 0.1 0.2" pos="0.02 0 0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="m" joint="pan" gear="3"/><position name="servo" joint="slide" kp="30"/></actuator>
</mujoco>
"""


@needs_cpp
def test_a_tree_moves_as_in_mujoco(tmp_path: Path) -> None:
    """Accelerations of MuJoCo at the states of a run, by its own pose and velocities of bodies."""
    path = tmp_path / "arm.xml"
    path.write_text(TREE)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    columns = ["pan.angle", "pan.angle_rate", "slide.displacement", "slide.displacement_rate", "turn.angle", "turn.angle_rate"]
    columns += [f"{body}.{q}" for body in ("base", "lift", "tip") for q in ("ax", "ay", "az", "wx", "wy", "wz", "roll", "pitch", "yaw")]
    text = import_file(path).text
    begin = text.index("outputs:")
    start = "rates: {pan.angle_rate: 1, turn.angle_rate: -2, ball.wx: 1, ball.wz: 3}"
    scene = f"{{end: 1, output_step: 0.1, {start}, inputs: {{m: 0.2, servo: 0.3}}}}"
    read = read_model_text(f"{text[:begin]}outputs: [{', '.join(columns)}]\nscenes:\n  motion: {scene}\n", "arm.yaml")
    run = simulate(compile_interpreted(read, read.scenes["motion"]), accuracy=1e-9)
    mujoco.mj_forward(model, data)
    design = {body: data.body(body).xmat.reshape(3, 3).copy() for body in ("base", "lift", "tip")}
    for row in range(len(run["t"])):
        at = {name: run[name][row] for name in run}
        turned = {body: rotation(*[at[f"{body}.{a}"] for a in ("roll", "pitch", "yaw")]) @ design[body] for body in design}
        data.qpos[:3] = at["pan.angle"], at["slide.displacement"] + 0.05, at["turn.angle"]
        data.qvel[:3] = at["pan.angle_rate"], at["slide.displacement_rate"], at["turn.angle_rate"]
        relative = turned["lift"].T @ turned["tip"]
        mujoco.mju_mat2Quat(data.qpos[3:], relative.ravel())
        spins = [np.array([at[f"{body}.w{c}"] for c in "xyz"]) for body in ("lift", "tip")]
        data.qvel[3:] = turned["tip"].T @ (spins[1] - spins[0])
        data.ctrl[:] = 0.2, 0.3
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        for body in design:
            twist = np.zeros(6)
            mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_BODY, data.body(body).id, twist, 0)
            expected = twist[3:] + model.opt.gravity  # of the body's centre, without the gravity that MuJoCo adds
            assert np.abs(np.array([at[f"{body}.a{c}"] for c in "xyz"]) - expected).max() < 1e-9 * np.abs(expected).max()


BALLS = """
<mujoco model="balls">
  <default><geom density="800" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="one" pos="0 0 1">
      <joint name="hip" type="ball" stiffness="30" damping="0.4"/>
      <geom type="box" size="0.1 0.2 0.05" pos="0.05 0 0.1"/>
      <body name="two" pos="0.3 0 0.1">
        <joint name="wrist" type="ball" pos="0 0.1 0" stiffness="5"/>
        <geom type="ellipsoid" size="0.05 0.1 0.2" pos="0.02 0 0.2"/>
        <body name="three" pos="0 0.2 0">
          <joint name="tip" type="ball" damping="0.05"/>
          <geom type="capsule" fromto="0 0 0 0.1 0 0.3" size="0.04"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@needs_cpp
def test_springs_of_balls_are_those_of_mujoco(tmp_path: Path) -> None:
    """Accelerations and the potential at random attitudes, up to half a turn."""
    path = tmp_path / "balls.xml"
    path.write_text(BALLS)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    bodies, joints = ("one", "two", "three"), ("hip", "wrist", "tip")
    columns = [f"{body}.a{c}" for body in bodies for c in "xyz"] + ["hip_spring.potential", "wrist_spring.potential"]
    text = import_file(path).text.partition("scenes:")[0]
    read = read_model_text(f"{text}outputs: [{', '.join(columns)}]\nscenes: {{motion: {{end: 1}}}}\n", "balls.yaml")
    artifact, random = compile_interpreted(read, read.scenes["motion"]), np.random.default_rng(5)
    for state in range(20):
        places, rates = {}, {}
        for i, joint in enumerate(joints):
            quaternion, spin = random.standard_normal(4), 3 * random.standard_normal(3)
            quaternion[0] *= 0.01 if state % 2 else 1  # a hundredth: near half a turn
            quaternion /= np.linalg.norm(quaternion)
            data.qpos[4 * i : 4 * i + 4], data.qvel[3 * i : 3 * i + 3] = quaternion, spin
            before = of_quaternion(*quaternion) @ spin  # in the axes of the body before the joint
            places |= {f"{joint}.e{k}": sympy.Float(x) for k, x in enumerate(quaternion)}
            rates |= {f"{joint}.w{c}": sympy.Float(x) for c, x in zip("xyz", before, strict=True)}
        scene = replace(artifact.scene, end=0, positions=places, rates=rates)
        run = simulate(replace(artifact, scene=scene), check=False)
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        for body in bodies:
            twist = np.zeros(6)
            mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_BODY, data.body(body).id, twist, 0)
            expected = twist[3:] + model.opt.gravity
            assert np.abs(np.array([run[f"{body}.a{c}"][0] for c in "xyz"]) - expected).max() < 1e-9 * np.abs(expected).max()
        weight = -sum(model.body_mass[i] * model.opt.gravity @ data.xipos[i] for i in range(1, model.nbody))
        assert sum(run[f"{j}_spring.potential"][0] for j in ("hip", "wrist")) == pytest.approx(data.energy[0] - weight, rel=1e-9)


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(x), np.sin(x)) for x in (roll, pitch, yaw))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ about_y @ about_x


def wrapped(bodies: str, more: str) -> str:
    return f'<mujoco model="m"><worldbody>{bodies}</worldbody>{more}</mujoco>'


def hinged(name: str, place: str, inside: str = "") -> str:
    geom = '<geom type="sphere" size="0.1" pos="0.2 0 0"/>'
    return f'<body name="{name}" pos="{place}"><joint name="{name}_j" axis="0 1 0"/>{geom}{inside}</body>'


def written(tmp_path: Path, bodies: str, more: str) -> Path:
    path = tmp_path / "m.xml"
    path.write_text(wrapped(bodies, more))
    return path


ARMS = hinged("a", "0 0 0", hinged("b", "1 0 0")) + hinged("c", "2 0 0")


def test_two_points_on_a_line_are_a_hinge(tmp_path: Path) -> None:
    ends = "".join(f'<connect name="c{i}" body1="b" body2="c" anchor="0.5 {y} 0"/>' for i, y in enumerate((-0.1, 0.1)))
    (loop,) = (joint for joint in read_model(written(tmp_path, ARMS, f"<equality>{ends}</equality>")).joints if joint.name == "c0")
    assert (loop.kind, [float(x) for x in loop.axes[0]]) == ("revolute", [0, 1, 0])
    assert [float(x) for x in loop.at] == pytest.approx([1.5, -0.1, 0])


def test_welds_points_and_relations(tmp_path: Path) -> None:
    more = """<equality>
      <weld name="w" body1="b" body2="c"/>
      <joint name="g" joint1="a_j" joint2="c_j" polycoef="0 2 0 0 0"/>
    </equality>"""
    model = read_model(written(tmp_path, ARMS, more))
    assert {joint.name: joint.kind for joint in model.joints}["w"] == "fixed"
    (gear,) = model.gears
    assert (gear.joints, float(gear.ratio)) == (("a_j", "c_j"), 2)
    more = '<equality><joint name="g" joint1="a_j" joint2="c_j" polycoef="0 2 0.5 0 0"/></equality>'
    (gear,) = read_model(written(tmp_path, ARMS, more)).gears
    assert str(gear.law).replace(" ", "") in ("position**2/2+2*position", "0.5*position**2+2*position", "position*(0.5*position+2)",
                                              "position*(position/2+2)")  # fmt: skip


def test_fixed_tendons_relate_several_coordinates(tmp_path: Path) -> None:
    parts = "".join(f'<joint joint="{name}_j" coef="{k}"/>' for name, k in (("a", 1), ("b", 2), ("c", -4)))
    more = f'<tendon><fixed name="t">{parts}</fixed></tendon><equality><tendon name="e" tendon1="t"/></equality>'
    (gear,) = read_model(written(tmp_path, ARMS, more)).gears
    assert gear.joints == ("a_j", "b_j", "c_j")
    assert [float(gear.ratio), float(gear.others[0][1])] == [-2, 4]


def test_starts_and_what_is_left_out(tmp_path: Path) -> None:
    key = '<keyframe><key name="home" qpos="0.1 0.2 0.3"/></keyframe><sensor><jointpos joint="a_j"/></sensor>'
    imported = import_file(written(tmp_path, ARMS, key))
    assert "home: {end: 1, positions: {a_j.angle: 0.1, b_j.angle: 0.2, c_j.angle: 0.3}}" in imported.text
    assert any("sensors (1)" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('<include file="../../etc/passwd"/>', "outside the folder of the file"),
        ('<asset><hfield name="x" size="1 1 1 1" file="/etc/passwd"/></asset>', "outside the folder of the file"),
        ('<asset><skin name="x" file="../x.skn"/></asset>', "outside the folder of the file"),
        ('<extension><plugin plugin="mujoco.pid"/></extension>', "a plugin, whose code is not run"),
        ('<include file="m.xml"/>', "includes 'm.xml' again"),
        ("<nonsense/>", "is refused by MuJoCo"),
        ('<asset><model name="x" file="/etc/passwd"/></asset>', "outside the folder of the file"),
        ('<asset><model name="x" file="m.xml"/></asset>', "includes 'm.xml' again"),
        ('<asset><texture type="2d" builtin="flat" width="30000" height="30000"/></asset>', "is 900000000 large"),
        ('<asset><hfield nrow="30000" ncol="30000" size="1 1 1 1"/></asset>', "is 900000000 large"),
        ('<size nuser_body="500000000"/>', "is 500000000 large"),
        ('<worldbody><flexcomp name="f" count="50 50 50"/></worldbody>', "large"),
        ('<worldbody><replicate count="99"><replicate count="999"><body/></replicate></replicate></worldbody>', "up to 98901 times"),
    ],
)
def test_what_is_refused(tmp_path: Path, more: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        read_model(written(tmp_path, ARMS, more))


def test_a_file_that_is_taken_in_may_repeat_no_more(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(f'<mujoco><worldbody><replicate count="99">{ARMS}</replicate></worldbody></mujoco>')
    (tmp_path / "model.xml").write_text('<mujoco><extension><plugin plugin="x"/></extension></mujoco>')
    outer = '<replicate count="99"><include file="part.xml"/></replicate>'
    with pytest.raises(ModelError, match="up to 9801 times"):
        read_model(written(tmp_path, outer, ""))
    with pytest.raises(ModelError, match="a plugin, whose code is not run"):
        read_model(written(tmp_path, ARMS, '<asset><model name="x" file="model.xml"/></asset>'))


def test_what_includes_bring(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "arm.xml").write_text(f"<mujoco>{ARMS}</mujoco>")
    model = read_model(written(tmp_path, '<include file="parts/arm.xml"/>', ""))
    assert [body.name for body in model.bodies] == ["a", "b", "c"]


@pytest.mark.parametrize("name", ["pipe.xml", "loop.xml", "x" * 5000, "parts/pipe.xml"])
@pytest.mark.parametrize("element", ['<include file="{}"/>', '<asset><hfield name="h" size="1 1 1 1" file="{}"/></asset>'])
def test_files_that_are_none_are_refused(tmp_path: Path, name: str, element: str) -> None:
    """A pipe that nobody writes, a link to itself, a name that no file can have; of what is taken in too, seen from its folder."""
    (tmp_path / "parts").mkdir()
    for folder in (tmp_path, tmp_path / "parts"):
        os.mkfifo(folder / "pipe.xml")
        (folder / "loop.xml").symlink_to("loop.xml")
    with pytest.raises(ModelError, match=f"names '{name[:60]}', which (is no file|no file can be)"):
        read_model(written(tmp_path, ARMS, element.format(name)))
    (tmp_path / "parts" / "part.xml").write_text(f"<mujoco>{element.format(name.removeprefix('parts/'))}</mujoco>")
    with pytest.raises(ModelError, match=r"which (is no file|no file can be)"):
        read_model(written(tmp_path, ARMS, '<include file="parts/part.xml"/>'))


@pytest.mark.parametrize("part", ["", "parts"])
@pytest.mark.parametrize("name", ["pipe.stl", "loop.stl", "x" * 5000])
def test_pictures_that_are_no_files_are_not_opened(tmp_path: Path, name: str, part: str) -> None:
    """The folder of meshes of a file counts for what it takes in."""
    (tmp_path / part).mkdir(exist_ok=True)
    os.mkfifo(tmp_path / part / "pipe.stl")
    (tmp_path / part / "loop.stl").symlink_to("loop.stl")
    (tmp_path / "assets.xml").write_text(f'<mujoco><asset><mesh name="m" file="{name}"/></asset></mujoco>')
    imported = import_file(written(tmp_path, ARMS, f'<compiler meshdir="{part}"/><include file="assets.xml"/>'))
    assert any("are not drawn" in note for note in imported.notes)


def test_a_folder_above_the_file_may_be_named(tmp_path: Path) -> None:
    """Masses of meshes count, and their paths lead from there."""
    (tmp_path / "robot").mkdir()
    ends = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in ends)
    (tmp_path / "wedge.obj").write_text(corners + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces))
    body = '<body name="a"><joint name="j"/><geom type="mesh" mesh="m" density="600"/></body>'
    path = written(tmp_path / "robot", body, '<asset><mesh name="m" file="../wedge.obj"/></asset>')
    with pytest.raises(ModelError, match="outside the folder of the file"):
        import_file(path)
    imported = import_file(path, folder=tmp_path)
    assert 'mesh: wedge.obj' in imported.text
    assert [float(body.mass) for body in read_model_text(imported.text, "m.yaml", folder=tmp_path).bodies] == pytest.approx([100], rel=1e-6)


@pytest.mark.parametrize(
    ("limit", "start", "said"),
    [
        (1e-3, mjcf_process._START, "took longer than 0.001 s"), (60, "import os; os.abort()", "ends with SIGABRT"),
        (60, "1/0", "ends with status 1"),
    ],
)
def test_mujoco_may_take_long_or_crash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: float, start: str, said: str) -> None:
    monkeypatch.setattr(mjcf_process, "LIMIT", limit)
    monkeypatch.setattr(mjcf_process, "_START", start)
    with pytest.raises(ModelError, match=said):
        read_model(written(tmp_path, ARMS, ""))


@pytest.mark.parametrize("kind", ["connect", "weld"])
def test_a_free_body_moves_to_where_a_loop_closes(tmp_path: Path, kind: str) -> None:
    """Only where the joints do not reach; MuJoCo's sites meet in the coordinates that the import says."""
    place = '<site name="s" pos="-.1 .05 0" euler="20 -40 70"/>'
    free = f'<body name="b" pos=".8 0 .2" euler="10 20 30"><freejoint/><geom size=".1 .02 .03" type="box"/>{place}</body>'
    arm = hinged("a", "0 0 0", '<site name="t" pos=".3 0 0"/>')
    path = written(tmp_path, arm + free, f'<equality><{kind} site1="t" site2="s"/></equality>')
    imported = import_file(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    q, base = imported.zero["b_joint"], np.zeros(9)
    mujoco.mju_quat2Mat(base, model.qpos0[4:])
    data.qpos[0] = imported.zero["a_j"][0]
    data.qpos[1:4] = model.qpos0[1:4] + base.reshape(3, 3) @ q[:3]
    data.qpos[4:] = model.qpos0[4:]
    mujoco.mju_quatIntegrate(data.qpos[4:], q[3:], 1)
    mujoco.mj_forward(model, data)
    assert np.abs(data.site("s").xpos - data.site("t").xpos).max() < 1e-9
    assert kind == "connect" or np.abs(data.site("s").xmat - data.site("t").xmat).max() < 1e-9
    read = read_model_text(imported.text, "m.yaml")
    assert [float(x) for x in next(body for body in read.bodies if body.name == "b").centre_of_mass] == pytest.approx(data.body("b").xipos)
    assert [float(x) for x in next(joint for joint in read.joints if joint.kind == "free").at] == pytest.approx(data.body("b").xpos)


def test_coordinates_in_the_head_are_those_of_mujoco(tmp_path: Path) -> None:
    """With ``ref``: at the coordinates that the head of the file names the model stands where MuJoCo has it."""
    arms = hinged("a", "0 0 0", hinged("b", "1 0 0")).replace('"b_j"', '"b_j" ref="0.5"')
    imported = import_file(written(tmp_path, arms, radians := '<compiler angle="radian"/>'))
    assert "# Coordinates are zero where those of the file are: b_j 0.5." in imported.text
    couple = radians + '<equality><joint joint1="b_j" joint2="a_j" polycoef="0.02 0.3 0 0 0"/></equality>'
    path = written(tmp_path, arms, couple)
    imported = import_file(path)
    said = re.search(r"count from where they do: (a_j \S+, )?b_j (\S+?)\.?\n", imported.text)
    assert said
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:] = [imported.zero["a_j"][0], float(said[2])]
    mujoco.mj_forward(model, data)
    bodies = read_model_text(imported.text, "m.yaml").bodies
    assert [float(x) for x in bodies[1].centre_of_mass] == pytest.approx(data.xipos[2], abs=1e-8)
    assert data.qpos[1] - 0.5 == pytest.approx(0.02 + 0.3 * data.qpos[0])


def test_actuators_with_several_controls_and_delays_are_named(tmp_path: Path) -> None:
    """Motors behind them keep their own controls."""
    motors = (
        '<actuator><orientation name="aim" joint="ball" kp="3"/><motor name="late" joint="a_j" delay="0.01" nsample="10"/>'
        '<motor name="m" joint="a_j" gear="7" ctrllimited="true" ctrlrange="-2 3"/></actuator>'
    )
    ball = '<body name="c" pos="1 0 0"><joint name="ball" type="ball"/><geom size="0.1"/></body>'
    imported = import_file(written(tmp_path, hinged("a", "0 0 0", ball), motors))
    assert "the actuator aim is left out: it has several controls" in imported.notes
    assert "the actuator late is left out: it has a delay" in imported.notes
    assert 'law: "7*max(-2, min(3, m))"' in imported.text
