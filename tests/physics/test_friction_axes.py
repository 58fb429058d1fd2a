"""Friction by loads on rotations whose axes neither body carries: loads from the bodies' accelerations, with axes of the oracle's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model_text
from cutjoint.model.records import JointKind
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.topology.build import build_topology
from tests.formulate.test_implicit import verify_tangent
from tests.formulate.test_signals import WithStates
from tests.oracles.joints import _follower_from_base, rotation_about, tangents, vector_of

#: A carrier that turns and a body that hangs from it by a joint with friction on one of its angles.
CARRIED = """
cutjoint: 1
name: carried
gravity: [1, 2, -9.81]
points: {{A: [0.4, 0.1, 0], B: {B}, C: {C}}}
bodies:
  carrier: {{mass: 2, centre_of_mass: [0.2, 0, 0], inertia: [0.1, 0.2, 0.3]}}
  load: {{mass: 1.5, centre_of_mass: C, inertia: [0.02, 0.03, 0.04]}}
joints:
  pin: {{kind: revolute, bodies: [ground, carrier], at: [0, 0, 0], axis: [0.2, 1, 0.3]}}
  hang: {{kind: {kind}, bodies: {bodies}, {fields}}}
forces:
  rub: {{kind: joint_friction, joint: hang, coordinate: {coordinate}, coefficient: 0.3, radius: 0.02, preload: 1.2}}
outputs: [rub.load, load.ax, load.ay, load.az, load.yaw, load.pitch, load.roll, carrier.yaw, carrier.pitch, carrier.roll,
          hang.angle_1, hang.angle_2]
scenes:
  swing: {{end: 0.4, output_step: 0.02, rates: {{pin.angle_rate: 3, hang.angle_1_rate: -2, hang.angle_2_rate: 1.5}}}}
"""
ROD = {"kind": "distance", "B": "[0.7, 0.3, -0.4]", "C": "[0.75, 0.35, -0.5]"}
SHAFT = {"kind": "constant_velocity", "B": "[0.4, 0.1, 0]", "C": "[0.5, 0.2, -0.4]"}


def text(model: dict[str, str], coordinate: str, is_reversed: bool) -> str:
    ends = "[load, carrier]" if is_reversed else "[carrier, load]"
    fields = "at: A, axis: [0.3, 0.1, -1]" if model is SHAFT else "at: B, to: A" if is_reversed else "at: A, to: B"
    return CARRIED.format(**model, bodies=ends, fields=fields, coordinate=coordinate)


def swing(source: str, method: str, folder: Path) -> Trajectory:
    path = folder / "model.yaml"
    path.write_text(source, encoding="utf-8")
    model = read_model_text(source, str(path))
    integrator = {"recursive": "dormand-prince", "recursive-newton": "radau5"}[method]
    return simulate(compile_interpreted(model, model.scenes["swing"], method=method), integrator=integrator, tolerance=1e-8)


def attitude(run: Trajectory, body: str) -> np.ndarray:
    x, y, z = np.eye(3)
    yaw, pitch, roll = (run[f"{body}.{angle}"] for angle in ("yaw", "pitch", "roll"))
    return rotation_about(z, yaw) @ rotation_about(y, pitch) @ rotation_about(x, roll)


def reaction(run: Trajectory) -> np.ndarray:
    return 1.5 * (np.stack([run[f"load.a{x}"] for x in "xyz"], axis=-1) - [1, 2, -9.81])


def verify_load(run: Trajectory, axis: np.ndarray) -> None:
    force = reaction(run)
    across = force - np.einsum("...i,...i->...", force, axis)[:, np.newaxis] * axis
    assert np.ptp(run["rub.load"]) > 1
    assert run["rub.load"] == pytest.approx(1.2 + np.linalg.norm(across, axis=-1), rel=1e-9)


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
@pytest.mark.parametrize("is_reversed", [False, True], ids=["forwards", "backwards"])
@pytest.mark.parametrize("coordinate", ["angle_1", "angle_2"])
def test_friction_at_a_rod_has_the_force_across_its_axis(coordinate: str, is_reversed: bool, method: str, tmp_path: Path) -> None:
    run = swing(text(ROD, coordinate, is_reversed), method, tmp_path)
    first, second = tangents(np.array([0.3, 0.2, -0.4]))
    outer = attitude(run, "load")
    axis = outer @ second
    if coordinate == "angle_1":
        axis = (outer @ rotation_about(second, -run["hang.angle_2"])) @ first
    verify_load(run, axis)


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
@pytest.mark.parametrize("is_reversed", [False, True], ids=["forwards", "backwards"])
@pytest.mark.parametrize("coordinate", ["angle_1", "angle_2"])
def test_friction_of_a_bent_shaft_has_the_force_across_the_angular_velocity(
    coordinate: str, is_reversed: bool, method: str, tmp_path: Path
) -> None:
    run = swing(text(SHAFT, coordinate, is_reversed), method, tmp_path)
    angles = np.stack([run["hang.angle_1"], run["hang.angle_2"]], axis=-1).astype(complex)
    angles[:, ["angle_1", "angle_2"].index(coordinate)] += 1e-30j
    normal = np.array([0.3, 0.1, -1]) / np.linalg.norm([0.3, 0.1, -1])
    R, _ = _follower_from_base(JointKind.CONSTANT_VELOCITY, (normal, normal), 0.0, angles)
    spin = np.array([vector_of(each.imag @ each.real.T) for each in R])
    verify_load(
        run,
        np.einsum(
            "...ij,...j->...i", attitude(run, "load" if is_reversed else "carrier"), spin / np.linalg.norm(spin, axis=-1, keepdims=True)
        ),
    )


@pytest.mark.parametrize("model", [ROD, SHAFT], ids=["rod", "shaft"])
@pytest.mark.parametrize("coordinate", ["angle_1", "angle_2"])
def test_tangent_has_the_change_of_the_axis(model: dict[str, str], coordinate: str) -> None:
    read = read_model_text(text(model, coordinate, False), "model.yaml")
    start = formulate_recursive(build_topology(read), read.scenes["swing"], ())
    assert verify_tangent(WithStates(formulate_implicit(start, ()), {}), 0, moves=0.1) > 0


def test_tangent_has_the_change_of_a_load_by_a_slide_behind_a_ball() -> None:
    """A ball in a slot from the side of the slot's body: friction of the pin by loads that the ball's attitude changes."""
    slot = CARRIED.format(
        kind="point_on_line",
        bodies="[load, carrier]",
        fields="at: A, axis: [0.3, 0.1, -1]",
        coordinate="displacement",
        B="[0.4, 0.1, 0]",
        C="[0.5, 0.2, -0.4]",
    )
    slot = (
        slot.replace("radius: 0.02, ", "")
        .replace("hang.angle_1, hang.angle_2", "")
        .replace("hang.angle_1_rate: -2, hang.angle_2_rate: 1.5", "hang.displacement_rate: 0.5")
    )
    read = read_model_text(slot, "model.yaml")
    start = formulate_recursive(build_topology(read), read.scenes["swing"], ())
    assert verify_tangent(WithStates(formulate_implicit(start, ()), {}), 0, moves=0.1) > 0
