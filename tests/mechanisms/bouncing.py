"""A mass that falls on a one-sided spring and damper again and again: its model and its exact motion."""

from __future__ import annotations

from itertools import takewhile

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

MASS, GRAVITY, STIFFNESS = 1.0, 9.81, 2000.0


def bouncing_text(damping: float, height: float) -> str:
    """1 kg on a vertical slide above a stop at 0."""
    return f"""
cutjoint: 1
name: bounce
gravity: [0, 0, -{GRAVITY}]
bodies:
  mass: {{mass: {MASS}, centre_of_mass: [0, 0, 0]}}
joints:
  slide: {{kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [0, 0, 1]}}
forces:
  floor: {{kind: joint_force, joint: slide, law: {{stop: {{side: below, at: 0, stiffness: {STIFFNESS}, damping: {damping}}}}}}}
outputs: [mass.z, mass.vz]
scenes:
  drop: {{end: 1.5, output_step: 0.05, positions: {{slide.displacement: {height}}}, numerics: {{dt: 0.01}}}}
"""


def exact_bounces(t: NDArray[np.float64], damping: float, height: float) -> tuple[NDArray[np.float64], int]:
    """Heights at times t, and how often contact was made or lost until the last of them.

    In flight a parabola; in contact a damped oscillation about -m g/k, which ends where the force would pull.
    """
    heights, switched = np.empty(len(t)), 0
    for begin, end, place in _parts(damping, height):
        now = (t >= begin) & (t <= end)
        heights[now] = place(t[now] - begin)[0]
        if end > t[-1]:
            break
        switched += 1
    return heights, switched


def exact_switches(end: float, damping: float, height: float) -> list[float]:
    """The times until ``end`` at which contact is made or lost."""
    return list(takewhile(lambda t: t <= end, (until for _, until, _ in _parts(damping, height))))


def _parts(damping: float, height: float):  # type: ignore[no-untyped-def]
    """Flights and contacts in turn: begin, end, motion since the begin."""
    z, v, begin, met = height, 0.0, 0.0, False
    while True:
        place, length = (_contact if met else _flight)(z, v, damping)
        yield begin, begin + length, place
        z, v = (float(x) for x in place(np.array(length)))
        begin, met = begin + length, not met


def _flight(z: float, v: float, _: float):  # type: ignore[no-untyped-def]
    return lambda s: (z + v * s - GRAVITY * s * s / 2, v - GRAVITY * s), (v + np.sqrt(v * v + 2 * GRAVITY * z)) / GRAVITY


def _contact(z: float, v: float, damping: float):  # type: ignore[no-untyped-def]
    rest, d = -MASS * GRAVITY / STIFFNESS, damping / (2 * MASS)
    w = np.sqrt(STIFFNESS / MASS - d * d)
    a, b = z - rest, (v + d * (z - rest)) / w

    def place(s):  # type: ignore[no-untyped-def]
        cos, sin, fade = np.cos(w * s), np.sin(w * s), np.exp(-d * s)
        return rest + fade * (a * cos + b * sin), fade * (w * (b * cos - a * sin) - d * (a * cos + b * sin))

    def force(s: float) -> float:
        position, speed = place(s)
        return float(-STIFFNESS * position - damping * speed)

    times = np.linspace(1e-9, 2 * np.pi / w, 2000)
    first = next(i for i, s in enumerate(times) if force(s) < 0)
    return place, brentq(force, times[first - 1], times[first], xtol=1e-15, rtol=1e-15)
