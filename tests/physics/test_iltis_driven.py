"""The vehicle that drives itself, `models/iltis_driven.yaml`: what its manoeuvres have to do, and its balance of power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cutjoint.model.read import read_model
from cutjoint.model.records import Output
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_case
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp
from tests.physics.simulation import compile_scene, completed

pytestmark = [needs_cpp, pytest.mark.slow]

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")


def drive(scene: str, *, more: tuple[str, ...] = (), **choices: object) -> Trajectory:
    """A run of a scene, with columns besides its own."""
    model, chosen = find_case(read_model(MODELS / "iltis_driven.yaml"), scene)
    outputs = [Output(element=name.rpartition(".")[0], quantity=name.rpartition(".")[2], span=model.span) for name in more]
    chosen = replace(chosen, outputs=(*(chosen.outputs or model.outputs), *outputs))
    return completed(simulate(compile_scene(model, chosen), **{"error": False, **choices}))  # type: ignore[arg-type]


def stopped(run: Trajectory) -> float:
    """The way from the brake to rest, m."""
    assert np.abs(run["driver.motion.speed.value"][-100:]).max() < 0.05
    return float(np.hypot(run["chassis.x"][-1] - np.interp(0.5, run.t, run["chassis.x"]), run["chassis.y"][-1]))


def test_the_anti_lock_brake_stops_shorter_and_straight() -> None:
    """On 0.8 at the left and 0.3 at the right: by 5 % at least, and without turning; locked wheels let the car spin."""
    kept, locked = drive("mu_split"), drive("mu_split_locked")
    assert stopped(kept) < 0.95 * stopped(locked)
    assert np.abs(kept["chassis.yaw"]).max() < 0.1
    assert np.abs(locked["chassis.yaw"]).max() > 1
    moves = (kept.t > 1) & (kept["driver.motion.speed.value"] > 3)
    for corner in CORNERS:
        assert kept[f"{corner}.wheel.rolling.contact.spin"][moves].min() > 0
    assert locked["front_right.wheel.rolling.contact.spin"][(locked.t > 1) & (locked.t < 1.5)].max() < 5


def test_the_lane_is_changed() -> None:
    """ISO 3888-1: of a car 1.52 m wide the middle may be 0.2 m, 0.28 m and 0.35 m beside those of the lanes."""
    run = drive("lane_change")
    x, y = run["chassis.x"], run["chassis.y"]
    for begins, ends, middle, width in ((50, 65, 0, 0.2), (95, 120, 3.5, 0.28), (145, 160, 0, 0.35)):
        inside = (x > begins) & (x < ends)
        assert np.abs(y[inside] - middle).max() < width
    assert run["driver.motion.speed.value"].min() > 20


def test_a_step_of_the_steering_wheel_turns_the_car() -> None:
    """In the end it turns as its speed and its radius say."""
    run = drive("step_steer")
    last = run.t > 5
    assert run["driver.motion.sideways"][last] == pytest.approx((run["chassis.wz"] * run["driver.motion.speed.value"])[last], rel=0.01)
    assert run["chassis.wz"][-1] > 0.05
    loads = run["front_left.wheel.rolling.contact.Fz"], run["front_right.wheel.rolling.contact.Fz"]
    assert loads[1][-1] - loads[0][-1] > 1000


def test_a_start_uphill() -> None:
    """It rests by the hand brake, then climbs and does not roll back by more than 2 cm; its height is a fifth of its way."""
    run = drive("hill_start")
    x, z, load = run["chassis.x"], run["chassis.z"], run["front_left.wheel.rolling.contact.Fz"]
    stands = run.t <= 1
    assert np.ptp(x[stands]) < 5e-4  # the engine begins to idle
    assert np.ptp(load[stands]) < 20
    assert x.min() > -0.02
    assert x[-1] > 20
    assert z[-1] - z[0] == pytest.approx(0.2 * (x[-1] - x[0]), abs=0.02)


def test_a_road_that_winds_is_followed() -> None:
    """The middle of the car stays on the line of the road's file, by complex numbers, and at its height."""
    run = drive("winding_road")
    data = (MODELS / "winding.crg").read_text().partition("$" * 80 + "\n")[2].splitlines()
    phi, slope = np.array([[float(row[:10]), float(row[10:20])] for row in data[1:]]).T
    line = np.concatenate([[0], np.cumsum(2 * np.exp(1j * (phi - phi[0])))])
    height = np.concatenate([[0], np.cumsum(2 * slope)])
    way = np.linspace(0, len(phi), 20 * len(phi))
    fine, level = np.interp(way, np.arange(len(line)), line), np.interp(way, np.arange(len(line)), height)
    places = run["chassis.x"] + 1j * run["chassis.y"]
    nearest = np.array([np.argmin(abs(fine - place)) for place in places])
    on = places.real > 2
    assert abs(places - fine[nearest])[on].max() < 0.25
    assert (run["chassis.z"] - run["chassis.z"][0] - level[nearest])[on] == pytest.approx(0, abs=0.04)
    assert run["driver.motion.speed.value"][run.t > 15] == pytest.approx(12, abs=0.3)
    assert nearest[-1] / 20 * 2 > 400


def test_a_sine_with_dwell_is_measured_in_what_0_3_g_takes() -> None:
    """FMVSS 126, S7.6: a line through accelerations from 0.1 to 0.375 g while the angle grows slowly; A is 34 degrees."""
    run = drive("slow_steer", end=4.5)
    share, angle = run["driver.motion.sideways"] / 9.81, run["turned.value"]
    fit = (share > 0.1) & (run.t < run.t[np.argmax(share > 0.375)])
    slope, offset = np.polyfit(angle[fit], share[fit], 1)
    assert (0.3 - offset) / slope == pytest.approx(0.594, rel=0.02)


def test_stability_control_ends_the_turn() -> None:
    """FMVSS 126, S5.2: 35 % and 20 % of the first peak of the yaw rate 1 s and 1.75 s after the end of steer, and 1.83 m to the side."""
    run = drive("sine_with_dwell", end=4.8)
    later, last, way = (run[f"dwell.figures.{name}"][-1] for name in ("later", "last", "way"))
    assert abs(later) < 0.35
    assert abs(last) < 0.2
    assert way > 1.83
    ends, rate = 1.5 + 1 / 0.7, -run["chassis.wz"]
    first = np.flatnonzero((run.t > 1 + 0.5 / 0.7) & (np.gradient(rate) < 0) & (rate > 0.1))[0]
    assert later == pytest.approx(np.interp(ends + 1, run.t, rate) / rate[first], abs=0.02)
    assert way == pytest.approx(np.interp(2.075, run.t, run["chassis.y"]), abs=0.03)


def test_gears_are_changed() -> None:
    """From rest to 80 km/h through four gears, upwards alone; the speed is then held."""
    run = drive("drive", end=20)
    gears = run["selected.value"]
    assert list(np.unique(gears)) == [1, 2, 3, 4]
    assert np.diff(gears).min() == 0
    assert run["driver.motion.speed.value"][-1] == pytest.approx(22.2, abs=0.2)
    assert run["engine.speed.value"][-1] == pytest.approx(run["rear_left.wheel.rolling.contact.spin"][-1] * 5 * 1.07, rel=2e-3)


def test_power_balances() -> None:
    """Work of all forces is the gain of kinetic energy, within 1e-6 of all that was exchanged, over a gear and a slipping clutch."""
    run = drive("drive", end=2.5, error=True, tolerance=1e-5)
    assert run.energy is not None
    assert len(np.unique(run["selected.value"])) > 1
    assert run.energy.share < 1e-6


@pytest.mark.heavy
def test_power_balances_for_ten_minutes() -> None:
    """Over gears, clutch and air drag, and then at the speed that the driver holds."""
    run = drive("drive", end=600, error=True, tolerance=1e-5)
    assert run.energy is not None
    assert run["driver.motion.speed.value"][-1] == pytest.approx(22.2, abs=0.1)
    assert run.energy.share < 1e-6
