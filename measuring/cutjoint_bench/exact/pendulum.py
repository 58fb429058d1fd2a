"""The planar pendulum of the IFToMM benchmark library (A01), released from the horizontal: its model file and its exact motion."""

from __future__ import annotations

import numpy as np

from cutjoint.run.results import Array
from cutjoint_bench.exact.elliptic import amplitude, quarter_period

PENDULUM = """\
cutjoint: 1
name: pendulum
gravity: [0, -9.81, 0]
bodies:
  bob: {mass: 1, centre_of_mass: [-1, 0, 0]}
joints:
  pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 0, 1]}
scenes:
  swing: {end: 10, output_step: 0.02, numerics: {dt: 0.001}}
"""


def pendulum_motion(t: Array) -> dict[str, Array]:
    """Position (m) and velocity (m/s) of the bob over the times (s), by ``body.quantity``.
    sin th/2 = k sn(K - w t), th from the bottom."""
    m, w = 0.5, np.sqrt(9.81)
    phase = amplitude(quarter_period(m) - w * t, m)
    angle, rate = 2 * np.arcsin(np.sqrt(m) * np.sin(phase)), -2 * w * np.sqrt(m) * np.cos(phase)
    still = np.zeros_like(t)
    place = {"bob.x": -np.sin(angle), "bob.y": -np.cos(angle), "bob.z": still}
    return {**place, "bob.vx": -np.cos(angle) * rate, "bob.vy": np.sin(angle) * rate, "bob.vz": still}
