"""The Iltis against the published values of the IAVSD benchmark (Robotran model, 18c4286)."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from cutjoint.model.read import read_model
from cutjoint.run.results import Trajectory
from cutjoint.tasks.states import find_equilibrium
from cutjoint.topology.build import build_topology
from cutjoint_bench.export.starts import find_start
from tests.conftest import DATA, MODELS, with_heavy
from tests.physics.simulation import compile_model, compile_text, completed, read_reference, simulate

ILTIS = MODELS / "iltis.yaml"

#: Static equilibrium: front and rear values, N and m.
EQUILIBRIUM = {
    "tyre.Fz": (3831.31, 3591.91), "shock.force": (-335.29, -241.64), "leaf.force": (3068.62, 2885.51),
    "leaf_axial.force": (-1408.51, -1335.52),
}  # fmt: skip


def test_static_equilibrium() -> None:
    found = find_equilibrium(ILTIS, scene="iavsd_equilibrium")
    assert found["chassis.z"] - 0.570 == pytest.approx(-7.083e-3, abs=5e-6)
    assert math.degrees(found["chassis.pitch"]) == pytest.approx(0.1465, abs=5e-4)
    for quantity, (front, rear) in EQUILIBRIUM.items():
        for corner, expected in (("front_left", front), ("front_right", front), ("rear_left", rear), ("rear_right", rear)):
            assert found[f"{corner}.{quantity}"] == pytest.approx(expected, abs=0.5), (corner, quantity)
    assert found["front_left.shock.length"] == pytest.approx(0.4348738, abs=5e-6)
    assert found["rear_left.shock.length"] == pytest.approx(0.4379429, abs=5e-6)


def test_nothing_strays_along_directions_without_stiffness() -> None:
    """The car may stand at any yaw: every simulator leaves it at that of the given pose, to the digits of differences by 1e-5."""
    assert find_equilibrium(ILTIS, scene="iavsd_equilibrium")["chassis.yaw"] == pytest.approx(0, abs=1e-9)
    model = read_model(ILTIS)
    starts, _ = find_start(build_topology(model), model.scenes["iavsd_inphase_5"], {})  # by interpretation
    assert starts["chassis"].rotation[1, 0] == pytest.approx(0, abs=1e-9)


def test_nominal_forces(tmp_path: Path) -> None:
    """In the design position, before anything moves."""
    text = ILTIS.read_text().replace("    pose: equilibrium\n", "    pose: design\n")
    run = completed(simulate(compile_text(tmp_path, text, "iavsd_equilibrium"), dt=1e-3, end=1e-3))
    nominal = {"leaf.force": (2728.9, 2728.9), "shock.force": (-128.0, -128.0), "tyre.Fz": (3829.6, 3593.6)}
    for quantity, (front, rear) in nominal.items():
        assert run[f"front_right.{quantity}"][0] == pytest.approx(front, abs=0.1)
        assert run[f"rear_left.{quantity}"][0] == pytest.approx(rear, abs=0.1)


def check(
    run: Trajectory, reference: dict[str, np.ndarray], tyres: dict[str, str], limits: dict[str, float], load: str = "tyre.Fz"
) -> None:  # fmt: skip
    """Largest differences of the chassis in m and degrees, tyre loads within 1 % of the largest load."""
    for column, limit in limits.items():
        limit = limit if column in "xyz" else math.radians(limit)
        found = np.interp(reference["t"], run.t, run[f"chassis.{column}"])
        assert np.abs(found - reference[column]).max() < limit, column
    for corner, column in tyres.items():
        found = np.interp(reference["t"], run.t, run[f"{corner}.{load}"])
        assert np.abs(found - reference[column]).max() < 0.01 * reference[column].max(), corner


#: The reference's wheels: front a is the right one, rear a the left one.
WHEELS = {"front_right": "Fz_front_a", "front_left": "Fz_front_b", "rear_left": "Fz_rear_a", "rear_right": "Fz_rear_b"}


def check_in_phase_bump(run: Trajectory) -> None:
    limits = {"x": 1e-4, "y": 1e-6, "z": 5e-5, "pitch": 0.003, "roll": 1e-5, "yaw": 1e-5}
    check(run, read_reference(DATA / "iavsd_inphase_5ms.csv"), WHEELS, limits)


#: A method, and whether suspensions are evaluated side by side; `augmented` and `classical` are in test_lagrangian.py.
MODES = [("recursive", True), ("recursive", False), ("recursive-newton", True)]


@pytest.mark.parametrize(("method", "lanes"), with_heavy(MODES, *MODES[1:]))
def test_in_phase_bump(method: str, lanes: bool) -> None:
    check_in_phase_bump(completed(simulate(compile_model(ILTIS, scene="iavsd_inphase_5", method=method, lanes=lanes))))


#: The reference turns roll, pitch, yaw in the opposite order, which shows in the pitch of a rolled car; y is 0.77 m at the end.
SINE_STEER = {"x": 1e-4, "y": 3e-4, "z": 2e-6, "pitch": 0.015, "roll": 0.006, "yaw": 0.0005}


def test_sine_steer() -> None:
    run = completed(simulate(compile_model(ILTIS, scene="iavsd_sine_2mm")))
    check(run, read_reference(DATA / "iavsd_sine_steer_2mm.csv"), WHEELS, SINE_STEER)


def test_sine_steer_needs_the_spin_of_the_wheels(tmp_path: Path) -> None:
    """Without their gyroscopic moment the car ends 8 mm to the side of the reference."""
    text = ILTIS.read_text().replace("spin_inertia: 1.908", "spin_inertia: 0")
    run = completed(simulate(compile_text(tmp_path, text, "iavsd_sine_2mm")))
    reference = read_reference(DATA / "iavsd_sine_steer_2mm.csv")
    found = np.interp(reference["t"], run.t, run["chassis.y"])
    assert np.abs(found - reference["y"]).max() == pytest.approx(8.3e-3, rel=0.1)


#: The carrier without its wheel, and the wheel in a bearing of it, in place of the element `tyre`.
CARRIER = """      carrier:
        mass: 37.35
        centre_of_mass: C
        inertia: [0.2402, 0, 0.2402]
"""
#: The reference's tyre has no force along the wheel, and its slip is that of the wheel's centre: the contact's without the carrier's roll.
TURNING = """    submodels:
      wheel: {include: library/wheel_calspan}
    instances:
      wheel:
        use: wheel
        connect: {carrier: carrier}
        with:
          {x: x_hinge, y: 0.615, z: 0.356, radius: tyre_radius, mass: 20, spin_inertia: 1.908, cross_inertia: 1, stiffness: tyre_stiffness,
           slip_stiffness: 0, A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11, SN: 1.0274,
           AF1: -1.71e-5, AF2: 1.71e-5,
           sideways: -wheel.contact.loaded_radius*(cos(carrier.yaw)*carrier.wx + sin(carrier.yaw)*carrier.wy)}
"""


def turning_iltis() -> str:
    """The Iltis with wheels that turn in bearings, driven by nothing, with steady slip."""
    text = re.sub(r"      tyre:\n        kind: tyre\n(        .*\n|  +SN: .*\n)+", TURNING, ILTIS.read_text())
    text = re.sub(r"      carrier:\n(        .*\n)+", CARRIER, text, count=1)
    rates = "".join(
        f", {corner}.wheel.bearing.angle_rate: {20 / radius}"
        for corner, radius in (("front_left", 0.364325), ("front_right", 0.364325), ("rear_left", 0.363812), ("rear_right", 0.363812))
    )
    text = text.replace("rates: {chassis_free.vx: 20}", f"rates: {{chassis_free.vx: 20{rates}}}")
    return text.replace("tyre.Fz, tyre.Fy, tyre.slip", "wheel.contact.Fz, wheel.contact.Fy, wheel.contact.vy")


def test_sine_steer_on_wheels_that_turn(tmp_path: Path) -> None:
    """Spin and slip as coordinates: the gyroscopic moments are the wheels' own, no `spin_inertia` stands for them."""
    run = completed(simulate(compile_text(tmp_path, turning_iltis(), "iavsd_sine_2mm")))
    reference = read_reference(DATA / "iavsd_sine_steer_2mm.csv")
    check(run, reference, WHEELS, {**SINE_STEER, "y": 9e-5}, load="wheel.contact.Fz")
