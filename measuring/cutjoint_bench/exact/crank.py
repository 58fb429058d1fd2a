"""The slider-crank with a crank as long as its rod: its model file and its exact motion.

Crank and rod are slender bars of 1 m and 1 kg, the slider has 1 kg, nothing acts on them.  When the crank is upright the slider is at the
crank's pin, and two motions go on from there: the slider's through the pin, and a turn of crank and rod with the slider at rest.
"""

from __future__ import annotations

import numpy as np

from cutjoint.run.results import Array

#: The start of the crank, and its rate there.
START, RATE = np.pi / 4, 2.0

SLIDER_CRANK = f"""\
cutjoint: 1
name: slider_crank
gravity: [0, 0, 0]
points:
  O: [0, 0, 0]
  A: [{float(np.cos(START))!r}, {float(np.sin(START))!r}, 0]
  B: [{float(2 * np.cos(START))!r}, 0, 0]
bodies:
  crank: {{mass: 1, centre_of_mass: {{midpoint: [O, A]}}, inertia: {{principal: [0, 1/12, 1/12], x: {{from: O, to: A}}, z: [0, 0, 1]}}}}
  rod: {{mass: 1, centre_of_mass: {{midpoint: [A, B]}}, inertia: {{principal: [0, 1/12, 1/12], x: {{from: A, to: B}}, z: [0, 0, 1]}}}}
  slider: {{mass: 1, centre_of_mass: B}}
joints:
  pin: {{kind: revolute, bodies: [ground, crank], at: O, axis: [0, 0, 1]}}
  elbow: {{kind: revolute, bodies: [crank, rod], at: A, axis: [0, 0, 1]}}
  rail: {{kind: prismatic, bodies: [ground, slider], at: B, axis: [1, 0, 0]}}
  wrist: {{kind: revolute, bodies: [rod, slider], at: B, axis: [0, 0, 1], cut: true}}
scenes:
  turn:
    end: 10
    output_step: 0.02
    rates: {{pin.angle_rate: {RATE!r}}}
    numerics: {{dt: 0.001, penalty: 0.005/dt**2, frequency: 0.3/dt}}
"""

#: Kinetic energy is (I_0 + I_1 sin^2 th) th'^2 / 2 with the crank's angle th.
_STILL, _MOVING = 2 / 3, 6.0

#: Angles between which the time is tabulated, and Gauss points there: more digits than a double has.
_NODES, _POINTS = 64, 16


def slider_crank_motion(t: Array) -> dict[str, Array]:
    """Places (m) and velocities (m/s) of the bodies over the times (s), by ``body.quantity``."""
    angle = _crank_angle(t)
    rate = RATE / _slowness(angle)
    sine, cosine, still = np.sin(angle), np.cos(angle), np.zeros_like(t)

    def at(along: float, across: float) -> tuple[Array, ...]:
        return along * cosine, across * sine, still, -along * sine * rate, across * cosine * rate, still

    places = {"crank": at(0.5, 0.5), "rod": at(1.5, 0.5), "slider": at(2.0, 0.0)}
    return {f"{body}.{q}": c for body, columns in places.items() for q, c in zip(("x", "y", "z", "vx", "vy", "vz"), columns, strict=True)}


def upright_time() -> float:
    """The first time at which the crank is upright, s."""
    return float(_time(np.array([np.pi / 2]))[0])


def _slowness(angle: Array) -> Array:
    """The rate at the start over that at an angle."""
    return np.asarray(np.sqrt((_STILL + _MOVING * np.sin(angle) ** 2) / (_STILL + _MOVING * np.sin(START) ** 2)))


def _time(angle: Array) -> Array:
    """The time at which the crank has an angle, s: whole half turns, cells of a half turn, and the rest."""
    cell = np.pi / _NODES
    edges: Array = np.linspace(START, START + np.pi, _NODES + 1)
    within = np.append(0.0, np.cumsum(_between(edges[:-1], edges[1:])))
    count = np.floor((angle - START) / cell).astype(int)
    halves, cells = np.divmod(count, _NODES)
    return np.asarray(halves * within[-1] + within[cells] + _between(START + cell * count, angle))


def _between(low: Array, high: Array) -> Array:
    """The time from one angle to another, by Gauss-Legendre quadrature."""
    at, weight = np.polynomial.legendre.leggauss(_POINTS)
    middle, half = (low + high) / 2, (high - low) / 2
    return np.asarray(half / RATE * (weight * _slowness(middle[..., None] + half[..., None] * at)).sum(axis=-1))


def _crank_angle(t: Array) -> Array:
    """The crank's angle over the times, by Newton's method."""
    half_turn = _time(np.array([START + np.pi]))[0]
    angle: Array = START + np.pi * t / half_turn
    for _ in range(30):
        angle = angle + (t - _time(angle)) * RATE / _slowness(angle)
    return angle
