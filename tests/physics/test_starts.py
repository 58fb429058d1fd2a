"""Machines started as their users would, loads, presses, vehicles: closed forms and own models of what is found; runs that stay."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq, fsolve
from scipy.spatial.transform import Rotation

from cutjoint import find_equilibrium, read_model_text
from cutjoint.model.read import read_model
from cutjoint.run.results import MechanismState, Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import ROOT
from tests.mechanisms.starts import CAR, CLOCK, CRANE, LOADER, MOTORCYCLE, PRESS_BRAKE, QUARTER_CAR, TABLE, TRUCK
from tests.physics.simulation import compile_scene

G = 9.81


@cache
def start(text: str, scene: str, **parameters: float) -> MechanismState:
    state = find_equilibrium(read_model_text(text, "m.yaml"), scene=scene, parameters=parameters)
    assert state.trim is not None
    assert state.trim.residual < 1e-9
    return state


def found(text: str, scene: str, **parameters: float) -> dict[str, float]:
    trim = start(text, scene, **parameters).trim
    assert trim is not None
    return dict(trim.unknowns)


def run(text: str, scene: str, outputs: tuple[str, ...] = ()) -> Trajectory:
    model = read_model_text(text, "m.yaml")
    motion = simulate(compile_scene(model, model.scenes[scene]), error=False, tolerance=1e-9)
    assert motion.failure is None
    for name in outputs:
        assert np.ptp(motion[name]) < 1e-6 * max(1.0, float(np.abs(motion[name]).max())), name
    return motion


def derivative(f: object, x: float, h: float = 1e-5) -> float:
    """Of fourth order."""
    return float((f(x - 2 * h) - 8 * f(x - h) + 8 * f(x + h) - f(x + 2 * h)) / (12 * h))  # type: ignore[operator]


def turned(p: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """A point of the plane x z turned up by an angle about -y."""
    return np.array([p[0] * np.cos(angle) - p[1] * np.sin(angle), p[0] * np.sin(angle) + p[1] * np.cos(angle)])


def cylinder(angle: float) -> tuple[float, float]:
    """The loader's potential energy and its cylinder's length by the boom's angle: tube and rod keep their distance from their eyes."""
    A, C, D, B = (np.array(p) for p in ([0, 1.8], [0.3, 0.8], [1.4, 1.3], [2.8, 1.2]))
    middle, bucket, eye = (A + turned(p - A, angle) for p in ((A + B) / 2, B, D))
    return float(G * (700 * middle[1] + 1500 * bucket[1] + 40 * C[1] + 30 * eye[1])), float(np.linalg.norm(eye - C))


def test_a_loader_under_load() -> None:
    """The cylinder's force by virtual work; through the leak its chambers have one pressure, else that on the rod's side is chosen."""
    at = np.radians(20)
    force = derivative(lambda x: cylinder(x)[0], at) / derivative(lambda x: cylinder(x)[1], at)
    assert found(LOADER, "hold")["head"] == pytest.approx(force / 20e-4, rel=1e-9)
    assert found(LOADER, "fed")["head"] == pytest.approx((force + 20e5 * 30e-4) / 50e-4, rel=1e-9)
    motion = run(LOADER, "hold", ("foot.angle",))
    assert np.ptp(motion["head.value"]) < 1e-6 * force / 20e-4


def test_a_crane_with_a_load_at_rest() -> None:
    """Boom and load hang from the drive of the boom; the load's height is asked for."""
    angle = brentq(lambda x: 3 + turned(np.array([8, 6]), x)[1] - 5 - 5, -0.5, 0.5, xtol=1e-14)
    assert found(CRANE, "rest")["luffing"] == pytest.approx(turned(np.array([8, 6]), angle)[0] * G * (1500 + 450), rel=1e-9)
    run(CRANE, "rest", ("luff.angle", "load.z"))


def test_a_crane_that_slews() -> None:
    """A conical pendulum on a boom that turns at 0.5 rad/s, whose own centrifugal moment is that of a rod."""
    tip, w2 = turned(np.array([8.0, 6.0]), np.radians(10)), 0.25
    out = brentq(lambda x: G * np.tan(x) - w2 * (tip[0] + 5 * np.sin(x)), 0, 0.5, xtol=1e-14)
    pull = 1500 * w2 * (tip[0] + 5 * np.sin(out))
    rod = 900 * (G * tip[0] / 2 + w2 * tip[0] * tip[1] / 3)
    assert found(CRANE, "slewing")["luffing"] == pytest.approx(rod + tip[0] * 1500 * G + tip[1] * pull, rel=1e-8)
    motion = run(CRANE, "slewing", ("luff.angle", "load.z"))
    assert motion["slew.angle"][-1] == pytest.approx(0.25, rel=1e-9)


def test_a_press_brake_whose_punch_is_drawn_above_the_sheet() -> None:
    """400 kN from 4 mm on at 2e8 N/m; push by virtual work of a toggle of two equal links."""
    drop, link = 0.004 + 400e3 / 2e8, np.hypot(0.1, 0.5)

    def knee(s: float) -> NDArray[np.float64]:
        half = (1.0 + s) / 2
        return np.array([np.sqrt(link**2 - half**2), 2 - half])

    def height(s: float) -> float:
        return float(G * (80 * (2 + knee(s)[1]) / 2 + 80 * (knee(s)[1] + 1 - s) / 2 + 600 * (1 - s)))

    length = derivative(lambda s: np.linalg.norm(knee(s) - [0.8, 1.5]), drop)
    push = (400e3 + derivative(height, drop)) / length
    assert found(PRESS_BRAKE, "bend")["push"] == pytest.approx(push, rel=1e-8)
    run(PRESS_BRAKE, "bend", ("guide.displacement", "top.angle"))


def test_a_clock_that_is_stopped() -> None:
    moment = G * (0.2 * 0.5 + 3 * 0.9) * np.sin(np.radians(3))
    assert found(CLOCK, "stopped")["tension"] == pytest.approx(moment, rel=1e-12)
    run(CLOCK, "stopped", ("pivot.angle", "arbor.angle"))


def test_a_quarter_car_at_its_height() -> None:
    """The tyre, which is drawn in touch and no more, bears 390 kg; the spring is as much longer as the wheel is lower."""
    lower = 390 * G / 2e5
    assert found(QUARTER_CAR, "ride")["preload"] == pytest.approx(350 * G + 20e3 * lower, rel=1e-12)
    run(QUARTER_CAR, "ride", ("body.z", "hub.displacement"))


def test_a_delta_robot_at_rest() -> None:
    """Angles of the arms by inverse kinematics, torques by virtual work over the plate's place."""
    at = np.array([0.05, -0.03, -0.42])
    rod = np.hypot(0.34 - 0.05, 0.45 - np.sqrt(0.25**2 - 0.14**2))

    def arms(p: NDArray[np.float64]) -> NDArray[np.float64]:
        angles = []
        for a in (0, 2 * np.pi / 3, 4 * np.pi / 3):
            x, y = p[0] * np.cos(a) + p[1] * np.sin(a) + 0.05 - 0.2, -p[0] * np.sin(a) + p[1] * np.cos(a)
            drawn = np.arctan2(np.sqrt(0.25**2 - 0.14**2), 0.14)
            left = lambda s, x=x, y=y, z=p[2]: (0.25 * np.cos(s) - x) ** 2 + y**2 + (0.25 * np.sin(s) + z) ** 2 - rod**2  # noqa: E731
            angles.append(brentq(left, drawn - 0.6, drawn + 0.6, xtol=1e-14) - drawn)
        return np.array(angles)

    def energy(p: NDArray[np.float64]) -> float:
        drawn = np.arctan2(np.sqrt(0.25**2 - 0.14**2), 0.14)
        return float(G * (0.3 * p[2] - 0.2 * 0.125 * np.sin(drawn + arms(p)).sum()))

    h = 1e-5
    J = np.array([(arms(at + h * e) - arms(at - h * e)) / (2 * h) for e in np.eye(3)])
    by_place = np.array([(energy(at + h * e) - energy(at - h * e)) / (2 * h) for e in np.eye(3)])
    wanted = arms(at) + np.linalg.solve(J, by_place) / 800
    text = (ROOT / "models" / "delta.yaml").read_text(encoding="utf-8")
    trim = "  at: {end: 1, trim: {find: [q1, q2, q3], hold: {plate.x: 0.05 m, plate.y: -0.03 m, plate.z: -0.42 m}}}\n"
    assert [*found(text + trim, "at").values()] == pytest.approx(wanted.tolist(), rel=1e-6)


def test_a_truck_and_trailer_at_20_m_s() -> None:
    """Both driven wheels have half of drag and rolling resistance over their radius."""
    weight = G * (7000 + 20000 + 5 * 500 + 10 * 80)
    assert found(TRUCK, "cruise")["drive"] == pytest.approx((0.5 * (3 + 2) * 20**2 + 0.006 * 0.5 * weight) / 2, rel=1e-9)
    motion = run(TRUCK, "cruise", ("tractor.z", "trailer.z", "tractor.vx", "tractor.pitch"))
    assert motion["tractor.x"][-1] - motion["tractor.x"][0] == pytest.approx(20 * motion.t[-1], rel=1e-6)


def test_a_car_on_its_tyres() -> None:
    """Drawn with wheels in touch and no more: a preloaded spring over a tyre at each corner, for small angles."""
    x, K = np.array([1.1, 1.1, -1.4, -1.4]), 1 / (1 / 30e3 + 1 / 2e5)

    def left(z: NDArray[np.float64]) -> list[float]:
        force = K * (-z[0] + x * z[1] + 3000 / 30e3 - 45 * G / 2e5)  # of the spring; the tyre bears the wheel too
        return [force.sum() - 1200 * G, float(x @ force)]

    z = fsolve(left, np.zeros(2))
    state = start(CAR, "stands")
    assert state.trim is not None
    assert state.trim.coordinates["moves.z"] == pytest.approx(z[0], abs=z[1] ** 2)
    run(CAR, "stands", ("chassis.x", "chassis.yaw", "chassis.roll"))


@cache
def on_a_circle(lateral: float) -> tuple[float, float, float]:
    """Steering, side slip and drive of a flat car with four tyres F = -C tan(alpha) at 20 m/s, in the plane."""
    v, x, y = 20.0, np.array([1.1, 1.1, -1.4, -1.4]), np.array([0.7, -0.7, 0.7, -0.7])
    mass, C = 1200 + 4 * 45.0, np.array([40e3, 40e3, 45e3, 45e3])
    w, centre = lateral / v, 45 * x.sum() / mass

    def left(u: NDArray[np.float64]) -> list[float]:
        steer, slip, drive = u
        angle = np.array([steer, steer, 0, 0])
        vx, vy = v * np.cos(slip) - w * y, v * np.sin(slip) + w * x
        along, side = vx * np.cos(angle) + vy * np.sin(angle), vy * np.cos(angle) - vx * np.sin(angle)
        side, push = -C * side / along, np.array([0, 0, drive, drive]) / 0.3
        fx, fy = push * np.cos(angle) - side * np.sin(angle), push * np.sin(angle) + side * np.cos(angle)
        ax, ay = -lateral * np.sin(slip) - w**2 * centre, lateral * np.cos(slip)
        return [fx.sum() - mass * ax, fy.sum() - mass * ay, (x * fy - y * fx).sum() - mass * centre * ay]

    steer, slip, drive = fsolve(left, np.array([0.03, 0.0, 0.0]), xtol=1e-12)
    return float(steer), float(slip), float(drive)


def test_a_car_on_a_circle() -> None:
    """Roll and pitch, which the flat model lacks, are centimetres of a metre's track."""
    assert found(CAR, "turn", lateral=4.0)["steer"] == pytest.approx(on_a_circle(4.0)[0], rel=5e-3)


@pytest.mark.heavy
def test_a_skid_pad() -> None:
    """Understeer gradient over 2, 4, 6 m/s2, and a run that stays on the circle."""
    steered = [found(CAR, "turn", lateral=a)["steer"] for a in (2.0, 4.0, 6.0)]
    flat = [on_a_circle(a)[0] for a in (2.0, 4.0, 6.0)]
    assert steered == pytest.approx(flat, rel=5e-3)
    gradient = np.diff([s - 2.5 * a / 400 for s, a in zip(steered, (2, 4, 6), strict=True)]) / 2
    assert gradient == pytest.approx(np.diff([s - 2.5 * a / 400 for s, a in zip(flat, (2, 4, 6), strict=True)]) / 2, rel=2e-2)
    motion = run(CAR, "turn", ("chassis.roll", "chassis.wz"))
    speed = np.hypot(np.gradient(motion["chassis.x"], motion.t), np.gradient(motion["chassis.y"], motion.t))[1:-1]
    assert np.ptp(speed) < 1e-5
    assert np.ptp(motion["chassis.yaw"] - 0.2 * motion.t) < 1e-6


def test_a_motorcycle_that_leans() -> None:
    """At 15 m/s and 4 m/s2 it leans as a point mass does, and for the spin of its wheels a little more; an angle may be asked for too.

    Spins, of which the file has no guess, are those of rolling at the loaded radius, within the slip of the small drive."""
    begun = start(MOTORCYCLE, "leans")
    leans = begun["frame.roll"]
    assert begun.trim is not None
    for wheel in ("rear", "front"):
        assert begun.trim.unknowns[f"{wheel}.rolling.bearing.angle_rate"] * 0.3 == pytest.approx(15, rel=1e-2)
    wheels = (0.6 + 0.5) * 15 / 0.3 * 4 / 15 / (274 * 0.56 * G)
    assert -leans == pytest.approx(np.arctan(4 / G) + wheels * np.cos(leans) ** 2, rel=1e-2)
    motion = run(MOTORCYCLE, "leans", ("frame.roll", "frame.wz", "head.angle"))
    assert np.ptp(motion["frame.yaw"] - 4 / 15 * motion.t) < 1e-6
    asked = start(MOTORCYCLE, "by_angle")
    assert asked["frame.roll"] == pytest.approx(np.radians(20), rel=1e-9)
    run(MOTORCYCLE, "by_angle", ("frame.roll", "frame.wz"))


def test_the_iltis_on_softer_tyres() -> None:
    """The tyres' stiffness lowers the chassis; with the found one the static equilibrium, another solver's, has that height."""
    model = read_model(ROOT / "models" / "iltis.yaml")
    text = (ROOT / "models" / "iltis.yaml").read_text(encoding="utf-8")
    trim = "trim: {find: [tyre_stiffness], hold: {chassis.z: 0.558 m}}"
    scene = f"\n  lower: {{end: 1, positions: {{chassis_free.x: 0, chassis_free.y: 0}}, {trim}}}\n"
    stiffness = found(text + scene, "lower")["tyre_stiffness"]
    rest = find_equilibrium(model, scene="iavsd_equilibrium", parameters={"tyre_stiffness": stiffness})
    assert rest["chassis.z"] == pytest.approx(0.558, abs=1e-7)


@pytest.mark.parametrize(
    ("gap", "stiffness", "exponent"), [(0.0, 1e7, 1.5), (1e-6, 1e10, 1.0), (0.1, 1e5, 1.2), (0.3, 1e10, 1.5), (0.3, 1e3, 1.0)]
)
def test_a_table_on_feet_that_stick(gap: float, stiffness: float, exponent: float) -> None:
    """Four feet, of any gap, stiffness and exponent, a centre of mass beside the middle: an own balance; it stays where it is put."""
    text = TABLE.replace("gap: {value: 0,", f"gap: {{value: {gap!r},").replace("exponent: 1.5", f"exponent: {exponent}")
    state = start(text, "rest", k=stiffness)
    weight, centre = 20 * G, np.array([0.05, 0.02, 0.7])
    attitude = Rotation.from_euler("xyz", [state["top.roll"], state["top.pitch"], state["top.yaw"]])
    arms = attitude.apply(np.array([[x, y, gap] for x in (0.5, -0.5) for y in (0.3, -0.3)]) - centre)
    force = stiffness * np.maximum(-state["top.z"] - arms[:, 2], 0) ** exponent
    rough = 1e-8 + 1e-15 / (weight / 4 / stiffness) ** (1 / exponent)  # places have sixteen digits
    assert force.sum() == pytest.approx(weight, rel=rough)
    assert (force @ arms)[:2] == pytest.approx([0, 0], abs=rough * weight)
    assert state.trim is not None
    assert not state.trim.from_random_start
    assert [state[f"top.{name}"] for name in ("x", "y", "yaw")] == pytest.approx([0.05, 0.02, 0.0], abs=0.05)


def test_three_feet_of_unlike_stiffness_and_length() -> None:
    """Each foot bears what the lever rule gives it, tilted and far below the drawn pose."""
    feet, stiffness = np.array([[0.5, 0.3, 0.008], [0.5, -0.3, 0.0], [-0.5, 0.05, 0.004]]), np.array([3e5, 2e9, 4e6])
    text = TABLE.replace("[x, y]", "[x, y, z, s]").replace("[x, y, gap]", "[x, y, gap + z]").replace("stiffness: k", "stiffness: s")
    text = text.replace("gap: {value: 0,", "gap: {value: 0.2,").replace("parameters: {k: {value: 1e7, binding: param}, ", "parameters: {")
    lines = [f"  {n}: {{use: leg, connect: {{top: top}}, with: {{x: {x}, y: {y}, z: {z}, s: {s}}}}}\n" for n, (x, y, z), s in
             zip("abc", feet, stiffness, strict=True)]
    state = start(text[: text.index("  a: {use")] + "".join(lines) + text[text.index("outputs:") :], "rest")
    attitude = Rotation.from_euler("xyz", [state["top.roll"], state["top.pitch"], state["top.yaw"]])
    centre = np.array([0.05, 0.02, 0.7])
    points = attitude.apply(feet + np.array([0, 0, 0.2]) - centre)
    force = np.linalg.solve(np.vstack([np.ones(3), points[:, :2].T]), [20 * G, 0, 0])
    depth = -(points[:, 2] + state["top.z"])
    assert stiffness * depth**1.5 == pytest.approx(force, rel=1e-5)
