"""Loops of six hinges whose screws have rank 5 in one pose only: mobile to first order, and rigid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Places of the hinges, a hexagon out of plane.
_POINTS = np.round([[np.cos(a), np.sin(a), 0.4 * np.sin(2.3 * a)] for a in np.arange(6) * np.pi / 3], 3)


def screws(axes: Array) -> Array:
    """The hinges' motions (6, 6): axis and moment."""
    return np.concatenate([axes, np.cross(_POINTS, axes)], axis=1)


def six_axes(seed: int, off: float = 0.0) -> Array:
    """Random axes, the last one reciprocal to the wrench that the other five leave; ``off`` is what it has of it besides."""
    axes = np.random.default_rng(seed).standard_normal((6, 3))
    axes = np.round(axes / np.linalg.norm(axes, axis=1, keepdims=True), 3)
    wrench = np.linalg.svd(screws(axes)[:5])[2][-1]
    across = wrench[:3] + np.cross(wrench[3:], _POINTS[5])
    across /= np.linalg.norm(across)
    last = axes[5] - across * (axes[5] @ across)
    axes[5] = last / np.linalg.norm(last) + off * across
    return np.asarray(axes)


def six_text(seed: int = 1, off: float = 0.0, scene: str = "") -> str:
    """The model: five bodies of 1 kg under gravity, from hinge to hinge."""
    names = ["ground", *(f"b{i}" for i in range(5)), "ground"]
    bodies = (
        f"  b{i}: {{mass: 1, centre_of_mass: {((_POINTS[i] + _POINTS[i + 1]) / 2).tolist()}, inertia: [0.1, 0.1, 0.1]}}" for i in range(5)
    )
    joints = (
        f"  j{i}: {{kind: revolute, bodies: [{names[i]}, {names[i + 1]}], at: {point.tolist()}, axis: {axis.tolist()}}}"
        for i, (point, axis) in enumerate(zip(_POINTS, six_axes(seed, off), strict=True))
    )
    return "\n".join([
        "cutjoint: 1", "name: six", "gravity: [0, 0, -9.81]", "bodies:", *bodies, "joints:", *joints, "outputs: [b2.x, b2.y, b2.z]",
        "scenes:", f"  run: {{end: 0.2, output_step: 0.01{scene}}}", "",
    ])  # fmt: skip
