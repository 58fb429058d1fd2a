"""Compliance of an axle on bushings: against equilibria under finite loads, by reciprocity, and with a chassis that is no ground."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from cutjoint.cli import main
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.tasks.kinematics.sweep import find_compliance
from cutjoint.tasks.states import find_equilibrium
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp

#: Two arms on bushings, with preloads by the carriers' weight, a tie rod, and planes on which the wheels' centres slide.
AXLE = """
cutjoint: 1
name: rubber
gravity: [0, 0, -9.81]
parameters:
  side: {value: 0, unit: N, binding: param}
  along: {value: 0, unit: N, binding: param}
  ahead: {value: 0, unit: N, binding: param}
  twist: {value: 0, unit: N*m, binding: param}
submodels:
  corner:
    connectors: [hull]
    points:
      {LF: [0.15, 0.3, 0.2], LR: [-0.15, 0.3, 0.2], LB: [0.01, 0.7, 0.19], UF: [0.12, 0.35, 0.45], UR: [-0.12, 0.35, 0.46],
       UB: [-0.02, 0.66, 0.5], TI: [0.12, 0.32, 0.25], TO: [0.13, 0.68, 0.24], W: [0, 0.75, 0.3], P: [0, 0.75, 0]}
    bodies:
      lower: {mass: 3, centre_of_mass: {midpoint: [LF, LB]}, inertia: [0.1, 0.1, 0.1]}
      upper: {mass: 2, centre_of_mass: {midpoint: [UF, UB]}, inertia: [0.1, 0.1, 0.1]}
      carrier: {mass: 20, centre_of_mass: W, inertia: [1, 1, 1]}
    joints:
      lower_ball: {kind: spherical, bodies: [lower, carrier], at: LB}
      upper_ball: {kind: spherical, bodies: [upper, carrier], at: UB}
      tie_rod: {kind: distance, bodies: [hull, carrier], at: TI, to: TO}
      stand: {kind: point_on_plane, bodies: [ground, carrier], at: W, axis: z}
    forces:
      lower_front: {kind: bushing, bodies: [hull, lower], at: LF, stiffness: [3.0e+6, 8.0e+6, 5.0e+6, 40, 40, 40], damping: DAMPING}
      lower_rear: {kind: bushing, bodies: [hull, lower], at: LR, stiffness: [1.0e+6, 4.0e+6, 5.0e+6, 40, 40, 40], damping: DAMPING}
      upper_front: {kind: bushing, bodies: [hull, upper], at: UF, stiffness: [1.0e+6, 4.0e+6, 2.0e+6, 20, 20, 20], damping: DAMPING}
      upper_rear: {kind: bushing, bodies: [hull, upper], at: UR, stiffness: [2.0e+6, 3.0e+6, 2.0e+6, 20, 20, 20], damping: DAMPING}
      push: {kind: load, body: carrier, at: P, force: [-along, -side, 0]}
      pull: {kind: load, body: carrier, at: W, force: [ahead, 0, 0]}
      turn: {kind: load, body: carrier, torque: [0, 0, -twist]}
instances:
  left: {use: corner, connect: {hull: ground}}
  right: {use: corner, connect: {hull: ground}, mirror: y}
scenes: {rest: {end: 0.1}}
""".replace("DAMPING", "[1, 1, 1, 1, 1, 1]")
#: A chassis on soft bushings, without weight.
HULL = """bodies: {hull: {mass: 500, centre_of_mass: [0, 0, 0.5], inertia: [9, 9, 9]}}
joints: {free: {kind: free, bodies: [ground, hull], at: [0, 0, 0.5]}}
forces: {seat: {kind: bushing, bodies: [ground, hull], at: [0, 0, 0.5], stiffness: [9, 9, 9, 9, 9, 9], damping: [1, 1, 1, 1, 1, 1]}}
instances:"""
BODIES = "left.carrier,right.carrier"
LOADS = {"lateral": ("side", 50.0), "braking": ("along", 50.0), "driving": ("ahead", 50.0), "aligning": ("twist", 5.0)}
CHANGES = ("toe", "camber", "x", "y")


def compliance(text: str) -> dict[str, float]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "axle.yaml"
        path.write_text(text)
        return dict(find_compliance(path, axle=BODIES).figures)


@cache
def linear() -> dict[str, float]:
    return compliance(AXLE)


def wheel(parameters: dict[str, float]) -> np.ndarray:
    """Toe, camber and the place of the contact centre of the left wheel at the equilibrium under a load; nothing of it is linearised."""
    state = find_equilibrium(read_model_text(AXLE, "axle.yaml"), parameters=parameters).values
    turn = Rotation.from_euler("ZYX", [state[f"left.carrier.{name}"] for name in ("yaw", "pitch", "roll")])
    x, y, z = outward = turn.apply([0, 1, 0])
    up = np.array([0, 0, 1]) - z * outward
    place = np.array([state[f"left.carrier.{axis}"] for axis in "xyz"]) + turn.apply([0, 0, -0.3])
    assert np.linalg.norm(up) > 0.9
    return np.array([np.arctan2(x, y), -np.arcsin(z), *place[:2]])


@pytest.mark.parametrize("load", LOADS)
def test_small_loads_move_wheels_as_finite_ones_do(load: str) -> None:
    """Central differences of equilibria, whose searches end at 1e-9 m/s^2; their error falls with the square of the load."""
    parameter, size = LOADS[load]
    differences = (wheel({parameter: size}) - wheel({parameter: -size})) / (2 * size)
    found = np.array([linear()[f"left.{load}.{name}"] for name in CHANGES])
    np.testing.assert_allclose(found, differences, rtol=2e-4, atol=2e-5 * np.abs(differences).max())


def test_loads_and_changes_are_reciprocal() -> None:
    """Maxwell and Betti: what a lateral force does along, a force along does sideways; a moment's place is a force's turn."""
    found = linear()
    assert found["left.lateral.x"] == pytest.approx(found["left.braking.y"], rel=1e-3)
    assert found["left.aligning.y"] == pytest.approx(-found["left.lateral.toe"], rel=1e-3)
    assert found["left.aligning.x"] == pytest.approx(-found["left.braking.toe"], rel=1e-3)
    for name, value in found.items():
        if name.startswith("left."):
            assert found["right." + name.removeprefix("left.")] == pytest.approx(value, rel=1e-6, abs=1e-15)


def test_the_chassis_is_held_where_it_is_no_ground() -> None:
    """Without weight a hull on soft bushings, and wheels without planes: what is held in their place."""
    alone = AXLE.replace("-9.81", "0").replace("      stand: {kind: point_on_plane, bodies: [ground, carrier], at: W, axis: z}\n", "")
    hull = alone.replace("hull: ground", "hull: hull").replace("instances:", HULL)
    expected, found = compliance(AXLE.replace("-9.81", "0")), compliance(hull)
    np.testing.assert_allclose([*found.values()], [*expected.values()], rtol=1e-6, atol=1e-15)


def test_an_axle_on_joints_alone_does_not_give_way() -> None:
    found = find_compliance(MODELS / "axle.yaml", scene="bump")
    assert set(found.figures.values()) == {0.0}
    assert found.units["left.aligning.toe"] == "rad/(N*m)"


def test_what_nothing_holds_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "axle.yaml"
    path.write_text(AXLE.replace("-9.81", "0").replace("      tie_rod: {kind: distance, bodies: [hull, carrier], at: TI, to: TO}\n", ""))
    with pytest.raises(RunError, match=f"axle '{BODIES}': no stiffness supports the left wheel against"):
        find_compliance(path, axle=BODIES)


def test_the_command_prints_and_writes_it(tmp_path: Path) -> None:
    path, out = tmp_path / "axle.yaml", tmp_path / "out.csv"
    path.write_text(AXLE)
    done = CliRunner().invoke(main, ["kinematics", str(path), "--axle", BODIES, "--compliance", "rest", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert f"{np.degrees(1e3 * linear()['left.lateral.toe']):.3f}" in done.output
    names, values = (line.split(",") for line in out.read_text().splitlines())
    assert dict(zip(names, map(float, values), strict=True)) == pytest.approx(linear())
