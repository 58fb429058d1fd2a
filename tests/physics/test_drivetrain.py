"""The library's drivetrain, brakes, air and driver against closed forms, and mathematics of their own.

Parts without bodies are driven by inputs; shafts are rotors in bearings of the ground.
"""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.special import betainc

from cutjoint.model.read import read_model_text
from cutjoint.package.locations import library_folder
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_case
from cutjoint.run.simulation import simulate
from tests.physics.simulation import compile_scene, completed

FRAME = """
cutjoint: 1
name: bench
gravity: [0, 0, 0]
parameters: {{a: {{value: 0, binding: input}}, b: {{value: 0, binding: input}}, c: {{value: 0, binding: input}}}}
bodies:
  first: {{mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.2, 0.2, 0.2]}}
  second: {{mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.6, 0.6, 0.6]}}
joints:
  one: {{kind: revolute, bodies: [ground, first], at: [0, 0, 0], axis: x}}
  two: {{kind: revolute, bodies: [ground, second], at: [0, 0, 0], axis: x}}
submodels: {{part: {{include: library/{part}}}}}
instances: {{part: {{use: part, {with_}}}}}
forces: {{{forces}}}
outputs: [one.angle_rate, two.angle_rate, one.angle, two.angle, {outputs}]
scenes: {{run: {{end: {end}, output_step: 0.01, {scene}}}}}
"""


def bench(part: str, with_: str, forces: str = "", outputs: str = "first.x", end: float = 1, scene: str = "") -> Trajectory:
    """A run of two rotors, of 0.2 and 0.6 kg m^2, with a part of the library."""
    text = FRAME.format(part=part, with_=with_, forces=forces, outputs=outputs, end=end, scene=scene)
    artifact = compile_scene(*find_case(read_model_text(text, "bench.yaml"), "run"))
    return completed(simulate(artifact, integrator="dormand-prince", tolerance=1e-8, error=False, events="crossed"))


CLUTCH = "with: {engine_speed: one.angle_rate, gearbox_speed: two.angle_rate, pedal: a, capacity: 30}"
TO_BOTH = (
    "brakes: {kind: joint_force, joint: one, law: -part.torque}, drives: {kind: joint_force, joint: two, law: part.torque}, "
    "pulls: {kind: joint_force, joint: two, law: b}"
)


def test_a_clutch_slips_at_its_capacity_and_then_sticks() -> None:
    """30 N m bring 100 rad/s of 0.2 kg m^2 and 0.6 kg m^2 at rest together in 100/(30 (1/0.2 + 1/0.6)) = 0.5 s, at 25 rad/s; the torque is
    built up within milliseconds."""
    run = bench("clutch", CLUTCH, TO_BOTH, "part.torque.value, part.friction.twist.value", scene="rates: {one.angle_rate: 100}")
    t, engine, box = run.t, run["one.angle_rate"], run["two.angle_rate"]
    assert 0.2 * engine + 0.6 * box == pytest.approx(20, rel=1e-7)
    slips = (t > 0.05) & (t < 0.45)
    assert run["part.torque.value"][slips] == pytest.approx(30, rel=1e-3)
    assert np.polyfit(t[slips], engine[slips], 1)[0] == pytest.approx(-150, rel=1e-3)
    assert engine[t > 0.9] - box[t > 0.9] == pytest.approx(0, abs=0.5)
    energy = 0.1 * engine**2 + 0.3 * box**2
    assert np.diff(energy).max() < 0.5 * 30 * 0.02  # J: no more than what the spring may give back


def test_a_clutch_that_sticks_does_not_creep() -> None:
    """Under 40 % of its capacity, forwards only and pulsing at 3 Hz, the angle between its halves is the same after each second."""
    run = bench(
        "clutch", CLUTCH, TO_BOTH, end=9, scene="lock: [one], inputs: {b: '6*(1 - cos(6*pi*t))'}"
    )
    whole = run["two.angle"][400::100]
    assert np.abs(run["two.angle"]).max() < 12 / 1500 * 1.5
    assert np.ptp(whole) < 1e-5


def test_a_pressed_clutch_lets_go() -> None:
    run = bench("clutch", CLUTCH, TO_BOTH, "part.torque.value", scene="rates: {one.angle_rate: 100}, inputs: {a: 1}")
    assert run["one.angle_rate"] == pytest.approx(100, abs=1e-9)


@pytest.mark.parametrize(("preload", "bias", "moved"), [(0, 0, 0), (20, 0, 20), (0, 0.3, 0.3 * 4 * 10), (1e9, 0, None)])
def test_differentials(preload: float, bias: float, moved: float | None) -> None:
    """Of 4 times 10 N m each output has half.  The slower one has what is `moved` more, the faster one as much less; a locked one
    turns both alike, by 40/0.8 rad/s^2.  Power is lost by what is moved alone."""
    given = f"with: {{torque: 10, left_speed: one.angle_rate, right_speed: two.angle_rate, preload: {preload}, bias: {bias}}}"
    forces = "left: {kind: joint_force, joint: one, law: part.left}, right: {kind: joint_force, joint: two, law: part.right}"
    run = bench("differential", given, forces, "part.left.value, part.right.value, part.shaft_speed.value")
    left, right, one, two = (run[name][20:] for name in ("part.left.value", "part.right.value", "one.angle_rate", "two.angle_rate"))
    assert left + right == pytest.approx(40, rel=1e-9)
    if moved is None:
        assert one - two == pytest.approx(0, abs=0.05)
        assert one[-1] == pytest.approx(50, rel=2e-3)
        return
    sticks = moved >= 10  # what the lighter rotor needs less than half of the torque, if both turn alike: 20 - 40 0.2/0.8
    if sticks:
        assert one - two == pytest.approx(0, abs=0.1)
        assert right - left == pytest.approx(20, abs=0.5)
    else:
        assert right - left == pytest.approx(2 * moved, abs=1e-6)
    lost = 10 * run["part.shaft_speed.value"][20:] - left * one - right * two
    assert lost == pytest.approx((right - left) / 2 * (one - two), abs=1e-9)


def test_a_differential_of_limited_slip_slips_beyond_its_limit() -> None:
    given = "with: {torque: 10, left_speed: one.angle_rate, right_speed: two.angle_rate, preload: 5}"
    forces = "left: {kind: joint_force, joint: one, law: part.left}, right: {kind: joint_force, joint: two, law: part.right}"
    run = bench("differential", given, forces, "part.left.value, part.right.value")
    assert run["part.right.value"][20:] == pytest.approx(25, abs=1e-3)
    assert run["one.angle_rate"][-1] == pytest.approx(15 / 0.2, rel=0.01)


def test_a_torque_converter_multiplies_at_stall_and_makes_no_power() -> None:
    scene = "lock: [two], drive: {one: '200*t'}"
    run = bench("torque_converter", "with: {pump_speed: one.angle_rate, turbine_speed: a}", outputs="part.pump.value, part.turbine.value",
                scene=f"{scene}, inputs: {{a: '400*t'}}")  # fmt: skip
    pump, turbine, ratio = run["part.pump.value"], run["part.turbine.value"], 2 * run.t
    assert (pump[0], turbine[0]) == (pytest.approx(0.0022 * 200**2), pytest.approx(2 * 0.0022 * 200**2))
    assert np.all(pump * 200 >= turbine * 200 * ratio - 1e-9)
    assert turbine[ratio > 0.86] == pytest.approx(pump[ratio > 0.86])
    assert pump[50] == pytest.approx(0, abs=1e-9)
    assert np.all(pump[ratio > 1.001] < 0)


def test_gears() -> None:
    given = "with: {gear: a, torque: 10, shaft_speed: 5}"
    run = bench("gearbox", given, outputs="part.ratio.value, part.output_torque.value, part.input_speed.value, part.in_gear.value",
                scene="inputs: {a: 6*t - 1}")  # fmt: skip
    whole = np.round(6 * run.t - 1)
    clear = np.abs(6 * run.t - 1 - whole) < 0.4
    ratio = np.array([0, 3.6, 2.1, 1.4, 1, 0.8, -3.4])[whole.astype(int)]
    assert run["part.ratio.value"][clear] == pytest.approx(ratio[clear])
    assert run["part.output_torque.value"][clear] == pytest.approx(10 * ratio[clear])
    assert run["part.input_speed.value"][clear] == pytest.approx(5 * ratio[clear])
    assert run["part.in_gear.value"][clear] == pytest.approx(1.0 * (whole != 0)[clear])


def test_an_engine_has_the_torque_of_its_map() -> None:
    """Free, at the places of the table; it idles where the governor holds its own drag."""
    table = yaml.safe_load((library_folder() / "engine.yaml").read_text())["signals"]["map"]["table"]
    more = "part.speed.value, part.moment.force"
    driven = bench("engine", "connect: {chassis: ground}, with: {throttle: a, load: 0}", outputs=more, scene=(
        "drive: {part.turns: '100*t'}, inputs: {a: 0.5}"))  # fmt: skip
    assert driven["part.moment.force"][[0, -1]] == pytest.approx(200 * table["value"][2][2], rel=1e-9)
    idles = bench("engine", "connect: {chassis: ground}, with: {throttle: 0, load: 0}", outputs=more, end=20, scene=(
        "rates: {part.turns.angle_rate: 300}"))  # fmt: skip
    assert 70 < idles["part.speed.value"][-1] < 90
    assert idles["part.moment.force"][-1] == pytest.approx(0, abs=0.1)


def test_brakes_have_their_bias() -> None:
    run = bench("brakes", "with: {pedal: a, hand: b}", outputs="part.front.value, part.rear.value", scene="inputs: {a: t, b: 0.5}")
    assert run["part.front.value"] == pytest.approx(run.t * 6000 * 0.65 / 2)
    assert run["part.rear.value"] == pytest.approx(run.t * 6000 * 0.35 / 2 + 750)


def test_the_air_slows_a_body_by_the_square_of_its_speed() -> None:
    """m v' = -k v^2: v = v0/(1 + k v0 t/m), whatever way the body looks; lift is the same with another area."""
    text = """
cutjoint: 1
name: falls
gravity: [0, 0, 0]
bodies: {hull: {mass: 3, centre_of_mass: [0, 0, 0.5], inertia: [1, 1, 1]}}
joints: {rail: {kind: prismatic, bodies: [ground, hull], at: [0, 0, 0.5], axis: x}}
submodels: {air: {include: library/aero}}
instances: {air: {use: air, connect: {chassis: hull}, with: {lift_rear: -0.5}}}
outputs: [hull.vx, air.lifts_rear.Fz]
scenes: {run: {end: 2, output_step: 0.1, rates: {rail.displacement_rate: 50}}}
"""
    model = read_model_text(text, "air.yaml")
    run = completed(simulate(compile_scene(model, model.scenes["run"]), integrator="dormand-prince", tolerance=1e-10, error=False))
    assert run["hull.vx"] == pytest.approx(50 / (1 + 0.6 * 0.7 * 50 * run.t / 3), rel=1e-8)
    assert run["air.lifts_rear.Fz"] == pytest.approx(-0.6 * 0.5 * run["hull.vx"] ** 2, rel=1e-9)


def free_run(body: str, parts: str) -> Trajectory:
    """The run of a body that moves freely, and other parts of its model."""
    text = f"""
cutjoint: 1
name: dot
gravity: [0, 0, 0]
bodies: {{{body}: {{mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}}}
joints: {{moves: {{kind: free, bodies: [ground, {body}], at: [0, 0, 0]}}}}
{parts}"""
    model = read_model_text(text, "dot.yaml")
    return completed(simulate(compile_scene(model, model.scenes["run"]), integrator="dormand-prince", tolerance=1e-9, error=False))


def test_the_driver_beside_scipy() -> None:
    """A body that turns as it is steered and slides little: a circle of 40 m at 8 m/s, with a steering that gives half of what is asked."""
    parts = """
submodels: {driver: {include: library/driver}}
instances:
  driver: {use: driver, connect: {chassis: chassis}, with: {wanted: 8, beside: "40 - sqrt(driver.px**2 + (driver.py - 40)**2)"}}
forces:
  pushes: {kind: load, body: chassis, at: [0, 0, 0], axes: body, force: [4*(driver.throttle - driver.brake), -20*driver.motion.drift, 0]}
  turns: {kind: load, body: chassis, axes: body, torque: [0, 0, 10*(driver.motion.speed*driver.steer/5 - driver.motion.yaw_rate)]}
outputs: [chassis.x, chassis.y, driver.motion.speed.value, driver.steer.value]
scenes: {run: {end: 40, output_step: 0.5, rates: {moves.vx: 2}}}
"""
    found = free_run("chassis", parts)

    def rates(_: float, y: np.ndarray) -> list[float]:
        x, side, yaw, vx, vy, turn, steer, trim = y
        v, drift = vx * np.cos(yaw) + vy * np.sin(yaw), vy * np.cos(yaw) - vx * np.sin(yaw)
        reach, needs = 3 + 0.6 * max(v, 0), 2.5 * (1 + 0.005 * v**2)
        course = yaw + np.arctan(drift / max(abs(v), 1)) + reach / 2 * (0.7 * turn / max(v, 1) + 0.3 * steer / needs)
        off = 40 - np.hypot(x + reach * np.cos(course), side + reach * np.sin(course) - 40)
        asked = np.clip(steer - 2 * needs * off / reach**2, -0.5, 0.5)
        statistics = 0.4 * (8 - v) + trim
        along, across = 4 * np.clip(statistics, -1, 1), -20 * drift
        trims = 0.1 * (8 - v) * np.clip(11 - 10 * abs(statistics), 0, 1)
        return [vx, vy, turn, along * np.cos(yaw) - across * np.sin(yaw), along * np.sin(yaw) + across * np.cos(yaw),
                10 * (v * steer / 5 - turn), (asked - steer) * max(v, 0) / (0.04 * max(v, 0) + 0.6), trims]  # fmt: skip

    expected = solve_ivp(rates, (0, 40), [0, 0, 0, 2, 0, 0, 0, 0], t_eval=found.t, rtol=1e-9, atol=1e-9, max_step=0.02).y
    assert found["chassis.x"] == pytest.approx(expected[0], abs=1e-4)
    assert found["chassis.y"] == pytest.approx(expected[1], abs=1e-4)
    assert found["driver.steer.value"] == pytest.approx(expected[6], abs=1e-5)
    assert np.hypot(found["chassis.x"], found["chassis.y"] - 40)[40:] == pytest.approx(40, abs=0.2)


def test_the_motion_of_a_body_and_the_path_of_a_lane_change() -> None:
    """A body that drives east with its nose to the north-east, on a circle; the lanes of ISO 3888-1 begin 50, 95 and 145 m on."""
    parts = """
submodels: {motion: {include: library/motion}, path: {include: library/lane_change}}
instances: {motion: {use: motion, connect: {body: dot}}, path: {use: path, with: {x: moves.x}}}
forces: {pulls: {kind: load, body: dot, at: [0, 0, 0], force: [0, 2, 0]}}
outputs: [dot.x, motion.speed.value, motion.drift.value, motion.side_slip.value, motion.yaw_rate.value, path.side.value]
scenes:
  run: {end: 4, output_step: 0.5, rates: {moves.vx: 50, moves.wz: 0.3}, positions: {moves.attitude: {euler: [0.5, 0, 0], order: zyx}}}
"""
    run = free_run("dot", parts)
    yaw = 0.5 + 0.3 * run.t
    along, across = 50 * np.cos(yaw) + 2 * run.t * np.sin(yaw), 2 * run.t * np.cos(yaw) - 50 * np.sin(yaw)
    assert run["motion.speed.value"] == pytest.approx(along, rel=1e-7)
    assert run["motion.drift.value"] == pytest.approx(across, rel=1e-7)
    assert run["motion.side_slip.value"] == pytest.approx(np.arctan2(across, along), rel=1e-7)
    assert run["motion.yaw_rate.value"] == pytest.approx(0.3)
    assert run["motion.sideways"] == pytest.approx(2 * np.cos(yaw), rel=1e-6)
    smooth = [betainc(3, 3, np.clip((run["dot.x"] - begin) / length, 0, 1)) for begin, length in ((65, 30), (120, 25))]
    assert run["path.side.value"] == pytest.approx(3.5 * (smooth[0] - smooth[1]), abs=1e-9)
    assert run["path.side.value"][4] == pytest.approx(3.5)


def test_a_path_is_by_its_heading() -> None:
    """A circle, beside which a point goes straight on: by the angle at its centre, apart from how far its place lags."""
    parts = """
submodels: {path: {include: library/path}}
instances: {path: {use: path, with: {heading: path.along/40, px: moves.x, py: moves.y, speed: moves.vx, reach: 0.02}}}
outputs: [dot.x, path.along.value, path.at_x.value, path.at_y.value, path.beside.value]
scenes:
  run: {end: 4, output_step: 0.25, rates: {moves.vx: 10}, positions: {moves.x: 3, moves.y: 5}}
"""
    run = free_run("dot", parts)
    x, behind = run["dot.x"][1:], 35
    assert run["path.beside.value"][1:] == pytest.approx(40 - np.hypot(x, behind), abs=5e-6)  # (0.02 m)^2 over the diameter
    assert run["path.along.value"][1:] == pytest.approx(40 * np.arctan2(x, behind), abs=0.02)
    assert np.hypot(run["path.at_x.value"], run["path.at_y.value"] - 40) == pytest.approx(40, abs=1e-7)


QUARTER = """
cutjoint: 1
name: quarter
gravity: [0, 0, 0]
parameters:
  on: {value: 1, binding: param}
  slope: {value: 12, binding: param}                          # of the force over the slip, by the load
  shape: {value: 1.5, binding: param}
  grip: {value: 1, binding: param}
bodies:
  car: {mass: 400, centre_of_mass: [0, 0, 0.5], inertia: [1, 1, 1]}
  wheel: {massless: true, centre_of_mass: [0, 0, 0.3], inertia: {axial: 1, axis: y}}
joints:
  rail: {kind: prismatic, bodies: [ground, car], at: [0, 0, 0.5], axis: x}
  hub: {kind: revolute, bodies: [car, wheel], at: [0, 0, 0.3], axis: y}
submodels: {anti_lock: {include: library/anti_lock}}
instances:
  protected:
    {use: anti_lock, with: {wanted: pedal, rolling: 0.3*hub.angle_rate, speed: rail.displacement_rate, inertia: 1, radius: 0.3}}
states: {clock: {start: 0, rate: 1}}
signals:
  pedal: 2000*min(10*clock, 1)
  slip: 1 - 0.3*hub.angle_rate/max(rail.displacement_rate, 0.5)
  brakes: 4000*grip*sin(shape*atan(slope/grip/shape*slip))
  moment: "where(on > 0, protected.brake, pedal)"
forces:
  road: {kind: joint_force, joint: rail, law: -brakes}
  turns: {kind: joint_force, joint: hub, law: "0.3*brakes - moment*min(max(hub.angle_rate, -1), 1)"}
outputs: [rail.displacement, rail.displacement_rate, hub.angle_rate, slip.value, brakes.value]
scenes: {run: {end: 6, output_step: 0.01, rates: {rail.displacement_rate: 25, hub.angle_rate: 25/0.3}, numerics: {events: crossed}}}
"""


def test_an_anti_lock_brake_finds_the_slip_of_any_tyre() -> None:
    """Soft and stiff tyres, dry and wet: near the most that the tyre can do, shorter than locked, wherever the peak lies."""
    artifact = compile_scene(*find_case(read_model_text(QUARTER, "quarter.yaml"), "run"))
    slips = np.linspace(0, 1, 10001)
    for slope, shape, grip in ((10, 1.5, 1), (12, 1.5, 0.6), (25, 1.65, 1), (25, 1.65, 0.5), (40, 1.65, 1)):
        given = {"slope": slope, "shape": shape, "grip": grip}
        ways = []
        for on in (1, 0):
            run = completed(simulate(artifact, parameters={**given, "on": on}, tolerance=1e-5, error=False))
            braking = np.interp([3, 20], run["rail.displacement_rate"][::-1], run["rail.displacement"][::-1])
            ways.append(braking[0] - braking[1])
        best = (20**2 - 3**2) / 2 / (10 * grip * np.sin(shape * np.arctan(slope / grip / shape * slips)).max())
        assert ways[0] < 0.97 * ways[1]
        assert ways[0] < 1.05 * best


def test_gears_change_by_the_speed_of_the_engine() -> None:
    scene = "inputs: {a: 'where(t < 2, 300, where(t < 2.05, 450, where(t < 4, 300, where(t < 4.05, 100, 300))))'}"
    reported = "part.box.chosen, part.clutch.value, part.throttle.value"
    run = bench("gear_changes", "with: {engine_speed: a, gas: 0.7}", outputs=reported, end=6, scene=scene)
    chosen, t = run["part.box.chosen"], run.t
    assert [chosen[np.searchsorted(t, at)] for at in (1.9, 2.5, 3.9, 4.5)] == [1, 2, 2, 1]
    pressed = (t > 2.05) & (t < 2.2)
    assert run["part.clutch.value"][pressed] == pytest.approx(1)
    assert run["part.throttle.value"][pressed] == pytest.approx(0)
    assert run["part.throttle.value"][t < 1.9] == pytest.approx(0.7)
