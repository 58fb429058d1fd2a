"""Motions whose forces change their formulas, beside the bouncing mass: their models and how they move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]

TABLE = """
cutjoint: 1
name: knots
gravity: [0, 0, 0]
bodies:
  mass: {mass: 1, centre_of_mass: [0, 0, 0]}
joints:
  slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}
forces:
  spring:
    kind: joint_force
    joint: slide
    law: {table: {position: [-1, -0.4, 0.1, 0.3, 1], value: [90, 25, -1, -40, -60]}}
outputs: [mass.x, mass.vx]
scenes:
  swing: {end: 3, output_step: 0.1, positions: {slide.displacement: 0.9}}
"""


def swing_over_knots(times: Array) -> Array:
    """Places by SciPy: from knot to knot with the cubic of one piece, which goes on smoothly beyond its ends."""
    knots = np.array([-1, -0.4, 0.1, 0.3, 1])
    pieces = PchipInterpolator(knots, [90, 25, -1, -40, -60]).c
    piece, begin, state, places = 3, 0.0, np.array([0.9, 0.0]), np.empty(len(times))
    while begin < times[-1]:
        def pull(_: float, y: Array, piece: int = piece) -> list[float]:
            return [y[1], np.polyval(pieces[:, piece], y[0] - knots[piece])]

        def below(_: float, y: Array, piece: int = piece) -> float:
            return float(y[0] - knots[piece])

        def above(_: float, y: Array, piece: int = piece) -> float:
            return float(y[0] - knots[piece + 1])

        below.terminal = above.terminal = True  # type: ignore[attr-defined]
        below.direction, above.direction = -1, 1  # type: ignore[attr-defined]
        ahead = solve_ivp(pull, (begin, times[-1] + 1e-6), state, method="DOP853", rtol=1e-13, atol=1e-14, dense_output=True,
                          events=[below, above])  # fmt: skip
        inside = (times >= begin) & (times <= ahead.t[-1])
        if inside.any():
            places[inside] = ahead.sol(times[inside])[0]
        begin, state, piece = ahead.t[-1], ahead.y[:, -1], piece + (1 if len(ahead.t_events[1]) else -1)
    return places


RAMP, SPEED, MASS, STIFFNESS, RADIUS = 0.02, 5.0, 30.0, 2e4, 0.3

WHEEL = f"""
cutjoint: 1
name: wheel
gravity: [0, 0, -9.81]
parameters:
  along: {{value: 0, unit: m, binding: input}}
bodies:
  carriage: {{massless: true}}
  hub: {{mass: {MASS}, centre_of_mass: [0, 0, {RADIUS}]}}
joints:
  drive: {{kind: prismatic, bodies: [ground, carriage], at: [0, 0, 0], axis: [1, 0, 0], guide: along}}
  lift: {{kind: prismatic, bodies: [carriage, hub], at: [0, 0, {RADIUS}], axis: [0, 0, 1]}}
forces:
  tyre:
    kind: tyre
    body: hub
    centre: [0, 0, {RADIUS}]
    axis: [0, 1, 0]
    radius: {RADIUS}
    stiffness: {STIFFNESS}
    calspan: {{A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11,
              SN: 1.0274, AF1: -1.71e-5, AF2: 1.71e-5}}
outputs: [hub.z, tyre.Fz]
scenes:
  ride:
    end: 1
    output_step: 0.05
    positions: {{lift.displacement: {-MASS * 9.81 / STIFFNESS}}}
    inputs: {{along: "{SPEED}*t"}}
    road: {{start: 1.03, profile: [{{ramp: 1.7, rise: {1.7 * RAMP}}}, {{flat: 0.4}}, {{ramp: 0.9, rise: {-0.9 * RAMP}}}]}}
"""


def wheel_heights(times: Array) -> Array:
    """Heights of the hub of WHEEL at ascending times: on a straight piece of road it swings freely over it; piece after piece is joined."""
    begins, slopes = np.array([0, 1.03, 2.73, 3.13, 4.03, 6]) / SPEED, (0.0, RAMP, 0.0, -RAMP, 0.0)
    heights = np.empty(len(times))
    z, v = RADIUS - MASS * 9.81 / STIFFNESS, 0.0
    ground = 0.0
    for begin, end, slope in zip(begins[:-1], begins[1:], slopes, strict=True):
        k = STIFFNESS / (1 + slope**2)
        w, rest = np.sqrt(k / MASS), RADIUS - MASS * 9.81 / k
        a, b = z - ground - rest, (v - SPEED * slope) / w
        now = (times >= begin - 1e-12) & (times <= end + 1e-12)
        s = times[now] - begin
        heights[now] = ground + SPEED * slope * s + rest + a * np.cos(w * s) + b * np.sin(w * s)
        s = end - begin
        ground += SPEED * slope * s
        z, v = ground + rest + a * np.cos(w * s) + b * np.sin(w * s), SPEED * slope + w * (b * np.cos(w * s) - a * np.sin(w * s))
    return heights


PULSES = """
cutjoint: 1
name: pulses
gravity: [0, 0, 0]
parameters: {push: {value: 0, unit: N, binding: input}}
bodies:
  mass: {mass: 2, centre_of_mass: [0, 0, 0]}
joints:
  slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}
forces:
  thrust: {kind: joint_force, joint: slide, law: push}
outputs: [mass.x, mass.vx]
scenes:
  fire:
    end: 1
    output_step: 0.1
    inputs:
      push:
        of: t
        piecewise: [{below: 0.2371, expression: "4 N"}, {below: 0.61, expression: "-10 N"}, {expression: "0 N"}]
"""


def pulsed(t: Array) -> tuple[Array, Array]:
    """Places and speeds of PULSES: two parabolas and a straight line."""
    a, b = 0.2371, 0.61
    first, second, last = np.minimum(t, a), np.clip(t, a, b) - a, np.maximum(t, b) - b
    speed = 2 * first - 5 * second
    return first**2 + 2 * a * second - 2.5 * second**2 + (2 * a - 5 * (b - a)) * last, speed
