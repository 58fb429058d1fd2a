"""Tyres without lateral force, and guards of loads: they stop a run where what was left out would count."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import METHODS
from cutjoint.model.outcome import Outcome
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.guards import guard_forces
from cutjoint.reduce.sequence import SMALL, roll_straight
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp

#: A wheel on a cart that rolls along x; a guide moves it sideways, and the cart is held at its height.
CART = """\
cutjoint: 1
name: cart
gravity: [0, 0, -9.81]
parameters: {sway: {value: 0, unit: m, binding: input}}
bodies:
  cart: {mass: 100, centre_of_mass: [0, 0, 0.3], inertia: [10, 10, 10]}
  wheel: {mass: 20, centre_of_mass: [0, 0, 0.3], inertia: [1, 2, 1]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0.3], axis: [1, 0, 0]}
  slide: {kind: prismatic, bodies: [cart, wheel], at: [0, 0, 0.3], axis: [0, 1, 0], guide: sway}
forces:
  tyre:
    kind: tyre
    body: wheel
    centre: [0, 0, 0.3]
    axis: [0, 1, 0]
    radius: 0.31
    stiffness: 3.0e+5
    calspan: {A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11,
              SN: 1.0274, AF1: -1.71e-5, AF2: 1.71e-5}
outputs: [cart.x, wheel.y, tyre.Fy, tyre.Fz, tyre.slip]
scenes:
  straight: {end: 1, rates: {rail.displacement_rate: 5}, inputs: {sway: "0.001*sin(5*t)"}, numerics: {dt: 0.002}}
  turn: {end: 1, rates: {rail.displacement_rate: 5}, inputs: {sway: "0.2*t**3"}, numerics: {dt: 0.002}}
"""

#: A ball that a load catches above the floor, and that a wind takes from some time on.
BALL = """\
cutjoint: 1
name: ball
gravity: [0, 0, -9.81]
bodies: {ball: {mass: 1, centre_of_mass: [0, 0, 0.4], inertia: [0.1, 0.1, 0.1]}}
joints: {free: {kind: free, bodies: [ground, ball], at: [0, 0, 0.4]}}
forces:
  floor: {kind: load, body: ball, at: [0, 0, 0.4], force: [0, 0, "where(z < 0, -5000*z, 0)"]}
  wind: {kind: load, body: ball, at: [0, 0, 0.4], force: ["where(t > 3, 2*(t - 3), 0)", 0, 0], axes: body}
  brake: {kind: load, body: ball, torque: [0, "where(wy > 2, -(wy - 2), 0)", 0]}
  drag: {kind: load, body: ball, at: [0, 0, 0.4], force: ["-vx", "-vy", 0]}
outputs: [ball.x, ball.z, ball.wy, floor.Fz, wind.Fx, brake.My]
scenes:
  up: {end: 0.4, output_step: 0.002, rates: {free.vz: 3, free.wy: 1.9}, numerics: {dt: 0.002, solver_tolerance: 1.0e-9}}
  down: {end: 0.4, output_step: 0.002, rates: {free.vx: 1}, numerics: {dt: 0.002, solver_tolerance: 1.0e-9}}
"""


@cache
def cart() -> Model:
    return read_model_text(CART, "cart.yaml")


@cache
def ball() -> Model:
    return read_model_text(BALL, "ball.yaml")


def run(model: Model, scene: Scene, method: str = "recursive") -> Trajectory:
    return simulate(compile_interpreted(model, scene, method=method), check=False)


def words(outcome: Outcome) -> dict[str, str]:
    return {note.element: note.text for note in (*outcome.done, *outcome.left)}


def test_a_tyre_that_rolls_straight_loses_its_lateral_force() -> None:
    model, scene = cart(), cart().scenes["straight"]
    outcome = roll_straight(model, scene)
    full, rolling = run(model, scene), run(outcome.model, outcome.scene)
    peak = np.abs(full["tyre.Fy"]).max()
    assert words(outcome)["tyre"].startswith(f"loses its lateral force of up to {peak:.3g} N, guarded by |Fy| <= ")
    assert rolling.failure is None
    assert np.abs(rolling["tyre.Fy"]).max() == 0
    assert rolling["tyre.Fz"] == pytest.approx(full["tyre.Fz"], abs=1e-9)
    assert roll_straight(outcome.model, outcome.scene).done == ()


@pytest.mark.parametrize("method", METHODS)
def test_its_guard_trips_where_the_force_would_get_large(method: str) -> None:
    """The guide moves the wheel sideways, so that the force that is left out is the full model's."""
    reduced, turn = roll_straight(cart(), cart().scenes["straight"]).model, cart().scenes["turn"]
    full, stopped = run(cart(), turn, method), run(reduced, turn, method)
    limit = float(f"{SMALL * full['tyre.Fz'].max():.2g}")
    first = int(np.argmax(np.abs(full["tyre.Fy"]) > limit))
    assert 10 < first < len(full.t) - 1
    assert stopped.failure is not None
    assert stopped.failure.guards == ("tyre",)
    assert abs(stopped.failure.step - first) <= 1
    assert len(stopped.t) == pytest.approx(first, abs=2)


def test_a_tyre_that_is_pushed_sideways_keeps_it() -> None:
    outcome = roll_straight(cart(), cart().scenes["turn"])
    assert outcome.done == ()
    assert words(outcome)["tyre"].startswith("keeps its lateral force, which reaches ")


def test_the_slalom_keeps_its_lateral_forces() -> None:
    model = read_model(MODELS / "iltis.yaml")
    assert roll_straight(model, replace(model.scenes["simul3"], end=3.0)).done == ()


@pytest.mark.parametrize("method", METHODS)
def test_loads_that_do_not_act_are_guarded(method: str) -> None:
    model, scene = ball(), ball().scenes["up"]
    outcome = guard_forces(model, scene)
    assert [note.element for note in outcome.done] == ["floor", "wind", "brake"]
    assert words(outcome)["wind"] == "is taken out, guarded by 3 - t >= 0"
    full, reduced = run(model, scene, method), run(outcome.model, outcome.scene, method)
    assert reduced.failure is None
    for column in full.columns:
        assert reduced[column] == pytest.approx(full[column], abs=1e-8), column


@pytest.mark.parametrize("method", METHODS)
def test_the_guard_of_a_load_trips(method: str) -> None:
    model, scene = ball(), ball().scenes["down"]
    full, stopped = run(model, scene, method), run(guard_forces(model, scene).model, scene, method)
    first = int(np.argmax(full["floor.Fz"] != 0))
    assert 10 < first < len(full.t) - 1
    assert stopped.failure is not None
    assert stopped.failure.guards == ("floor",)
    assert abs(stopped.failure.step - first) <= 1
