"""Constructs of public MJCF files: loops between classes, drives on tendons, friction, polynomials, damped bases; by MuJoCo's
own terms with loops and relations that are rigid."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.importing.document import Imported, import_file
from cutjoint.model.errors import ModelError
from cutjoint.tasks.batch import simulate
from cutjoint.topology.reading import read_model_text
from tests.conftest import needs_cpp
from tests.importing.test_mjcf import rotation

mujoco = pytest.importorskip("mujoco")

#: A finger of four bars whose driver follows that of the other side, both pulled by one actuator; its pictures are not there.
GRIPPER = """
<mujoco model="gripper">
  <compiler angle="radian" meshdir="assets" autolimits="true"/>
  <asset>
    <texture name="skin" type="2d" file="skin.png"/>
    <material name="black" texture="skin"/>
    <mesh class="grip" file="driver.stl"/>
  </asset>
  <default>
    <default class="grip">
      <mesh scale="0.001 0.001 0.001"/>
      <general biastype="affine"/>
      <joint axis="1 0 0"/>
      <default class="driver"><joint range="0 0.8" armature="0.005" damping="0.1"/></default>
      <default class="spring"><joint stiffness="0.5" springref="2.62" damping="0.00125"/></default>
      <default class="visual"><geom type="mesh" contype="0" conaffinity="0" group="2"/></default>
    </default>
  </default>
  <worldbody>
    <body name="base" childclass="grip">
      <inertial mass="0.7" pos="0 0 0.03" diaginertia="2e-4 2e-4 1e-4"/>
      <geom class="visual" mesh="driver" material="black"/>
      <body name="driver" pos="0 0.0306 0.0549">
        <inertial mass="0.09" pos="0 0.0177 0.001" diaginertia="1.7e-05 1.6e-05 3.2e-06"/>
        <joint name="driver_joint" class="driver"/>
        <body name="coupler" pos="0 0.0315 -0.0041">
          <inertial mass="0.14" pos="0 0.003 0.0232" diaginertia="4.1e-05 3.5e-05 8.8e-06"/>
          <joint name="coupler_joint"/>
        </body>
      </body>
      <body name="spring_link" pos="0 0.0132 0.0609">
        <inertial mass="0.22" pos="0 0.018 0.021" diaginertia="8.9e-05 6.7e-05 2.6e-05"/>
        <joint name="spring_link_joint" class="spring"/>
        <body name="follower" pos="0 0.055 0.0375">
          <inertial mass="0.125" pos="0 -0.011 0.0124" diaginertia="2.6e-05 2.4e-05 6e-06"/>
          <joint name="follower_joint" pos="0 -0.018 0.0065"/>
          <body name="pad"><geom class="visual" mesh="driver" mass="0"/></body>
        </body>
      </body>
      <body name="other" pos="0 -0.0306 0.0549" quat="0 0 0 1">
        <inertial mass="0.09" pos="0 0.0177 0.001" diaginertia="1.7e-05 1.6e-05 3.2e-06"/>
        <joint name="other_joint" class="driver"/>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="base" body2="driver"/></contact>
  <tendon><fixed name="split"><joint joint="driver_joint" coef="0.7"/><joint joint="other_joint" coef="0.3"/></fixed></tendon>
  <equality>
    <connect anchor="0 0 0" body1="follower" body2="coupler" solref="0.005 1"/>
    <joint joint1="driver_joint" joint2="other_joint" polycoef="0 1 0 0 0"/>
  </equality>
  <actuator>
    <general class="grip" name="fingers" tendon="split" gear="1.5" forcerange="-5 5" ctrlrange="0 255" gainprm="0.3 0 0"
             biasprm="0 -2 -0.1"/>
  </actuator>
</mujoco>
"""

#: A closed leg whose knees have zeros of their own, held by pairs of sites on a line.
LEG = """
<mujoco model="leg">
  <compiler autolimits="true"/>
  <default><joint axis="0 1 0"/><geom type="capsule" size="0.01" density="2000" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="left" pos="-0.1 0 0">
      <joint name="left" range="-90 90" damping="0.01"/>
      <geom fromto="0 0 0 -0.1 0 -0.15"/>
      <body name="left_rod" pos="-0.1 0 -0.15">
        <joint name="left_knee" ref="-45" stiffness="2" springref="-30"/>
        <geom fromto="0 0 0 0.2 0 -0.25"/>
        <site name="a1" pos="0.2 0 -0.25"/><site name="a2" pos="0.2 0.1 -0.25"/>
      </body>
    </body>
    <body name="right" pos="0.1 0 0">
      <joint name="right"/>
      <geom fromto="0 0 0 0.1 0 -0.15"/>
      <body name="right_rod" pos="0.1 0 -0.15">
        <joint name="right_knee" ref="58"/>
        <geom fromto="0 0 0 -0.2 0 -0.25"/>
        <site name="b1" pos="-0.2 0 -0.25"/><site name="b2" pos="-0.2 0.1 -0.25"/>
      </body>
    </body>
    <body name="cam" pos="0.5 0 0"><joint name="cam"/><geom fromto="0 0 0 0 0 -0.1"/></body>
    <body name="rider" pos="0.7 0 0"><joint name="rider" type="slide" axis="0 0 1" armature="0.1"/><geom fromto="0 0 0 0 0 -0.1"/></body>
    <body name="wheel" pos="0.9 0 0"><joint name="wheel"/><geom fromto="0 0 0 0 0 -0.1"/></body>
  </worldbody>
  <tendon>
    <fixed name="t1"><joint joint="right" coef="1"/><joint joint="wheel" coef="-2"/></fixed>
    <fixed name="t2"><joint joint="cam" coef="3"/></fixed>
  </tendon>
  <equality>
    <connect site1="a1" site2="b1"/><connect site1="a2" site2="b2"/>
    <joint joint1="rider" joint2="cam" polycoef="0 0.02 0.05 -0.03 0.01"/>
    <tendon tendon1="t1" tendon2="t2" polycoef="0 0.5 0 0 0"/>
  </equality>
  <actuator>
    <position name="servo" joint="left" kp="3" kv="0.2" ctrlrange="-1 1"/>
    <velocity name="spin" joint="wheel" kv="0.1" gear="2"/>
  </actuator>
</mujoco>
"""

#: A base that moves freely through something that resists, with a damped ball on it.
BASE = """
<mujoco model="base">
  <worldbody>
    <body name="base" pos="0 0 1" euler="10 20 30">
      <joint name="root" type="free" damping="0.7"/>
      <geom type="box" size="0.1 0.2 0.05" pos="0.05 0 0.1"/>
      <body name="tip" pos="0 0 0.3">
        <joint name="ball" type="ball" damping="0.4"/><geom type="ellipsoid" size="0.05 0.1 0.2" pos="0.02 0 0.2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


#: Parts of the gripper that name its pictures.
PICTURES = (
    '<texture name="skin" type="2d" file="skin.png"/>', ' texture="skin"', '<mesh class="grip" file="driver.stl"/>',
    '<geom class="visual" mesh="driver" material="black"/>', '<geom class="visual" mesh="driver" mass="0"/>',
)  # fmt: skip


def rigid(model: Any, data: Any) -> np.ndarray:
    """Accelerations (nv) by the terms of MuJoCo, whose equalities hold wholly."""

    def rows(qpos: np.ndarray) -> np.ndarray:
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        of_equality = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        dense = np.zeros((data.nefc, model.nv))
        if mujoco.mj_isSparse(model):
            for i in range(data.nefc):
                at = slice(data.efc_J_rowadr[i], data.efc_J_rowadr[i] + data.efc_J_rownnz[i])
                dense[i, data.efc_J_colind[at]] = data.efc_J[at]
        else:
            dense = data.efc_J.reshape(data.nefc, model.nv)
        return dense[of_equality].copy()

    start, v, h, bent = data.qpos.copy(), data.qvel.copy(), 2e-5, np.zeros(1)
    for steps, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):  # of fourth order
        moved = start.copy()
        mujoco.mj_integratePos(model, moved, v, steps * h)
        bent = bent + weight * (rows(moved) @ v) / (12 * h)
    J = rows(start)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    force = data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias
    free = np.linalg.solve(mass, force)
    S = J @ np.linalg.solve(mass, J.T)
    return free - np.linalg.solve(mass, J.T @ (np.linalg.pinv(S, rcond=1e-10) @ (J @ free + bent)))


def compare(folder: Path, text: str, scene: str, rows: int = 5) -> Imported:
    """Compare accelerations of all bodies at states of a run."""
    path = folder / "model.xml"
    path.write_text(text)
    imported = import_file(path)
    for picture in PICTURES:
        text = text.replace(picture, "")
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    hinges = {mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j): j for j in range(model.njnt) if model.jnt_type[j] in (2, 3)}
    coordinate = {name: f"{imported.joints[name]}.{'angle' if model.jnt_type[j] == 3 else 'displacement'}" for name, j in hinges.items()}
    columns = [f"{x}{end}" for x in coordinate.values() for end in ("", "_rate")]
    quantities = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "wx", "wy", "wz", "roll", "pitch", "yaw")
    columns += [f"{body}.{q}" for body in imported.bodies.values() for q in quantities]
    text = imported.text[: imported.text.index("outputs:" if "outputs:" in imported.text else "scenes:")]
    read = read_model_text(f"{text}outputs: [{', '.join(columns)}]\nscenes:\n  motion: {scene}\n", "model.yaml")
    run = simulate(compile_interpreted(read, read.scenes["motion"]), accuracy=1e-10, check=False)
    mujoco.mj_forward(model, data)
    design = {body: data.body(body).xmat.reshape(3, 3).copy() for body in imported.bodies}
    for row in np.linspace(0, len(run["t"]) - 1, rows).astype(int):
        at = {name: run[name][row] for name in run}
        turned = {b: rotation(*[at[f"{b}.{a}"] for a in ("roll", "pitch", "yaw")]) @ design[b] for b in imported.bodies}
        spins = {b: np.array([at[f"{b}.w{c}"] for c in "xyz"]) for b in imported.bodies}
        for name, j in hinges.items():
            address, zero = model.jnt_qposadr[j], float(imported.zero[name][0])
            data.qpos[address] = model.qpos0[address] + zero + at[coordinate[name]]
            data.qvel[model.jnt_dofadr[j]] = at[f"{coordinate[name]}_rate"]
        if "ball" in imported.joints:
            local = model.body_ipos[1]
            centre = np.array([at[f"base.{c}"] for c in "xyz"])
            data.qpos[:3] = centre - turned["base"] @ local
            data.qvel[:3] = np.array([at[f"base.v{c}"] for c in "xyz"]) - np.cross(spins["base"], turned["base"] @ local)
            mujoco.mju_mat2Quat(data.qpos[3:7], turned["base"].ravel())
            data.qvel[3:6] = turned["base"].T @ spins["base"]
            mujoco.mju_mat2Quat(data.qpos[7:], (turned["base"].T @ turned["tip"]).ravel())
            data.qvel[6:] = turned["tip"].T @ (spins["tip"] - spins["base"])
        for name, value in read.scenes["motion"].inputs.items():
            data.ctrl[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name)] = float(value)
        data.qacc[:] = rigid(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        for name, body in imported.bodies.items():
            twist = np.zeros(6)
            mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_BODY, data.body(name).id, twist, 0)
            expected = twist[3:] + model.opt.gravity
            found = np.array([at[f"{body}.a{c}"] for c in "xyz"])
            assert np.abs(found - expected).max() < 1e-9 * (1 + np.abs(expected).max()), (row, name, found, expected)
    return imported


@needs_cpp
def test_a_drive_on_a_tendon_pulls_all_joints(tmp_path: Path) -> None:
    imported = compare(tmp_path, GRIPPER, "{end: 0.05, output_step: 0.01, inputs: {fingers: 9}}")
    assert "not there, or not below the folder of the file, are not drawn: driver.stl, skin.png" in "; ".join(imported.notes).lower()


@needs_cpp
def test_polynomials_tendons_and_servos(tmp_path: Path) -> None:
    compare(tmp_path, LEG, "{end: 0.05, output_step: 0.01, rates: {cam_joint.angle_rate: 2}, inputs: {servo: 0.2, spin: 0.3}}")


@needs_cpp
def test_a_base_and_a_ball_are_damped(tmp_path: Path) -> None:
    compare(tmp_path, BASE, "{end: 0.2, output_step: 0.05, rates: {root.vx: 1, root.wy: 2, ball.wx: 1, ball.wz: 3}}")


def test_masses_of_meshes_that_are_not_there_are_missed(tmp_path: Path) -> None:
    """All at once; what is fixed to the world needs no mass."""
    path = tmp_path / "model.xml"
    plate = '<body name="base" childclass="grip"><body name="plate"><geom class="visual" mesh="driver"/></body>'
    text = GRIPPER.replace(' mass="0"/></body>', "/></body>").replace('<body name="base" childclass="grip">', plate)
    lid = '<body name="lid"><geom class="visual" mesh="driver"/></body>'
    path.write_text(text.replace('<joint name="coupler_joint"/>', f'<joint name="coupler_joint"/>{lid}'))
    with pytest.raises(ModelError) as caught:
        import_file(path)
    assert [(problem.element, problem.message) for problem in caught.value.problems] == [
        (f"body '{name}'", "has the mass of 'driver.stl', which is not there") for name in ("lid", "pad")
    ]
    assert path.read_text().splitlines()[caught.value.problems[0].span.line - 1].startswith("          <joint name=\"coupler_joint\"/>")


OUTSIDE = [("", "../driver.stl"), ("parts", "../../driver.stl"), ("..", "driver.stl"), ("", "{outer}/driver.stl")]


@pytest.mark.parametrize(("folder", "name"), OUTSIDE)
def test_pictures_outside_the_folder_are_not_read(tmp_path: Path, folder: str, name: str) -> None:
    """A mesh that MuJoCo could not read, and the side of a texture."""
    path = tmp_path / "inside" / "model.xml"
    (path.parent / "parts").mkdir(parents=True)
    (tmp_path / "driver.stl").write_text("no mesh")
    file = name.format(outer=tmp_path)
    text = GRIPPER.replace('meshdir="assets"', f'meshdir="{folder}" texturedir="{folder}"').replace("driver.stl", file)
    path.write_text(text.replace('type="2d" file="skin.png"', f'type="cube" fileright="{file}"'))
    assert f"or not below the folder of the file, are not drawn: {file}" in "; ".join(import_file(path).notes)
    path.write_text(path.read_text().replace(' mass="0"/></body>', "/></body>"))
    with pytest.raises(ModelError, match=r"body 'pad': has the mass of '.*driver\.stl', which is outside the folder of the file"):
        import_file(path)


def test_what_mujoco_refuses_has_its_line(tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    path.write_text(GRIPPER.replace('<joint name="coupler_joint"/>', '<joint name="coupler_joint" kind="x"/>'))
    with pytest.raises(ModelError, match=r"joint 'coupler_joint': is refused by MuJoCo: .*unrecognized attribute: 'kind'") as caught:
        import_file(path)
    assert 'kind="x"' in path.read_text().splitlines()[caught.value.problems[0].span.line - 1]


@needs_cpp
def test_armatures_of_free_joints(tmp_path: Path) -> None:
    """Accelerations and motion as MuJoCo's, which adds them to the mass matrix alone, so that they weigh nothing."""
    text = BASE.replace('damping="0.7"', 'damping="0.7" armature="0.6"')
    imported = compare(tmp_path, text, "{end: 0.2, output_step: 0.05, rates: {root.vx: 1, root.wy: 2, ball.wx: 1, ball.wz: 3}}")
    assert "base_armature_lift" in imported.text


@needs_cpp
def test_a_ball_with_armature_and_friction_on_the_ground(tmp_path: Path) -> None:
    """Without gravity and about the heaviest axis: (I + A) w' = -f."""
    ball = '<joint name="b" type="ball" armature="0.3" frictionloss="0.2"/>'
    body = f'<body name="a">{ball}<inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.2"/></body>'
    path = tmp_path / "m.xml"
    path.write_text(f'<mujoco><option gravity="0 0 0"/><worldbody>{body}</worldbody></mujoco>')
    text = import_file(path).text
    scene = "outputs: [a.wz]\nscenes:\n  motion: {end: 2, output_step: 0.1, rates: {b.wz: 1.0}}\n"
    read = read_model_text(text[: text.index("scenes:")] + scene, "m.yaml")
    run = simulate(compile_interpreted(read, read.scenes["motion"]), accuracy=1e-8)
    speed = np.array(run["a.wz"])
    # sqrt(w^2 + s^2) falls by 0.4 rad/s2, but for the speed below which friction is smooth
    root = np.sqrt(speed**2 + 1e-4)
    assert root - 0.01 * np.arcsinh(0.01 / speed) == pytest.approx(
        root[0] - 0.01 * np.arcsinh(0.01 / speed[0]) - 0.4 * np.array(run["t"]), abs=1e-6
    )


def test_joints_that_are_held_still_and_points_on_no_line(tmp_path: Path) -> None:
    """A hinge that an equality holds is fixed where MuJoCo holds it; three points of two bodies weld them."""
    arm = '<body name="{0}" pos="{1}"><joint name="{0}_j" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0"/>{2}</body>'
    places = {"s": ((0.1, 0, 0), (0.4, 0.1, 0), (0.1, 0.2, 0.3))}
    turn, shift = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]), np.array([1, 2, 0.5])
    sites = "".join(f'<site name="s{i}" pos="{x} {y} {z}"/>' for i, (x, y, z) in enumerate(places["s"]))
    others = "".join(
        f'<site name="o{i}" pos="{" ".join(map(repr, map(float, turn.T @ (np.array(p) - shift))))}"/>' for i, p in enumerate(places["s"])
    )
    free = f'<body name="f" pos="1 2 0.5" euler="0 0 90"><freejoint/><geom size="0.1"/>{others}</body>'
    ties = "".join(f'<connect site1="s{i}" site2="o{i}"/>' for i in range(3))
    held = '<joint joint1="b_j" polycoef="0.25 0 0 0 0"/>'
    path = tmp_path / "m.xml"
    path.write_text(f"<mujoco><worldbody>{arm.format('a', '0 0 0', sites)}{arm.format('b', '0 0 2', '')}{free}</worldbody>"
                    f"<equality>{ties}{held}</equality></mujoco>")  # fmt: skip
    imported = import_file(path)
    joints = {joint.name: joint for joint in read_model_text(imported.text, "m.yaml").joints}
    assert "b_j is fixed, since the equality equality_4 holds it still" in imported.notes
    assert [joint.kind for joint in joints.values()].count("fixed") == 2
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[1] = 0.25
    mujoco.mj_forward(model, data)
    bodies = {body.name: body for body in read_model_text(imported.text, "m.yaml").bodies}
    assert [float(x) for x in bodies["b"].centre_of_mass] == pytest.approx(data.body("b").xipos)
    assert not any(q.any() for q in imported.zero.values())


TENDONS = """
<mujoco><compiler angle="radian"/><worldbody>
<site name="wall" pos="0.1 0.2 1.5"/>
<body name="a" pos="0 0 1"><joint name="a_j" axis="0 1 0" ref="0.3"/><geom type="box" size="0.1 0.02 0.03" pos="0.15 0 0"/>
<body name="b" pos="0.3 0 0"><joint name="b_j" axis="0 1 1"/><geom type="box" size="0.1 0.02 0.03" pos="0.15 0 0"/>
<site name="tip" pos="0.3 0 0.05"/></body></body></worldbody>
<tendon><fixed name="belt" stiffness="7" damping="0.4" springlength="0.6"><joint joint="a_j" coef="2"/>
<joint joint="b_j" coef="-1"/></fixed>
<spatial name="cord" stiffness="30" damping="2" springlength="0.5"><site site="wall"/><site site="tip"/></spatial></tendon></mujoco>
"""


@needs_cpp
def test_springs_along_tendons(tmp_path: Path) -> None:
    imported = compare(tmp_path, TENDONS, "{end: 0.2, output_step: 0.05, rates: {a_j.angle_rate: 1, b_j.angle_rate: 2}}")
    assert "belt_pull" in imported.text
    assert "kind: point_spring" in imported.text
    assert "parameters" not in imported.text
    model = tmp_path / "slack.xml"
    model.write_text(TENDONS.replace('springlength="0.5"', 'springlength="0.4 0.5"'))
    with pytest.raises(ModelError, match="spatial 'cord': is a tendon with friction, armature, slack"):
        import_file(model)
