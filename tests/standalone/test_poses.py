"""Poses of bodies and markers, of folders, of simulations in Python and of FMUs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import cutjoint
from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.scenes import find_scene
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.hung import HUNG

from .c_exports import compile_object, link, run, write

pytestmark = needs_cpp

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("poses") / "hung.yaml"
    path.write_text(HUNG)
    return path


def turned(roll: float, pitch: float, yaw: float) -> Array:
    """The rotation by roll about x, then pitch about y, then yaw about z."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    about_z, about_y = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]), np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.asarray(about_z @ about_y @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]]))


def rotation_of(quaternion: Array) -> Array:
    """v -> v + 2 w (u x v) + 2 u x (u x v), as a matrix."""
    w, u = quaternion[0], quaternion[1:]
    cross = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross)


@pytest.mark.parametrize("method", with_heavy(["recursive", "recursive-newton"], "recursive-newton"))
def test_poses_are_the_outputs_of_the_same_elements(path: Path, method: str) -> None:
    sim = cutjoint.load(path, method=method, poses=True).reset()
    for t in (0.0, 0.3, 0.9):
        sim.advance(t)
        out, poses = sim.outputs, sim.poses
        assert poses.names == ("carriage", "top", "bar", "tip")
        for i, name in enumerate(poses.names):
            assert np.array_equal(poses.position[i], [out[f"{name}.{a}"] for a in "xyz"])
            assert np.array_equal(poses.velocity[i], [out[f"{name}.v{a}"] for a in "xyz"])
            body = "bar" if name == "tip" else name
            assert np.array_equal(poses.angular_velocity[i], [out[f"{body}.w{a}"] for a in "xyz"])
            R = turned(*(out[f"{body}.{angle}"] for angle in ("roll", "pitch", "yaw")))
            assert poses.attitude[i] @ poses.attitude[i] == pytest.approx(1, abs=1e-14)
            assert poses.attitude[i, 0] >= 0
            assert rotation_of(poses.attitude[i]) == pytest.approx(R, abs=1e-14)
        # points of the design position go along: the tip with the bar, the pin with the bar and the top
        top, bar, tip = (poses.place(name) for name in ("top", "bar", "tip"))
        moved = [poses.position[i] + rotation_of(poses.attitude[i]) @ (p - poses.point[i]) for i, p in
                 ((bar, poses.point[tip]), (bar, np.array([0.1, 0, -0.5])), (top, np.array([0.1, 0, -0.5])))]  # fmt: skip
        assert moved[0] == pytest.approx(poses.position[tip], abs=1e-14)
        assert moved[1] == pytest.approx(moved[2], abs=1e-14)
    assert poses.point[bar] == pytest.approx([0.4, 0, -0.5])


def test_velocities_are_differences_of_poses(path: Path) -> None:
    sim = cutjoint.load(path, poses=True).reset(tolerance=1e-12)
    h, found = 1e-4, []
    for t in (0.5 - h, 0.5, 0.5 + h):
        sim.advance(t)
        found.append(sim.poses.array.copy())
    before, now, after = found
    assert (after[:, :3] - before[:, :3]) / (2 * h) == pytest.approx(now[:, 7:10], abs=1e-6)  # h^2 / 6 of some 100 m/s^3
    for i in range(len(now)):
        change = (rotation_of(after[i, 3:7]) - rotation_of(before[i, 3:7])) / (2 * h) @ rotation_of(now[i, 3:7]).T  # w x
        assert [change[2, 1], change[0, 2], change[1, 0]] == pytest.approx(now[i, 10:13], abs=1e-6)


def test_arrays_are_views_and_asking_changes_no_step(path: Path) -> None:
    plain, asked = (cutjoint.load(path, poses=poses).reset(dt=0.01) for poses in (False, True))
    held = asked.poses.position
    for _ in range(50):
        plain.step()
        asked.step()
        _ = asked.poses
    assert np.array_equal(plain.coordinates.array, asked.coordinates.array)
    assert np.array_equal(plain.speeds.array, asked.speeds.array)
    assert np.array_equal(held, asked.poses.position)
    assert held[1] == pytest.approx([asked.outputs[f"top.{a}"] for a in "xyz"], abs=0)
    with pytest.raises(ValueError, match="read-only"):
        held[0, 0] = 1
    with pytest.raises(KeyError, match="did you mean 'top'"):
        asked.poses.place("topp")
    with pytest.raises(TypeError, match="poses=True"):
        _ = plain.poses


#: A carrier that tumbles with a tyre, which does not turn, and with a wheel on a hub, over ground that a host gives.
WHEELS = """
cutjoint: 1
name: wheels
gravity: [0, 0, -9.81]
bodies:
  carrier: {mass: 50, centre_of_mass: [0.4, 0, 0.4], inertia: [5, 4, 3]}
  rim: {mass: 20, centre_of_mass: [0, 0.1, 0.3], inertia: [0.5, 1, 0.5]}
joints:
  free: {kind: free, bodies: [ground, carrier], at: [0, 0, 0.3]}
  hub: {kind: revolute, bodies: [carrier, rim], at: [0, 0.1, 0.3], axis: [0, 1, 0]}
forces:
  wheel: {kind: wheel, body: rim, centre: [0, 0.15, 0.3], axis: [0, 1, 0], radius: 0.3, force: [-100*vx, 0, 2e4*deflection]}
  tyre: {kind: tyre, body: carrier, centre: [1, 0.1, 0.3], axis: [0, 1, 0], radius: 0.3, stiffness: 2e4,
         calspan: {A0: 4000, A1: 10, A2: 6000, A3: 1.7, A4: 4000, B1: -0.00008, B3: 1, B4: 0, SN: 0.85, AF1: 0, AF2: 0}}
markers: {nose: {body: carrier, at: [1.2, 0, 0.5]}}
outputs: [wheel.vx, wheel.vy, wheel.spin, wheel.loaded_radius]
scenes: {roll: {rates: {free.vx: 3, free.wz: 2, free.wx: 1.5, hub.angle_rate: 12}, end: 1}}
"""


def test_contacts_are_where_planes_of_wheels_meet_the_ground(tmp_path: Path) -> None:
    """By three planes: the ground under the centre, the wheel's own, and the one across the rolling direction."""
    (tmp_path / "wheels.yaml").write_text(WHEELS)
    sim = cutjoint.load(tmp_path / "wheels.yaml", poses=True, linearise=True, terrain=["*"]).reset()
    ground = {"wheel": (0.02, 0.1, -0.2), "tyre": (-0.01, -0.05, 0.15)}
    for name, values in ground.items():
        for end, value in zip(("height", "slope", "bank"), values, strict=True):
            sim.inputs[f"{name}.terrain_{end}"] = value
    sim.advance(0.2)
    poses = sim.poses
    assert poses.names == ("carrier", "rim", "nose", "wheel", "tyre")
    for name, body, centre in (("wheel", "rim", (0, 0.15, 0.3)), ("tyre", "carrier", (1, 0.1, 0.3))):
        (at, on), (height, slope, bank) = (poses.place(each) for each in (name, body)), ground[name]
        R = rotation_of(poses.attitude[on])
        axis, c = R[:, 1], poses.position[on] + R @ (np.array(centre) - poses.point[on])
        normal = np.array([-slope, -bank, 1]) / np.sqrt(1 + slope**2 + bank**2)
        rolling = np.cross(axis, normal) / np.linalg.norm(np.cross(axis, normal))
        assert abs(axis @ normal) > 0.02
        assert rotation_of(poses.attitude[at]) == pytest.approx(np.column_stack([rolling, np.cross(normal, rolling), normal]), abs=1e-14)
        below = np.array([c[0], c[1], height])
        p = np.linalg.solve(np.array([normal, axis, rolling]), [normal @ below, axis @ c, rolling @ c])
        assert poses.position[at] == pytest.approx(p, abs=1e-13)
        v = poses.velocity[on] + np.cross(poses.angular_velocity[on], p - poses.position[on])
        assert poses.velocity[at] == pytest.approx(v, abs=1e-12)
        assert np.array_equal(poses.angular_velocity[at], poses.angular_velocity[on])
        assert poses.point[at].tolist() == [0, 0, 0]
        rates = sim.states.array[len(sim.states.array) // 2 :]
        assert sim.point_jacobian(name) @ rates == pytest.approx([*v, *poses.angular_velocity[at]], abs=1e-11)
        if name == "wheel":
            out = sim.outputs
            assert np.linalg.norm(p - c) == pytest.approx(out["wheel.loaded_radius"], abs=1e-13)
            slip = out["wheel.vx"] - out["wheel.spin"] * out["wheel.loaded_radius"]
            assert rotation_of(poses.attitude[at]).T[:2] @ v == pytest.approx([slip, out["wheel.vy"]], abs=1e-12)


PROGRAM = """
#include <math.h>
#include <stdio.h>
#include "hung.h"
static double memory[HUNG_SIZE / sizeof(double)];
int main(void) {
  hung_sim* sim = hung_create(memory, sizeof memory);
  const int top = hung_find_pose("top");
  int i;
  if (hung_pose_name(HUNG_POSES) != NULL || hung_find_pose("ground") != -1) return 1;
  for (i = 0; i < HUNG_POSES; ++i) {
    const hung_pose* pose = hung_poses(sim) + i; /* before a start, in the design position */
    int k;
    if (!(fabs(pose->attitude[0] - 1) < 1e-14)) return 5;
    for (k = 0; k < 3; ++k)
      if (!(fabs(pose->position[k] - pose->point[k]) < 1e-14)) return 6;
  }
  if (hung_start(sim) != HUNG_OK) return 2;
  for (i = 0; i < 40; ++i) {
    const hung_pose* pose = hung_poses(sim) + top;
    const double* q = hung_coordinates(sim); /* the ball's quaternion is that of the top, whose carrier does not turn */
    const double sign = q[0] < 0 ? -1 : 1;
    int k;
    for (k = 0; k < 4; ++k)
      if (!(fabs(pose->attitude[k] - sign * q[k]) < 1e-13)) return 3;
    printf("%.17g %.17g\\n", pose->attitude[0], pose->position[2]);
    if (hung_advance(sim, 0.1 * (i + 1)) != HUNG_OK) return 4;
  }
  return 0;
}
"""


def test_a_program_in_c_has_them(tmp_path: Path) -> None:
    model = read_model_text(HUNG, "hung.yaml")
    scene = find_scene(model, None)
    write(make_standalone(generate(model, scene, scene.outputs, poses=True), integrator="dormand-prince"), tmp_path)
    (tmp_path / "draw.c").write_text(PROGRAM)
    compile_object(tmp_path, "hung")
    parts = np.array([line.split() for line in run(link(tmp_path, "draw", ["draw.c", "hung.o"])).splitlines()], dtype=float)
    assert len(parts) == 40
    assert (parts[:, 0] < 0.5).any()  # both ways to the quaternion
    assert (parts[:, 0] > 0.9).any()


def test_who_does_not_ask_has_the_same_code() -> None:
    model = read_model_text(HUNG, "hung.yaml")
    scene = find_scene(model, None)
    plain, posed = (make_standalone(generate(model, scene, scene.outputs, poses=poses)) for poses in (False, True))
    assert not [name for name, text in plain.files.items() if "hung_pose" in text]
    same = [name for name in plain.library.files if name in posed.library.files and plain.library.files[name] == posed.library.files[name]]
    assert {"evaluate.cpp", "constraint_residual.cpp", "report.cpp", "scene_inputs.cpp"} <= set(same)
    assert "poses.cpp" in set(posed.library.files) - set(plain.library.files)


def test_natural_coordinates_have_none(path: Path) -> None:
    with pytest.raises(RunError, match=r"poses: the state of method 'augmented' has natural coordinates.*use recursive"):
        cutjoint.load(path, method="augmented", poses=True)
    with pytest.raises(RunError, match="poses: only C exports have them"):
        cutjoint.compile_model(path, poses=True)
