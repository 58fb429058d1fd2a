"""Springs and dampers of balls: through half a turn in closed form, energy of a loop, all methods, faults of their fields."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cutjoint.compile.options import CompileOptions
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import BallSpring
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_scene, completed

METHODS = ("recursive", "recursive-newton", "augmented", "classical")
STIFFNESS, INERTIA = 3.0, 0.2


def read(document: dict[str, Any]) -> Any:
    return read_model_text(json.dumps(document), "balls.yaml")


def top(spring: dict[str, Any], scene: dict[str, Any], bodies: tuple[str, str] = ("ground", "top")) -> Any:
    """A ball on the ground, of equal moments of inertia."""
    return read({
        "cutjoint": 1, "name": "top", "gravity": [0, 0, 0],
        "bodies": {"top": {"mass": 1, "centre_of_mass": [0, 0, 0], "inertia": [INERTIA] * 3}},
        "joints": {"ball": {"kind": "spherical", "bodies": list(bodies), "at": [0, 0, 0], "spring": spring}},
        "outputs": ["top.wz", "ball_spring.rz", "ball_spring.Mz", "ball_spring.potential"],
        "scenes": {"spin": {"end": 2, "output_step": 0.05, **scene}},
    })  # fmt: skip


def sawtooth(times: np.ndarray, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Angle beside the nearest rest and speed of a rotor that starts at rest's place and goes over half a turn again and again."""
    rate = np.sqrt(STIFFNESS / INERTIA)
    half = np.arcsin(np.pi * rate / speed) / rate  # from rest to half a turn
    phase = (times + half) % (2 * half) - half
    return speed / rate * np.sin(rate * phase), speed * np.cos(rate * phase)


@needs_cpp
def test_through_half_a_turn() -> None:
    """The torque turns round there, so that no turn gains energy: closed form over three turns."""
    speed = 1.2 * np.pi * np.sqrt(STIFFNESS / INERTIA)
    model = top({"stiffness": STIFFNESS}, {"rates": {"ball.wz": speed}})
    run = completed(simulate(compile_scene(model, model.scenes["spin"]), integrator="dormand-prince", tolerance=1e-9))
    angle, rate = sawtooth(run.t, speed)
    assert np.ptp(np.unwrap(run["ball_spring.rz"])) > 5 * np.pi
    clear = np.abs(angle) < np.pi - 1e-3
    assert clear.sum() > 35
    assert run["ball_spring.rz"][clear] == pytest.approx(angle[clear], abs=1e-4)
    assert run["top.wz"] == pytest.approx(rate, abs=1e-4)
    assert run["ball_spring.Mz"] == pytest.approx(-STIFFNESS * run["ball_spring.rz"], abs=1e-12)
    energy = INERTIA / 2 * run["top.wz"] ** 2 + run["ball_spring.potential"]
    assert np.ptp(energy) < 1e-4 * energy[0]


@needs_cpp
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("bodies", [("ground", "top"), ("top", "ground")])
def test_a_damper_alone_and_a_spring_at_rest_elsewhere(bodies: tuple[str, str], method: str) -> None:
    """A turn about z, seen from either body: a damped oscillation about the attitude of rest, in closed form."""
    rest, damping = 0.7, 0.1
    model = top({"stiffness": STIFFNESS, "damping": damping, "free_rotation": [0, 0, rest]}, {}, bodies)
    options = {"integrator": "dormand-prince", "tolerance": 1e-10} if method == "recursive" else {"dt": 2e-4}
    run = completed(simulate(compile_scene(model, model.scenes["spin"], CompileOptions(method=method)), **options))
    sign = 1 if bodies[0] == "ground" else -1
    decay, start = damping / (2 * INERTIA), -sign * rest  # of the top, beside its own attitude of rest
    frequency = np.sqrt(STIFFNESS / INERTIA - decay**2)
    angle = start * np.exp(-decay * run.t) * (np.cos(frequency * run.t) + decay / frequency * np.sin(frequency * run.t))
    assert run["ball_spring.rz"] == pytest.approx(sign * angle, abs=1e-8 if method == "recursive" else 2e-6)
    alone = top({"damping": damping}, {"rates": {"ball.wz": 2.0}}, bodies)
    run = completed(simulate(compile_scene(alone, alone.scenes["spin"], CompileOptions(method=method)), **options))
    assert run["top.wz"] == pytest.approx(2 * np.exp(-damping / INERTIA * run.t), abs=1e-8 if method == "recursive" else 2e-7)


CHAIN: dict[str, Any] = {
    "cutjoint": 1, "name": "chain", "gravity": [0, 0, -9.81],
    "bodies": {
        "upper": {"mass": 2, "centre_of_mass": [0.1, 0, -0.4], "inertia": [0.1, 0.15, 0.12, 0.01, 0, 0.02]},
        "lower": {"mass": 1, "centre_of_mass": [0, 0.1, -1.2], "inertia": [0.04, 0.03, 0.02, 0, 0.005, 0]},
        "rod": {"mass": 0.5, "centre_of_mass": [0.5, 0, -1.5], "inertia": [0.05, 0.01, 0.05]},
    },
    "joints": {
        "hip": {"kind": "spherical", "bodies": ["ground", "upper"], "at": [0, 0, 0],
                "spring": {"stiffness": 6, "free_rotation": [0.3, -0.4, 0.5]}},
        "knee": {"kind": "spherical", "bodies": ["upper", "lower"], "at": [0, 0, -0.8], "spring": {"stiffness": 4}},
        "ankle": {"kind": "spherical", "bodies": ["lower", "rod"], "at": [0, 0, -1.5]},
        "wall": {"kind": "spherical", "bodies": ["ground", "rod"], "at": [1, 0, -1.5],
                 "spring": {"stiffness": 2, "free_rotation": [0, 1, 0]}},
    },
    "outputs": [f"{body}.{q}" for body in ("upper", "lower", "rod") for q in
                ("x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz", "roll", "pitch", "yaw")]
               + [f"{joint}_spring.potential" for joint in ("hip", "knee", "wall")],
    "scenes": {"fall": {"end": 1, "output_step": 0.1}},
}  # fmt: skip
SPRINGS = {"hip": ("", "upper", 6, (0.3, -0.4, 0.5)), "knee": ("upper", "lower", 4, (0, 0, 0)), "wall": ("", "rod", 2, (0, 1, 0))}


def attitude(run: Trajectory, body: str, row: int) -> np.ndarray:
    return Rotation.from_euler("ZYX", [run[f"{body}.{a}"][row] for a in ("yaw", "pitch", "roll")]).as_matrix() if body else np.eye(3)


def energy(run: Trajectory, row: int) -> float:
    """Kinetic energy and weight by the bodies' numbers; of springs the logarithm of the rotation from rest."""
    total = 0.0
    for name, body in CHAIN["bodies"].items():
        xx, yy, zz, xy, xz, yz = [*body["inertia"], 0, 0, 0][:6]
        v, w = (np.array([run[f"{name}.{q}{c}"][row] for c in "xyz"]) for q in "vw")
        w = attitude(run, name, row).T @ w
        total += body["mass"] * (v @ v / 2 + 9.81 * run[f"{name}.z"][row])
        total += w @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ w / 2
    for joint, (base, follower, stiffness, rest) in SPRINGS.items():
        turned = Rotation.from_rotvec(rest).as_matrix().T @ attitude(run, base, row).T @ attitude(run, follower, row)
        theta = Rotation.from_matrix(turned).as_rotvec()
        assert run[f"{joint}_spring.potential"][row] == pytest.approx(stiffness / 2 * theta @ theta, rel=1e-9)
        total += stiffness / 2 * theta @ theta
    return total


@needs_cpp
def test_a_loop_on_balls_keeps_its_energy() -> None:
    model = read(CHAIN)
    run = completed(simulate(compile_scene(model, model.scenes["fall"]), integrator="dormand-prince", tolerance=1e-11))
    found = [energy(run, row) for row in range(len(run.t))]
    assert np.ptp(found) < 1e-8 * abs(found[0])


@needs_cpp
@pytest.mark.parametrize("method", METHODS[1:])
def test_all_methods_move_the_loop_alike(method: str) -> None:
    model = read(CHAIN)
    exact = completed(simulate(compile_scene(model, model.scenes["fall"]), integrator="dormand-prince", tolerance=1e-10))
    runs = [completed(simulate(compile_scene(model, model.scenes["fall"], CompileOptions(method=method)), dt=dt)) for dt in (0.002, 0.001)]
    errors = [np.abs(run["rod.z"] - exact["rod.z"]).max() for run in runs]
    assert errors[1] < 2e-5
    assert 3 < errors[0] / errors[1] < 5


@pytest.mark.parametrize(
    ("spring", "message"),
    [
        ({"stiffness": 3, "free_position": 0.1}, "unknown field 'free_position'"),
        ({"stiffness": "3 N/m"}, "stiffness needs N*m"),
        ({"damping": "1 N"}, "damping needs"),
        ({"stiffness": 1, "free_rotation": [0, 1]}, "free_rotation"),
    ],
)
def test_faults_of_fields(spring: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=message.replace("*", r"\*")):
        top(spring, {})


def test_no_turn_of_an_open_parameter() -> None:
    """An attitude of rest by parameters is the design one at zero, without a division by it."""
    model = read_model_text(json.dumps({
        "cutjoint": 1, "name": "top", "gravity": [0, 0, 0], "parameters": {"lean": {"value": 0, "unit": "rad"}},
        "bodies": {"top": {"mass": 1, "centre_of_mass": [0, 0, 0], "inertia": [1, 1, 1]}},
        "joints": {"ball": {"kind": "spherical", "bodies": ["ground", "top"], "at": [0, 0, 0],
                            "spring": {"stiffness": 1, "free_rotation": ["lean", 0, 0]}}},
        "scenes": {"spin": {"end": 1}},
    }), "balls.yaml")  # fmt: skip
    (spring,) = model.forces
    assert isinstance(spring, BallSpring)
    (lean,) = model.parameters
    for value in (0.0, 0.3):
        axes = np.array([[float(x.subs(lean.symbol, value)) if hasattr(x, "subs") else float(x) for x in axis] for axis in spring.axes]).T
        assert axes == pytest.approx(Rotation.from_rotvec([value, 0, 0]).as_matrix(), abs=1e-15)
