"""Rotations as glTF has them: unit quaternions (x, y, z, w)."""

from __future__ import annotations

import numpy as np

from cutjoint.view.records import Array


def quaternions_of(rotations: Array) -> Array:
    """Quaternions (n, 4) of rotation matrices (n, 3, 3), each on the side of the one before (Shepperd, J. Guidance and Control 1, 1978)."""
    R = np.asarray(rotations)
    x, y, z = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    squares = np.stack([1 + x - y - z, 1 - x + y - z, 1 - x - y + z, 1 + x + y + z], axis=1)  # four times x2, y2, z2, w2
    products = np.empty((len(R), 4, 4))
    for i in range(4):
        products[:, i, i] = squares[:, i]
    for i, j, value in (
        (0, 1, R[:, 0, 1] + R[:, 1, 0]), (0, 2, R[:, 0, 2] + R[:, 2, 0]), (1, 2, R[:, 1, 2] + R[:, 2, 1]),
        (0, 3, R[:, 2, 1] - R[:, 1, 2]), (1, 3, R[:, 0, 2] - R[:, 2, 0]), (2, 3, R[:, 1, 0] - R[:, 0, 1]),
    ):  # fmt: skip
        products[:, i, j] = products[:, j, i] = value
    largest = products[np.arange(len(R)), squares.argmax(axis=1)]
    return one_side(largest / np.linalg.norm(largest, axis=1, keepdims=True))


def one_side(q: Array) -> Array:
    """Each quaternion or its opposite, which is the same rotation, so that none is far from the one before."""
    flips = np.sum(q[1:] * q[:-1], axis=1) < 0
    signs = np.concatenate([[1.0], np.where(flips, -1.0, 1.0)]).cumprod()
    return np.asarray(q * signs[:, np.newaxis])


def shortest(start: Array, end: Array) -> Array:
    """The quaternion (4,) of the smallest rotation between two directions (3,)."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    w = 1 + a @ b
    if w < 1e-9:  # opposite: half a turn about any direction across
        axis = np.cross(a, np.eye(3)[np.abs(a).argmin()])
        return np.append(axis / np.linalg.norm(axis), 0.0)
    q = np.append(np.cross(a, b), w)
    return np.asarray(q / np.linalg.norm(q))


def product(p: Array, q: Array) -> Array:
    """The rotation q, then p; (..., 4)."""
    u, v = p[..., :3], q[..., :3]
    vector = p[..., 3:] * v + q[..., 3:] * u + np.cross(u, v)
    return np.concatenate([vector, p[..., 3:] * q[..., 3:] - np.sum(u * v, axis=-1, keepdims=True)], axis=-1)


def turned(q: Array, vectors: Array) -> Array:
    """Vectors (n, 3) after the rotations q (n, 4): v + 2 u x (u x v + w v)."""
    u, w = q[:, :3], q[:, 3:]
    return np.asarray(vectors + 2 * np.cross(u, np.cross(u, vectors) + w * vectors))


def along(directions: Array) -> Array:
    """Quaternions (n, 4) that take z to each of the directions (n, 3), without a turn about them from one to the next."""
    result = np.empty((len(directions), 4))
    q, before = np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])
    for i, direction in enumerate(directions):
        q = product(shortest(before, direction), q)
        result[i], before = q / np.linalg.norm(q), direction
    return result


def rotation_to(direction: Array) -> Array:
    """The matrix (3, 3) of the smallest rotation that takes z to a direction."""
    x, y, z, w = shortest(np.array([0.0, 0.0, 1.0]), direction)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + 2 * w * skew + 2 * skew @ skew)
