"""The library's suspensions, steering and anti-roll bar: poses beside rods and lines of constant length, equilibria beside closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.package.locations import library_folder
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.physics.simulation import compile_scene, completed

FRAME = """
cutjoint: 1
name: rig
gravity: [0, 0, {gravity}]
bodies:
  first: {{mass: 1, centre_of_mass: [1.22, 0.55, 0.21]}}
  second: {{mass: 1, centre_of_mass: [1.22, -0.55, 0.21]}}
joints:
  one: {{kind: prismatic, bodies: [ground, first], at: [1.22, 0.55, 0.21], axis: z}}
  two: {{kind: prismatic, bodies: [ground, second], at: [1.22, -0.55, 0.21], axis: z}}
submodels: {{part: {{include: library/{part}}}}}
instances: {{part: {{use: part, {with_}}}}}
forces: {{{forces}}}
outputs: [{outputs}]
scenes: {{run: {{output_step: 0.01, {scene}}}}}
"""
HOLDS = "h1: {kind: joint_force, joint: one, law: -10*position}, h2: {kind: joint_force, joint: two, law: -10*position}"


AT_REST = "end: 0.01, pose: equilibrium"


def rig(part: str, with_: str, outputs: str, forces: str = HOLDS, scene: str = AT_REST, gravity: float = 0) -> Trajectory:
    text = FRAME.format(part=part, with_=with_, forces=forces, outputs=outputs, scene=scene, gravity=gravity)
    model = read_model_text(text, "rig.yaml")
    artifact = compile_scene(model, model.scenes["run"], CompileOptions(method="recursive"))
    return completed(simulate(artifact, error=False))


def hardpoints(part: str, **at: float) -> dict[str, np.ndarray]:
    """The points of a submodel, by Python's arithmetic."""
    points = yaml.safe_load((library_folder() / f"{part}.yaml").read_text())["points"]
    return {name: np.array([eval(str(x), {}, dict(at)) for x in place], float) for name, place in points.items()}


def moved(run: Trajectory, body: str, centre: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Places of a point of a body, by what a run says of the body's pose: yaw, pitch and roll of axes that go along."""
    column = {name: run[f"part.{body}.{name}"] for name in ("x", "y", "z", "roll", "pitch", "yaw")}
    turns = Rotation.from_euler("ZYX", np.stack([column["yaw"], column["pitch"], column["roll"]], axis=1))
    return np.stack([column["x"], column["y"], column["z"]], axis=1) + turns.apply(point - centre)


CORNER = "connect: {chassis: ground, steering: ground}, with: {x: 1.2, y: 0.7, z: 0.3}"
POSE = ", ".join(f"part.carrier.{name}" for name in ("x", "y", "z", "roll", "pitch", "yaw"))


@pytest.mark.parametrize("part", ["macpherson", "five_link"])
def test_rods_keep_their_length(part: str) -> None:
    """A corner that rises 6 cm and more under its spring: ends of rods, and the strut's line, are where the carrier's pose says."""
    run = rig(part, CORNER, POSE, scene="end: 0.3", gravity=-9.81)
    at = hardpoints(part, x=1.2, y=0.7, z=0.3)
    assert np.ptp(run["part.carrier.z"]) > 0.05
    joints: dict[str, Any] = yaml.safe_load((library_folder() / f"{part}.yaml").read_text())["joints"]
    rods = [joint for joint in joints.values() if joint["kind"] == "distance"]
    assert len(rods) == {"macpherson": 1, "five_link": 5}[part]
    for rod in rods:
        end = moved(run, "carrier", at["hub"], at[rod["to"]])
        assert np.linalg.norm(end - at[rod["at"]], axis=1) == pytest.approx(np.linalg.norm(at[rod["to"]] - at[rod["at"]]), abs=1e-8)
    if part == "macpherson":
        foot, top = (moved(run, "carrier", at["hub"], at[name]) for name in ("foot", "top"))
        along, to_mount = top - foot, at["top"] - foot
        across = np.cross(along, to_mount) / np.linalg.norm(along, axis=1)[:, None]
        assert np.abs(across).max() < 1e-8
        ball = moved(run, "carrier", at["hub"], at["ball"])
        axis = at["arm_front"] - at["arm_rear"]
        for hinge in ("arm_front", "arm_rear"):
            assert np.linalg.norm(ball - at[hinge], axis=1) == pytest.approx(np.linalg.norm(at["ball"] - at[hinge]), abs=1e-8)
        assert (ball - at["ball"]) @ axis == pytest.approx(0, abs=1e-8)


@pytest.mark.parametrize(("part", "ends"), [("macpherson", ("top", "foot")), ("five_link", ("spring_top", "spring_foot"))])
def test_springs_carry_their_load_as_drawn(part: str, ends: tuple[str, str]) -> None:
    at = hardpoints(part, x=1.2, y=0.7, z=0.3)
    run = rig(part, CORNER, "part.spring.length, part.spring.force", scene="end: 0.02")
    assert run["part.spring.length"][0] == pytest.approx(np.linalg.norm(at[ends[0]] - at[ends[1]]), rel=1e-12)
    assert run["part.spring.force"][0] == pytest.approx(-3500)


AXLE = "connect: {chassis: ground}, with: {x: -1.2, y: 0.7, z: 0.3%s}"


def test_a_solid_axle_hangs_and_rolls_by_its_leaves() -> None:
    """By (load + m g/2)/k it hangs, a moment M turns it by M/(2 k 0.45^2)."""
    push = f"{HOLDS}, twist: {{kind: load, body: part.axle, torque: [20, 0, 0]}}"
    run = rig("solid_axle", AXLE % "", "part.axle.z, part.axle.roll, part.axle.x, part.axle.y", push, gravity=-9.81)
    assert run["part.axle.z"][0] == pytest.approx(0.3 - (3500 + 90 * 9.81 / 2) / 28000, abs=1e-5)
    assert run["part.axle.roll"][0] == pytest.approx(20 / (2 * 28000 * 0.45**2), rel=1e-3)
    assert run["part.axle.x"][0] == pytest.approx(-1.2, abs=1e-9)


def test_a_twist_beam_twists() -> None:
    """Without springs, moments of 12 N m against each other twist it by 12/6000 rad: one arm by half of that."""
    left, right = (f"{side}: {{kind: joint_force, joint: part.{side}_hinge, law: {law}}}" for side, law in (("left", 12), ("right", -12)))
    forces = f"{HOLDS}, {left}, {right}"
    soft = ", stiffness: 1e-4, load: 0"
    run = rig("twist_beam", AXLE % soft, "part.left_hinge.angle, part.right_hinge.angle", forces)
    assert run["part.left_hinge.angle"][0] - run["part.right_hinge.angle"][0] == pytest.approx(12 / 6000, rel=1e-6)


def pushes(first: float, second: float) -> str:
    """Forces, N, on what the bar's links hold."""
    laws = (("u", "one", first), ("d", "two", second))
    return ", ".join(f"{name}: {{kind: joint_force, joint: {joint}, law: {law}}}" for name, joint, law in laws) + f", {HOLDS}"


def test_an_anti_roll_bar_holds_what_moves_apart() -> None:
    """Arms of 0.22 m: forces P up and down at the links move these by P r^2/(2 k) each; both up, nothing holds them."""
    connect = "connect: {chassis: ground, left: first, right: second}"
    apart, both = (
        rig("anti_roll_bar", connect, "one.displacement, two.displacement", pushes(*forces)) for forces in ((100, -100), (0.1, 0.1))
    )
    by = 100 / (2 * 800 / 0.22**2 + 10)
    assert (apart["one.displacement"][0] - apart["two.displacement"][0]) / 2 == pytest.approx(by, rel=1e-3)
    assert both["one.displacement"][0] == pytest.approx(0.01, rel=1e-6)


def test_a_rack_goes_where_the_steering_wheel_says() -> None:
    run = rig("rack_steering", "connect: {chassis: ground}, with: {angle: 0.5}", "part.slide.displacement")
    assert run["part.slide.displacement"][0] == pytest.approx(-0.004, rel=1e-9)
