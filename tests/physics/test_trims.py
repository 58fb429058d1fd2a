"""Trimmed starts: what is found by closed forms and by SciPy, and runs that stay there."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from scipy.optimize import fsolve

from cutjoint import find_equilibrium, find_modes, read_model_text
from cutjoint.cli import main
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import start_follows_from, trimmed
from cutjoint.run.simulation import simulate
from cutjoint.tasks.batch import simulate_batch
from tests.mechanisms.trims import FIVE_BAR, MOTOR, OIL, SLED, SPRING
from tests.physics.simulation import compile_scene

G = 9.81


def found_by(text: str, **parameters: float) -> dict[str, float]:
    state = find_equilibrium(read_model_text(text, "m.yaml"), parameters=parameters)
    assert state.trim is not None
    assert state.trim.residual < 1e-11
    return dict(state.trim.unknowns)


def run(text: str, **parameters: float) -> Trajectory:
    model = read_model_text(text, "m.yaml")
    artifact = compile_scene(model, next(iter(model.scenes.values())))
    found = simulate(artifact, error=False, parameters=parameters, tolerance=1e-9)
    assert found.failure is None
    return found


def test_a_current_holds_a_pendulum() -> None:
    """Its torque is that of the weight, m g l cos(angle), and at rest the voltage drops at the resistance."""
    current = -3 * G * 0.5 * np.cos(np.pi / 6) / 5
    assert found_by(MOTOR) == pytest.approx({"voltage": 0.5 * current, "current": current}, rel=1e-12)
    assert found_by(MOTOR, length=1.0)["current"] == pytest.approx(2 * current, rel=1e-12)
    assert np.ptp(run(MOTOR, length=1.0)["hinge.angle"]) < 1e-6


def test_pressures_carry_a_load() -> None:
    below = 1e5 + 500 * G / 12e-4
    assert found_by(OIL) == pytest.approx({"below": below}, rel=1e-12)
    motion = run(OIL)
    assert np.abs(motion["below.value"] - below).max() < 1e-6 * below
    assert np.abs(motion["rod.displacement"] - 0.1).max() < 1e-7


def test_a_preload_lifts_a_mass() -> None:
    """The spring of 2 kN/m pushes with the weight where it is drawn out by 50 mm."""
    assert found_by(SPRING)["preload"] == pytest.approx(-40 * G - 2000 * 0.05, rel=1e-12)
    assert np.abs(run(SPRING)["way.displacement"] - 0.05).max() < 1e-7


def test_throttle_against_drag() -> None:
    """The position and the distance run on at 20 m/s; another speed is a parameter that changes."""
    assert found_by(SLED)["throttle"] == pytest.approx(0.7 * 20**2 / 900, rel=1e-12)
    motion = run(SLED)
    assert np.abs(motion["way.displacement"] - 20 * motion.t).max() < 2e-5
    assert run(SLED, target=30.0)["way.displacement"][-1] == pytest.approx(30, rel=1e-9)
    state = find_equilibrium(read_model_text(SLED, "m.yaml"))
    assert state.trim is not None
    assert state.trim.unsteady == {"far": (pytest.approx(20), "m/s")}


@cache
def five_bar_by_hand() -> NDArray[np.float64]:
    """Preload and moment by virtual work of weights, spring and motor in the plane x z, with angles about y of the links."""
    places = {"A": (0, 0), "B": (-0.2, 0.4), "C": (0.3, 0.7), "D": (0.8, 0.4), "E": (0.6, 0)}
    P = {name: np.array(xz, dtype=float) for name, xz in places.items()}

    def turned(r: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
        return np.array([r[0] * np.cos(angle) + r[1] * np.sin(angle), r[1] * np.cos(angle) - r[0] * np.sin(angle)])

    def points(s: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        b = turned(P["B"] - P["A"], s[0])
        c, d = b + turned(P["C"] - P["B"], s[1]), P["E"] + turned(P["D"] - P["E"], s[3])
        return b, c, d, d + turned(P["C"] - P["D"], s[2])

    def height_energy(s: NDArray[np.float64]) -> float:
        b, c, d, _ = points(s)
        return float(G * (2 * b[1] / 2 + 3 * (b[1] + c[1]) / 2 + 3 * (c[1] + d[1]) / 2 + 2 * d[1] / 2))

    def length(s: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(points(s)[1] - [0.3, 0]))

    def derivatives(f: object, s: NDArray[np.float64]) -> NDArray[np.float64]:
        h = 1e-6
        return np.array([(f(s + h * e) - f(s - h * e)) / (2 * h) for e in np.eye(4)])  # type: ignore[operator]

    def left(z: NDArray[np.float64]) -> list[float]:
        s, force, moment, pulls = z[:4], z[4], z[5], z[6:]
        loop = points(s)[1] - points(s)[3]
        closing = [derivatives(lambda x, i=i: points(x)[1][i] - points(x)[3][i], s) for i in (0, 1)]
        work = derivatives(height_energy, s) + force * derivatives(length, s) - moment * np.eye(4)[0] + pulls @ np.array(closing)
        return [*work, *loop, s[0] - np.radians(5), length(s) - 0.69]

    z = fsolve(left, np.array([0.09, 0, 0, 0, -40, -3, 0, 0]), xtol=1e-10)
    assert np.abs(left(z)).max() < 1e-6
    return np.array([z[4] - 300 * (0.69 - 0.7), z[5]])


def test_a_five_bar_with_its_preload() -> None:
    """SciPy solves the equations by virtual work, with differences of 1e-6."""
    assert [*found_by(FIVE_BAR).values()] == pytest.approx(five_bar_by_hand().tolist(), rel=1e-6)
    motion = run(FIVE_BAR)
    for name in motion.columns:
        assert np.ptp(motion[name]) < 1e-6


def test_batches_trim_each_run() -> None:
    model = read_model_text(SLED, "m.yaml")
    batch = simulate_batch(model, [{"target": 10.0}, {"target": 25.0}])
    assert batch.end["way.displacement"] == pytest.approx([10, 25], rel=1e-9)
    assert batch.end["way.displacement_rate"] == pytest.approx([10, 25], rel=1e-9)


def test_a_start_that_is_frozen() -> None:
    """What exports get: numbers, with which the run is the same."""
    model = read_model_text(SLED, "m.yaml")
    frozen, scene, _ = trimmed(model, model.scenes["steady"], {})
    assert scene.trim is None
    assert float(scene.inputs["throttle"]) == pytest.approx(280 / 900)
    assert simulate(compile_scene(frozen, scene), error=False)["way.displacement"][-1] == pytest.approx(20, rel=1e-9)


def test_c99_says_that_the_start_is_trimmed_once(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(SPRING)
    said = CliRunner().invoke(main, ["compile", str(tmp_path / "m.yaml"), "--language", "c99", "--out", str(tmp_path / "code")]).output
    assert "the start is trimmed once, with the parameters of the file: preload = -492.4 N" in said


def test_modes_about_a_steady_motion() -> None:
    """Drag 0.7 v|v| slows a disturbance by 2 * 0.7 * 20 / 300 a second; position and distance have zeros."""
    found = find_modes(read_model_text(SLED, "m.yaml"))
    assert found.steady
    assert [mode.eigenvalue for mode in found.modes] == pytest.approx([-28 / 300], rel=1e-6)
    assert found.zeros == 2
    assert find_modes(read_model_text(MOTOR, "m.yaml")).at_rest


def test_another_body_is_free() -> None:
    """A plate hung from three springs, whose attitude is free and found: its weight stretches them alike, m g/(3 k)."""
    text = """
cutjoint: 1
name: plate
gravity: [0, 0, -9.81]
parameters: {tension: {value: 0, unit: N, binding: param}}
points: {A: [1, 0, 0], B: [-0.5, 0.8, 0], C: [-0.5, -0.8, 0], P: [1, 0, 1], Q: [-0.5, 0.8, 1], R: [-0.5, -0.8, 1]}
bodies:
  plate: {mass: 6, centre_of_mass: [0, 0, 0], inertia: [1, 1, 2, 0, 0, 0]}
joints:
  moves: {kind: free, bodies: [plate, ground], at: [0, 0, 0]}
forces:
  one: {kind: point_spring, bodies: [ground, plate], from: P, to: A, law: {stiffness: 1000, preload: tension}}
  two: {kind: point_spring, bodies: [ground, plate], from: Q, to: B, law: {stiffness: 1000, preload: tension}}
  three: {kind: point_spring, bodies: [ground, plate], from: R, to: C, law: {stiffness: 1000, preload: tension}}
outputs: [plate.z, plate.roll, plate.pitch]
scenes:
  hung:
    end: 1
    positions: {moves.attitude: {rotation_vector: [0.1, 0.2, 0]}}
    near: [moves.attitude]
    trim: {find: [tension], hold: {plate.z: 0.02 m}}
"""
    assert found_by(text)["tension"] == pytest.approx(6 * G / 3 + 1000 * 0.02, rel=1e-9)
    motion = run(text)
    assert max(np.ptp(motion[name]) for name in motion.columns) < 1e-6


def test_redundant_values_are_named() -> None:
    text = FIVE_BAR.replace("a.angle: 5 deg", "a.angle: 5 deg, 2*a.angle: 10 deg")
    state = find_equilibrium(read_model_text(text, "m.yaml"))
    assert state.trim is not None
    assert state.trim.redundant == ("a.angle", "2*a.angle")


def test_bounds_of_a_coordinate_that_is_drawn_elsewhere() -> None:
    """Of the two angles at which a current of 1 A balances the weight the bounds choose one, whatever the guess is."""
    text = MOTOR.replace("positions: {hinge.angle: 30 deg}, trim: {find: [voltage, current]}", (
        "positions: {hinge.angle: -0.5}, states: {current: -2 A}, trim: {find: [hinge.angle, voltage], bounds: {hinge.angle: [ENDS]}}"
    ))  # fmt: skip
    angle = np.arccos(5 * 2 / (3 * G * 0.5))
    for ends, sign in (("-80 deg, -10 deg", -1), ("10 deg, 80 deg", 1)):
        assert found_by(text.replace("ENDS", ends))["hinge.angle"] == pytest.approx(sign * angle, rel=1e-9)


def test_rows_of_sweeps_share_a_start_that_does_not_follow_from_what_varies() -> None:
    model = read_model_text(SLED.replace("outputs:", "signals: {shown: gain*way.displacement_rate}\noutputs:").replace(
        "  target:", "  gain: {value: 1, unit: Hz, binding: param}\n  target:"), "m.yaml")  # fmt: skip
    assert start_follows_from(model, model.scenes["steady"], ["gain"]) == ""
    assert start_follows_from(model, model.scenes["steady"], ["gain", "target"]) == "target"
