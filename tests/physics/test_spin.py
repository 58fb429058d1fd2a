"""A free body that spins about its middle axis flips over and over: quaternion, momentum and energy through it all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.physics.simulation import compile_text, completed, simulate, with_numerics

INERTIA = np.array([1.0, 2.0, 3.0])
SPIN = np.array([0.01, 5.0, 0.01])

TEXT = """
cutjoint: 1
name: book
gravity: [0, 0, 0]
bodies:
  book: {mass: 1, centre_of_mass: [0.3, -0.2, 0.1], inertia: [1, 2, 3]}
joints:
  free: {kind: free, bodies: [ground, book], at: [0, 0, 0]}
outputs: [book.wx, book.wy, book.wz, book.x, book.y, book.z, book.vx, book.vy, book.vz, book.roll, book.pitch, book.yaw]
scenes:
  spin: {end: 22, output_step: 0.01, rates: {free.wx: 0.01, free.wy: 5, free.wz: 0.01}}
"""


def body_rates(t: np.ndarray) -> np.ndarray:
    """Euler's equations in body axes to 1e-11, shape (n, 3)."""
    def euler(_: float, w: np.ndarray) -> np.ndarray:
        return -np.cross(w, INERTIA * w) / INERTIA

    return solve_ivp(euler, (0, float(t[-1])), SPIN, method="DOP853", rtol=1e-11, atol=1e-12, t_eval=t).y.T


def attitude(roll: float, pitch: float, yaw: float) -> np.ndarray:
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip


def test_an_unstable_spin_over_several_flips(tmp_path: Path) -> None:
    artifact = with_numerics(compile_text(tmp_path, TEXT), tolerance=1e-10)
    errors = []
    for dt in (0.001, 0.0005):
        run = completed(simulate(artifact, dt=dt))
        R = np.array([attitude(*angles) for angles in zip(run["book.roll"], run["book.pitch"], run["book.yaw"], strict=True)])
        w = np.stack([run[f"book.w{a}"] for a in "xyz"], axis=1)
        local = np.einsum("nji,nj->ni", R, w)
        errors.append(np.abs(local - body_rates(run.t)).max())
    flips = np.sum(np.diff(np.sign(local[:, 1])) != 0)
    assert flips >= 3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    assert errors[1] < 0.05  # of 5 rad/s: the flips magnify
    momentum = np.einsum("nij,nj->ni", R, INERTIA * local)
    assert momentum == pytest.approx(np.tile(momentum[0], (len(momentum), 1)), abs=2e-3)
    velocity = np.stack([run[f"book.v{a}"] for a in "xyz"], axis=1)
    assert velocity == pytest.approx(np.tile(velocity[0], (len(velocity), 1)), abs=1e-4)
