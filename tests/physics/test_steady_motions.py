"""Relative equilibria, in which cyclic coordinates run on: what is found, and modes about them, against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, reduce

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from cutjoint import find_equilibrium, find_modes, read_model_text
from cutjoint.analysis.modes import Modes
from cutjoint.package.errors import CutjointError
from cutjoint.run.results import MechanismState
from cutjoint.run.simulation import simulate
from tests.conftest import with_heavy
from tests.mechanisms.steady import (
    CONICAL,
    CONVEYOR,
    FAN,
    GOVERNOR,
    HELICOPTER,
    HOOP,
    LIBRARY_CAR,
    PLANAR_CAR,
    ROTOR,
    SHAFT,
    SIMPLE_MOTORCYCLE,
    TOP,
)
from tests.physics.simulation import compile_scene

G = 9.81
Array = NDArray[np.float64]


@cache
def found(text: str) -> MechanismState:
    state = find_equilibrium(read_model_text(text, "m.yaml"))
    assert state.trim is not None
    assert state.trim.residual < 1e-9
    assert state.trim.steady
    return state


def place(text: str, name: str) -> float:
    trim = found(text).trim
    assert trim is not None
    return trim.coordinates[name]


def unknowns(text: str) -> dict[str, float]:
    trim = found(text).trim
    assert trim is not None
    return dict(trim.unknowns)


def eigenvalues(text: str) -> list[complex]:
    modes = find_modes(read_model_text(text, "m.yaml"))
    assert modes.steady
    return [mode.eigenvalue for mode in modes.modes]


def modes_of(text: str) -> Modes:
    return find_modes(read_model_text(text, "m.yaml"))


def frequency(inertia: float, potential: Callable[[float], float], at: float, h: float = 1e-3) -> float:
    """Of small motions in an effective potential, whose second derivative has fourth order."""
    f = [potential(at + i * h) for i in (-2, -1, 0, 1, 2)]
    return float(np.sqrt((-f[0] + 16 * f[1] - 30 * f[2] + 16 * f[3] - f[4]) / (12 * h**2) / inertia))


def test_a_conical_pendulum() -> None:
    """cos(angle) = g/(l W^2); about it W sqrt(1 + 3 cos^2), as angular momentum is constant, beside the two zeros of the bearing."""
    cosine = G / (0.8 * 25)
    assert place(CONICAL, "hinge.angle") == pytest.approx(np.arccos(cosine), rel=1e-9)
    assert eigenvalues(CONICAL) == pytest.approx([5j * np.sqrt(1 + 3 * cosine**2)], rel=1e-6)
    assert modes_of(CONICAL).zeros == 2


def test_a_bead_on_a_hoop_that_is_driven() -> None:
    """Without the reaction of the bearing, W sin(angle), and damped."""
    cosine, damping = G / (0.5 * 36), 0.02 / (0.3 * 0.25)
    assert place(HOOP, "way.angle") == pytest.approx(np.arccos(cosine), rel=1e-9)
    expected = [root for root in np.roots([1, damping, 36 * (1 - cosine**2)]) if root.imag > 0]
    assert eigenvalues(HOOP) == pytest.approx(expected, rel=1e-6)


def test_a_governor() -> None:
    """Watt's, two loops: m l W^2 cos(angle) = (m + M) g; small motions at constant momentum of balls and shaft."""
    m, M, J, W, link = 1.5, 4.0, 0.02, 15.0, 0.25
    angle = np.arccos((m + M) * G / (m * link * W**2))
    assert found(GOVERNOR)["sleeve.z"] == pytest.approx(1 - 2 * link * np.cos(angle), rel=1e-9)
    momentum = (J + 2 * m * link**2 * np.sin(angle) ** 2) * W

    def potential(x: float) -> float:
        return float(momentum**2 / (2 * (J + 2 * m * link**2 * np.sin(x) ** 2)) - 2 * (m + M) * G * link * np.cos(x))

    inertia = 2 * m * link**2 + 4 * M * link**2 * np.sin(angle) ** 2
    assert eigenvalues(GOVERNOR) == pytest.approx([1j * frequency(inertia, potential, angle)], rel=1e-6)
    assert modes_of(GOVERNOR).zeros == 2
    with pytest.raises(CutjointError, match=r"'sleeve\.z' = 0\.680267 m is possible"):
        find_equilibrium(read_model_text(GOVERNOR.replace("trim: {}", "trim: {hold: {sleeve.z: 0.7 m}}"), "m.yaml"))


def test_a_top_that_precesses() -> None:
    """C n W = A W^2 cos + m g l of a heavy top; it nutates in its effective potential."""
    A, C, W, weight, at = 4e-4 + 0.5 * 0.06**2, 6e-4, 4.0, 0.5 * G * 0.06, np.pi / 6
    about_axis = (A * W**2 * np.cos(at) + weight) / (C * W)
    assert unknowns(TOP)["spin.angle_rate"] == pytest.approx(about_axis - W * np.cos(at), rel=1e-9)
    spin, turn = C * about_axis, A * W * np.sin(at) ** 2 + C * about_axis * np.cos(at)

    def potential(x: float) -> float:
        return float((turn - spin * np.cos(x)) ** 2 / (2 * A * np.sin(x) ** 2) + weight * np.cos(x))

    assert eigenvalues(TOP) == pytest.approx([1j * frequency(A, potential, at)], rel=1e-6)
    assert modes_of(TOP).zeros == 4


def test_a_disc_that_spins() -> None:
    """Forward and backward whirl, A s^2 + (d - i C W) s + k = 0."""
    roots = np.roots([0.02, 0.3 - 0.035j * 300, 500])
    expected = sorted((complex(root.real, abs(root.imag)) for root in roots), key=abs)
    assert eigenvalues(ROTOR) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("speed", [80.0, 200.0])
def test_a_shaft_with_damping_that_turns(speed: float) -> None:
    """Jeffcott's rotor in axes that turn: m z'' + (di + de + 2 i m W) z' + (k - m W^2 + i de W) z = m W^2 e; unstable above
    sqrt(k/m) (1 + de/di)."""
    m, k, inner, outer, e = 4.0, 1e4, 20.0, 30.0, 0.002
    text = SHAFT.replace("value: 80,", f"value: {speed!r},")
    z = m * speed**2 * e / (k - m * speed**2 + 1j * outer * speed)
    assert complex(place(text, "along.displacement"), place(text, "across.displacement")) == pytest.approx(z, rel=1e-9)
    roots = np.roots([m, inner + outer + 2j * m * speed, k - m * speed**2 + 1j * outer * speed])
    expected = sorted((complex(root.real, abs(root.imag)) for root in roots), key=abs)
    modes = modes_of(text)
    assert [mode.eigenvalue for mode in modes.modes] == pytest.approx(expected, rel=1e-6)
    assert (modes.growth_rate > 0) == (speed > np.sqrt(k / m) * (1 + outer / inner))


def test_a_conveyor() -> None:
    """A parcel, held by a spring, on a belt that slides under it; the drum runs against its bearing."""
    rubs = 0.4 * 6 * G
    assert place(CONVEYOR, "held.displacement") == pytest.approx(rubs / 800, rel=1e-9)
    assert unknowns(CONVEYOR)["torque"] == pytest.approx(0.2 * rubs + 0.4 * 7, rel=1e-12)
    drum, parcel = -0.4 / 0.5, next(root for root in np.roots([6, 5, 800]) if root.imag > 0)
    assert eigenvalues(CONVEYOR) == pytest.approx([drum, parcel], rel=1e-6)


def test_a_fan() -> None:
    """Its motor's voltage drops at resistance and back electromotive force; drag grows with the square of the speed."""
    R, K, drag, J, L = 0.8, 0.1, 2e-5, 2e-3, 2e-3
    speed = (-K + np.sqrt(K**2 + 4 * R * drag / K * 24)) / (2 * R * drag / K)
    assert unknowns(FAN)["bearing.angle_rate"] == pytest.approx(speed, rel=1e-9)
    roots = np.linalg.eigvals([[-2 * drag * speed / J, K / J], [-K / L, -R / L]])
    assert eigenvalues(FAN) == pytest.approx(sorted(roots, key=abs), rel=1e-6)


def test_a_helicopter_with_a_load_on_its_hoist() -> None:
    """The rope leans by the load's drag, the hull by both drags; the stick takes the moment of the hook about the hull's centre."""
    drag, hanging, weight = 1.2 * 900, 0.9 * 900, 400 * G
    at, state = np.arctan2(drag + hanging, 2400 * G), found(HELICOPTER)
    assert unknowns(HELICOPTER)["thrust"] == pytest.approx(np.hypot(drag + hanging, 2400 * G), rel=1e-9)
    assert state["hull.pitch"] == pytest.approx(at, rel=1e-9)
    hook = np.array([0.2 * np.cos(at) - np.sin(at), -0.2 * np.sin(at) - np.cos(at)])
    assert unknowns(HELICOPTER)["cyclic"] == pytest.approx(-(hook[1] * -hanging - hook[0] * -weight), rel=1e-8)
    assert [state["load.x"], state["load.z"]] == pytest.approx(
        (hook - 12 * np.array([hanging, weight]) / np.hypot(hanging, weight)).tolist(), abs=1e-8
    )


def test_a_car_on_a_circle() -> None:
    """Eigenvalues of its three equations in its own axes, and a pair of its yaw rate: a shift of the circle, seen from the car."""
    m, inertia, a, b, front, rear, w = 1200.0, 1750.0, 1.1, 1.4, 8e4 / 15, 9e4 / 15, 5 / 15

    def left(x: Array) -> Array:
        slip, drive, steer = x
        u, v = 15 * np.cos(slip), 15 * np.sin(slip)
        sides = -front * (v + a * w - 15 * steer), -rear * (v - b * w)
        return np.array([drive - 50 * u + m * w * v, sum(sides) - m * w * u, a * sides[0] - b * sides[1]])

    slip, drive, steer = fsolve(left, np.array([0.0, 750, 0.05]), xtol=1e-13)
    assert unknowns(PLANAR_CAR) == pytest.approx({"drive": drive, "steer": steer, "moves.wz": w}, rel=1e-8)
    u, v = 15 * np.cos(slip), 15 * np.sin(slip)
    A = [[-50 / m, w, v],
         [-w, -(front + rear) / m, (b * rear - a * front) / m - u],
         [0, (b * rear - a * front) / inertia, -(a**2 * front + b**2 * rear) / inertia]]  # fmt: skip
    values = eigenvalues(PLANAR_CAR)
    for root in [*np.linalg.eigvals(A), 1j * w]:
        if root.imag >= 0:
            assert min(abs(value - root) for value in values) < 1e-6 * abs(root), root


def two_bodies(lateral: float) -> Array:
    """A motorcycle's height, yaw, roll, pitch, steering angle, drive, torque of the bars, and spins of wheels, in steady motion.

    Balances of force and moment of all bodies, of the fork about its head and of wheels about their axles, in bodies' own positions."""
    v, w = np.array([15.0, 0, 0]), np.array([0, 0, lateral / 15])
    R, F, S, T = (np.array(p) for p in ([-0.6, 0, 0.3], [0.8, 0, 0.3], [0.5, 0, 0.9], [0.72, 0, 0.32]))
    centre, head, up = np.array([0, 0, 0.6]), (S - T) / np.linalg.norm(S - T), np.array([0, 0, 1.0])

    def left(u: Array) -> Array:
        z, yaw, roll, pitch, steer, drive, bars, *spins = u
        frame = Rotation.from_euler("ZYX", [yaw, pitch, roll])
        fork = frame * Rotation.from_rotvec(steer * head)
        origin = np.array([0, 0, 0.6 + z])
        S_at = origin + frame.apply(S - centre)
        in_fork: Callable[[Array], Array] = lambda p: S_at + fork.apply(p - S)  # noqa: E731
        force, moment, about_head, axles = np.zeros(3), np.zeros(3), -bars, list[float]()
        axis = frame.apply(head)

        def body(mass: float, at: Array, rate: Array, turning: float) -> None:
            """The inertia of a body, less its weight; ``rate`` of its angular momentum."""
            nonlocal force, moment, about_head
            push = mass * (np.cross(w, v) + np.cross(w, np.cross(w, at - origin)) + G * up)
            force, moment = force + push, moment + np.cross(at - origin, push) + rate
            about_head += turning * axis @ (np.cross(at - S_at, push) + rate)

        def road(pushed: Array, at: Array, turned: Array, turning: float) -> None:
            nonlocal force, moment, about_head
            force, moment = force - pushed, moment - np.cross(at - origin, pushed) - turned
            about_head -= turning * axis @ (np.cross(at - S_at, pushed) + turned)

        for mass, at, inertia, turned, turning in (
            (240, origin, [15, 30, 25], frame, 0), (12, in_fork(np.array([0.65, 0, 0.5])), [0.5, 0.5, 0.2], fork, 1)
        ):  # fmt: skip
            body(mass, at, np.cross(w, turned.apply(inertia * turned.inv().apply(w))), turning)
        wheels = (12, origin + frame.apply(R - centre), frame, 0.3, 0.6, 0), (10, in_fork(F), fork, 0.25, 0.5, 1)
        for (mass, at, carrier, across, along, turning), spin, torque in zip(wheels, spins, (drive, 0.0), strict=True):
            y = carrier.apply(np.array([0, 1.0, 0]))
            total = w + spin * y
            rate = np.cross(w, across * total + (along - across) * (y @ total) * y)
            body(mass, at, rate, turning)
            e_x = np.cross(y, up) / np.linalg.norm(np.cross(y, up))
            e_z, e_y = np.cross(e_x, y), np.cross(up, e_x)
            distance = at[2] / (e_z @ up)
            speed = v + np.cross(w, at - origin)
            slip = (0.3 * (y @ total) - e_x @ speed) / (e_x @ speed)
            side = e_y @ (speed - distance * np.cross(total, e_z)) / (e_x @ speed)
            camber = np.arctan((up @ y) / (up @ e_z))
            pushed = 40000 * slip * e_x + (-20000 * side - 1500 * camber) * e_y + 1.5e5 * (0.3 - distance) * up
            road(pushed, at - distance * e_z, 400 * side * up, turning)
            axles.append(float(y @ (rate - np.cross(-distance * e_z, pushed) - 400 * side * up) - torque))
        return np.array([*force / 1e3, *moment / 1e3, about_head / 100, *np.array(axles) / 100])

    begin = np.array([-0.03, 0.0, -np.arctan(lateral / G), 0.0, 0.01, 20.0, 0.0, 50.0, 50.0])
    solution, _, is_found, said = fsolve(left, begin, xtol=1e-13, full_output=True)
    assert np.abs(left(solution)).max() < 1e-9, (is_found, said)
    return np.asarray(solution)


@pytest.mark.parametrize("lateral", with_heavy([2.0, 4.0, 7.0], 2.0))
def test_a_motorcycle_of_two_bodies_on_wheels(lateral: float) -> None:
    """Lean, steering and all that is found."""
    text = SIMPLE_MOTORCYCLE.replace("{value: 4,", f"{{value: {lateral!r},")
    state, of = found(text), unknowns(text)
    names = ("frame.yaw", "frame.roll", "frame.pitch")
    by = [state["frame.z"] - 0.6, *(state[name] for name in names), place(text, "head.angle"),
          *(of[name] for name in ("drive", "bars", "rear_axle.angle_rate", "front_axle.angle_rate"))]  # fmt: skip
    expected = two_bodies(lateral)
    assert by == pytest.approx(expected.tolist(), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("text", [CONICAL, GOVERNOR, TOP, SHAFT, CONVEYOR, FAN, HELICOPTER, SIMPLE_MOTORCYCLE])
def test_the_motion_is_steady(text: str) -> None:
    """Outputs other than places stay to 1e-6 in a run."""
    model = read_model_text(text, "m.yaml")
    motion = simulate(compile_scene(model, next(iter(model.scenes.values()))), error=False, tolerance=1e-9)
    assert motion.failure is None
    for name in motion.columns:
        if name not in ("frame.yaw", "load.x", "hull.x"):
            assert np.ptp(motion[name]) < 1e-6 * max(1.0, float(np.abs(motion[name]).max())), name


def on_circle(lateral: float) -> str:
    guesses = {"LATERAL": lateral, "WHEEL": 0.15 * lateral, "RATE": lateral / 20}
    return reduce(lambda text, of: text.replace(of[0], repr(of[1])), guesses.items(), LIBRARY_CAR)


@pytest.mark.parametrize("lateral", with_heavy([4.0, -4.0, 2.0, 6.0], -4.0, 2.0, 6.0))
def test_a_library_car_on_a_circle(lateral: float) -> None:
    """Its loops turn with it, so that what is left of their rates and accelerations is rounding, which counted as an open loop."""
    state = found(on_circle(lateral))
    steer = unknowns(on_circle(lateral))["wheel_angle"] / 16
    assert unknowns(on_circle(lateral))["moves.wz"] == pytest.approx(lateral / 20, rel=1e-9)
    assert 0 < (steer - 2.4 * lateral / 400) / lateral < 0.01  # it understeers: by a few degrees at 10 m/s^2
    assert state["chassis.roll"] * lateral > 0  # to the outside
