"""One true statement about each everyday model of models/, by mathematics that the compiler does not use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from cutjoint.model.read import read_model
from cutjoint.model.records import Output
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

Array = NDArray[np.float64]

GRAVITY = 9.81


def run(name: str, scene: str, *, step: float | None = None, outputs: Sequence[str] = (), **parameters: float) -> Trajectory:
    """A run of a scene with the steps that follow from its accuracy, and columns besides its own."""
    model = read_model(MODELS / f"{name}.yaml")
    chosen = model.scenes[scene]
    more = [Output(element=column.rpartition(".")[0], quantity=column.rpartition(".")[2], span=model.span) for column in outputs]
    chosen = replace(chosen, output_step=step or chosen.output_step, outputs=(*chosen.outputs, *more))
    return simulate(compile_scene(model, chosen), parameters=parameters, error=False)


def weight(name: str, *, without: Sequence[str] = ()) -> float:
    """The weight of a model's bodies, N."""
    return GRAVITY * sum(float(body.mass) for body in read_model(MODELS / f"{name}.yaml").bodies if body.name not in without)


def zeros(t: Array, values: Array) -> Array:
    """Times at which a column changes its sign, between rows."""
    at = np.flatnonzero(values[:-1] * values[1:] < 0)
    return t[at] - values[at] * (t[at + 1] - t[at]) / (values[at + 1] - values[at])


def turned(point: Array, about: Array, angle: Array) -> Array:
    """A point turned about an axis -y through another one, by angles."""
    (x, _, z), sine, cosine = point - about, np.sin(angle), np.cos(angle)
    return about + np.stack([x * cosine - z * sine, 0 * angle, x * sine + z * cosine], axis=1)


def test_the_press_moves_its_slider_as_crank_and_rod_say() -> None:
    table = run("press", "turn")
    angle, rod = table["pin.angle"], np.hypot(0.3, 0.1)
    assert table["slider.x"] == pytest.approx(0.1 * np.sin(angle) + np.sqrt(rod**2 - (0.1 * np.cos(angle)) ** 2), abs=1e-9)


@pytest.mark.parametrize("scene", ["bump", "chirp"])
def test_the_axle_stands_on_its_weight(scene: str) -> None:
    table = run("axle", scene)
    assert table["left.tyre.force"][0] + table["right.tyre.force"][0] == pytest.approx(weight("axle", without=("pad_l", "pad_r")), rel=1e-6)


def test_the_car_comes_to_stand_on_its_weight() -> None:
    table = run("car", "drop")
    corners = ("front_left", "front_right", "rear_left", "rear_right")
    assert sum(table[f"{corner}.tyre.Fz"][-1] for corner in corners) == pytest.approx(weight("car"), rel=1e-3)
    assert np.abs(table["chassis.roll"]).max() < 1e-9


def test_the_excavators_cylinders_are_as_long_as_its_angles_say() -> None:
    table = run("excavator", "hold")
    lengths = (
        ("bc_slide", "boom_foot", [0, 0, 1.5], [0.4, 0, 1.0], [2.4, 0, 3.1]),
        ("sc_slide", "stick_pin", [5, 0, 3.5], [2.6, 0, 3.7], [4.7, 0, 4.2]),
    )
    for slide, pin, *points in lengths:
        about, base, end = map(np.array, points)
        length = np.linalg.norm(turned(end, about, table[f"{pin}.angle"]) - base, axis=1)
        assert table[f"{slide}.displacement"] == pytest.approx(length - np.linalg.norm(end - base), abs=1e-9)


def test_the_platforms_legs_are_as_long_as_its_height_says() -> None:
    table = run("stewart", "step")
    aside = 0.6**2 + 0.35**2 - 2 * 0.6 * 0.35 * np.cos(np.radians(40))
    length = np.sqrt(aside + table["platform.z"] ** 2)
    for leg in range(1, 7):
        assert table[f"l{leg}.slide.displacement"] == pytest.approx(length - np.sqrt(aside + 0.8**2), abs=1e-8)


def test_the_delta_robots_plate_is_where_its_motors_say() -> None:
    """Six rods of one length hold a plate that stays level."""
    table = run("delta", "circle")
    low = np.sqrt(0.25**2 - 0.14**2)
    place = np.stack([table[f"plate.{axis}"] for axis in "xyz"], axis=1)
    for leg in range(3):
        turn, angle = 2 * np.pi * leg / 3, table[f"l{leg + 1}.motor.angle"]
        out, across = np.array([np.cos(turn), np.sin(turn), 0]), np.array([-np.sin(turn), np.cos(turn), 0])
        reach, height = 0.14 * np.cos(angle) - low * np.sin(angle), -0.14 * np.sin(angle) - low * np.cos(angle)
        elbow = np.outer(0.2 + reach, out) + np.outer(height, [0, 0, 1])
        for side in (-0.04, 0.04):
            rod = place + 0.05 * out + side * across - elbow - side * across
            assert np.linalg.norm(rod, axis=1) == pytest.approx(np.hypot(0.29, 0.45 - low), abs=1e-8)


def test_the_six_bar_returns_as_much_faster_as_its_crank_says() -> None:
    """The lever turns back where crank and lever are square: the times of both strokes are as 180 degrees more and less twice its swing."""
    table = run("six_bar", "turn", step=1e-3)
    swing = np.arcsin(0.1 / 0.25)
    strokes = np.diff(zeros(table.t, table["ram.vx"])[:3])
    assert strokes.max() / strokes.min() == pytest.approx((np.pi + 2 * swing) / (np.pi - 2 * swing), rel=1e-4)
    assert table["ram.x"].max() - table["ram.x"].min() == pytest.approx(2 * 0.5 * np.sin(swing), rel=1e-3)


def test_the_ground_gives_the_leg_what_it_gains_in_momentum() -> None:
    table = run("leg", "drop", step=1e-4, outputs=("trunk.vz", "thigh.vz", "shank.vz"))
    gained = 8 * table["trunk.vz"][-1] + 0.9 * table["thigh.vz"][-1] + 0.4 * table["shank.vz"][-1]
    force = table["foot.Fz"]
    given = np.sum(np.diff(table.t) * (force[1:] + force[:-1]) / 2)
    assert given - weight("leg") * table.t[-1] == pytest.approx(gained, abs=1e-3 * weight("leg"))


def test_the_gantrys_load_hangs_still_after_ramps_of_a_period() -> None:
    """The rest of the largest angle is the phase that two ramps are off: gravity and acceleration together shorten the period by a
    quarter of the square of a/g, the swing's width lengthens it by a sixteenth."""
    off = 2 * np.pi * (1 / 4 - 1 / 16) * (0.3 / GRAVITY) ** 2
    left = {}
    for ramp in (5.717, 4.0):
        table = run("gantry", "carry", ramp=ramp)
        angle = np.abs(table["rope.angle"])
        left[ramp] = angle[table.t > 14].max() / angle.max()
    assert 0 < left[5.717] < 1.1 * off
    assert left[4.0] > 0.1
