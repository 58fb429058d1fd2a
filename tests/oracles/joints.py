"""The oracle's own geometry: what joints' coordinates and cut joints' residuals mean, batched and ready for complex steps.

Arrays carry leading batch axes; nothing conjugates or takes an absolute value, so that an imaginary step gives the derivative.
"""

from __future__ import annotations

import numpy as np

from cutjoint.model.records import JointKind

Array = np.ndarray

#: Number of scalar coordinates of each kind, and the kinds with a ball behind them.
SCALARS = {
    JointKind.FIXED: 0, JointKind.REVOLUTE: 1, JointKind.PRISMATIC: 1, JointKind.CYLINDRICAL: 2, JointKind.SCREW: 1,
    JointKind.UNIVERSAL: 2, JointKind.PLANAR: 3, JointKind.SPHERICAL: 0, JointKind.POINT_ON_LINE: 1,
    JointKind.DISTANCE: 2, JointKind.FREE: 3, JointKind.CONSTANT_VELOCITY: 2, "point_on_plane": 2, "parallel_axes": 4,
}  # fmt: skip
BALLS = (JointKind.SPHERICAL, JointKind.POINT_ON_LINE, "point_on_plane", JointKind.DISTANCE, JointKind.FREE)


def apply(R: Array, x: Array) -> Array:
    """R x."""
    return np.einsum("...ij,...j->...i", R, x)


def skew(p: Array) -> Array:
    """p~ with p~ x = p x x."""
    x, y, z = p
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def vector_of(S: Array) -> Array:
    """The vector of the skew part of a matrix."""
    return np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]]) / 2


def rotation_about(axis: Array, angle: Array) -> Array:
    """The rotation about a unit axis, as exp of its skew matrix."""
    K, angle = skew(axis), np.asarray(angle)[..., np.newaxis, np.newaxis]
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


def quaternion_product(a: Array, b: Array) -> Array:
    """Hamilton's product, scalar first."""
    w, x = a[..., :1] * b[..., :1] - (a[..., 1:] * b[..., 1:]).sum(axis=-1, keepdims=True), np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([w, a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + x], axis=-1)


def rotation_of(quaternion: Array) -> Array:
    """The rotation x -> e x e* of a unit quaternion."""
    conjugate = quaternion * np.array([1, -1, -1, -1])
    columns = []
    for basis in np.eye(4)[1:]:
        image = quaternion_product(quaternion_product(quaternion, np.broadcast_to(basis, quaternion.shape)), conjugate)
        columns.append(image[..., 1:])
    return np.stack(columns, axis=-1)


def tangents(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors across a direction: the first is n x e for the axis e that n leans to least, the second n x first."""
    n = normal / np.linalg.norm(normal)
    first = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    first /= np.linalg.norm(first)
    return first, np.cross(n, first)


# Joints


def relative_motion(kind: str, is_reversed: bool, axes: tuple[Array, ...], rod: Array, pitch: float, q: Array) -> tuple[Array, Array]:
    """Rotation (..., 3, 3) and displacement (..., 3) of the outer joint point, in the inner body's axes; q (..., n).

    ``rod`` is the way from the inner to the outer joint point in the design position.  A reversed joint moves by the inverse of
    its motion, so that its coordinates keep their meaning; but a ball's attitude is that of the outer body in the inner one's axes,
    a free joint's place that of the outer point, and a distance joint has its two angles at the outer end.
    """
    n = SCALARS[kind]
    if kind in BALLS:
        turn = rotation_of(q[..., n:])
        match kind:
            case JointKind.SPHERICAL:
                return turn, np.zeros((*q.shape[:-1], 3))
            case JointKind.FREE:
                return turn, q[..., :3]
            case JointKind.POINT_ON_LINE:
                way = q[..., :1] * axes[0]
                return (turn, -apply(turn, way)) if is_reversed else (turn, way)
            case "point_on_plane":
                way = _across(axes[0], q)
                return (turn, -apply(turn, way)) if is_reversed else (turn, way)
        first, second = tangents(rod)
        return turn @ rotation_about(first, q[..., 0]) @ rotation_about(second, q[..., 1]), apply(turn, rod)
    R, way = _follower_from_base(kind, axes, pitch, q)
    if not is_reversed:
        return R, way
    inverse = np.swapaxes(R, -1, -2)
    return inverse, -apply(inverse, way)


def _across(normal: Array, q: Array) -> Array:
    """The way by two displacements across a direction."""
    first, second = tangents(normal)
    return q[..., :1] * first + q[..., 1:2] * second


def _follower_from_base(kind: str, axes: tuple[Array, ...], pitch: float, q: Array) -> tuple[Array, Array]:
    """Rotation and displacement of the follower's joint point in the base's axes, for kinds without a ball."""
    still, upright = np.zeros((*q.shape[:-1], 3)), np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
    match kind:
        case JointKind.FIXED:
            return upright, still
        case JointKind.REVOLUTE:
            return rotation_about(axes[0], q[..., 0]), still
        case JointKind.PRISMATIC:
            return upright, q[..., :1] * axes[0]
        case JointKind.CYLINDRICAL:
            return rotation_about(axes[0], q[..., 1]), q[..., :1] * axes[0]
        case JointKind.SCREW:
            return rotation_about(axes[0], q[..., 0]), pitch * q[..., :1] * axes[0]
        case JointKind.UNIVERSAL:
            return rotation_about(axes[0], q[..., 0]) @ rotation_about(axes[1], q[..., 1]), still
        case JointKind.CONSTANT_VELOCITY:
            # a rotation about an axis across the joint's: the vector part of its quaternion has no component along that
            first, second = tangents(axes[0])
            (c_1, s_1), (c_2, s_2) = ((np.cos(q[..., i : i + 1] / 2), np.sin(q[..., i : i + 1] / 2)) for i in range(2))
            return rotation_of(np.concatenate([c_2 * c_1, c_2 * s_1 * first + s_2 * second], axis=-1)), still
        case JointKind.PLANAR:
            return rotation_about(axes[0], q[..., 2]), _across(axes[0], q)
        case "parallel_axes":
            return rotation_about(axes[0], q[..., 3]), _across(axes[0], q) + q[..., 2:3] * axes[0]
    raise AssertionError(kind)


# Residuals

#: Equations of each cut joint.
ROWS = {
    JointKind.FIXED: 6, JointKind.REVOLUTE: 6, JointKind.PRISMATIC: 5, JointKind.CYLINDRICAL: 5, JointKind.SCREW: 6,
    JointKind.UNIVERSAL: 4, JointKind.PLANAR: 4, JointKind.SPHERICAL: 3, JointKind.POINT_ON_LINE: 2, JointKind.DISTANCE: 1,
    JointKind.CONSTANT_VELOCITY: 4, "point_on_plane": 1, "parallel_axes": 3,
}  # fmt: skip

#: First rows of the residuals that are vectors.
VECTORS = {
    JointKind.FIXED: (0, 3), JointKind.REVOLUTE: (0, 3), JointKind.PRISMATIC: (2,), JointKind.CYLINDRICAL: (2,),
    JointKind.SCREW: (2,), JointKind.UNIVERSAL: (0,), JointKind.PLANAR: (1,), JointKind.SPHERICAL: (0,),
    JointKind.POINT_ON_LINE: (), JointKind.DISTANCE: (), JointKind.CONSTANT_VELOCITY: (0,),
    "point_on_plane": (), "parallel_axes": (0,),
}  # fmt: skip


def residual(kind: str, axes: tuple[Array, ...], rod: Array | None, pitch: float, gap: Array, turn: Array) -> Array:
    """Phi (..., m) of a cut joint, in the base's axes.

    ``gap`` (..., 3) is the way from the base's point to the follower's, ``turn`` (..., 3, 3) the follower's attitude.
    """
    if kind is JointKind.DISTANCE:
        assert rod is not None
        length = np.linalg.norm(rod)
        return ((gap * gap).sum(axis=-1, keepdims=True) - length**2) / (2 * length)
    if kind is JointKind.SPHERICAL:
        return gap
    # half the sum of e_k x turn e_k is the vector of turn's skew part
    skew_part = turn - np.swapaxes(turn, -1, -2)
    twist = np.stack([skew_part[..., 2, 1], skew_part[..., 0, 2], skew_part[..., 1, 0]], axis=-1) / 2
    if kind is JointKind.FIXED:
        return _beside(gap, twist)
    axis = axes[0]
    aligned = apply(turn, axis) - axis
    if kind is JointKind.REVOLUTE:
        return _beside(gap, aligned)
    if kind is JointKind.UNIVERSAL:
        return _beside(gap, _along(apply(turn, axes[1]), axis))
    if kind is JointKind.CONSTANT_VELOCITY:
        return _beside(gap, _along(twist, axis))
    first, second = tangents(axis)
    across, along = _beside(_along(gap, first), _along(gap, second)), _along(gap, axis)
    match kind:
        case JointKind.POINT_ON_LINE:
            return across
        case JointKind.CYLINDRICAL:
            return _beside(across, aligned)
        case JointKind.PRISMATIC:
            return _beside(across, twist)
        case JointKind.PLANAR:
            return _beside(along, aligned)
        case "point_on_plane":
            return along
        case "parallel_axes":
            return aligned
        case JointKind.SCREW:
            # the follower's first direction across the axis, turned back by what it has advanced, has no second component
            angle, turned = along / pitch, apply(turn, first)
            advance = _along(turned, second) * np.cos(angle) - _along(turned, first) * np.sin(angle)
            return _beside(across, aligned, advance)
    raise AssertionError(kind)


def _along(x: Array, direction: Array) -> Array:
    """x . direction, with an axis of one for it."""
    return (x @ direction)[..., np.newaxis]


def _beside(*parts: Array) -> Array:
    return np.concatenate(parts, axis=-1)
