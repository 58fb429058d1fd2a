"""Joint kernels, derived by SymPy: how a joint moves its outer body, seen from its inner body.

A joint is a chain of elementary motions, slides, turns and at most one ball.  Derived are the rotation R(q), the displacement p(q)
of the outer joint point from the inner one, the motion subspace S with [v; w] = S u at the inner joint point, and its drift
c = dS/dt u, all in the inner body's axes (Featherstone 2008, section 3.5; Cuadrado et al. 2000, eqs. 26-27).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, TypeAlias

import sympy

from cutjoint.formulate.directions import tangents
from cutjoint.model.records import COORDINATES, SPEEDS, JointKind, Scalar
from cutjoint.topology.records import TreeJoint

Matrix: TypeAlias = Any

QUATERNION = sympy.symbols("e0:4", real=True)


@dataclass(frozen=True, kw_only=True)
class JointKernel:
    """The motion of one joint.

    ``q`` are its scalar coordinates, ``has_ball`` tells of a quaternion behind them, ``u`` its speeds: the rates of q, then the ball's
    angular velocity in the inner body's axes.  ``rotation`` (3, 3), ``displacement`` (3, 1), ``subspace`` (6, nu), ``drift`` (6, 1).
    """

    q: tuple[Scalar, ...]
    u: tuple[Scalar, ...]
    has_ball: bool
    rotation: Matrix
    displacement: Matrix
    subspace: Matrix
    drift: Matrix


@dataclass(frozen=True)
class _Slide:
    axis: Matrix


@dataclass(frozen=True)
class _Turn:
    axis: Matrix
    pitch: Scalar = 0


@dataclass(frozen=True)
class _Ball:
    pass


@dataclass(frozen=True)
class _Offset:
    vector: Matrix


_Motion: TypeAlias = _Slide | _Turn | _Ball | _Offset


#: Kinds whose motions a reversed joint undoes in the opposite order.
_UNDONE = frozenset({JointKind.UNIVERSAL, JointKind.PLANAR, JointKind.POINT_ON_LINE})


def derive_joint(tree_joint: TreeJoint) -> JointKernel:
    """The kernel of a tree joint.

    A reversed joint moves its base: its motions are undone in the opposite order, so that a coordinate keeps its sign and meaning.

    Raises:
        ModelError: tangents are needed across a direction that depends on an open parameter.
    """
    joint = tree_joint.joint
    general, known = _derive_kind(joint.kind, tree_joint.reversed), _given(tree_joint)
    return replace(
        general, rotation=general.rotation.xreplace(known), displacement=general.displacement.xreplace(known),
        subspace=general.subspace.xreplace(known), drift=general.drift.xreplace(known),
    )  # fmt: skip


def motion_groups(tree_joint: TreeJoint) -> tuple[tuple[int, ...], ...]:
    """The places among a joint's speeds of its elementary motions, those next to the inner body first; a ball is one motion."""
    kind, is_reversed = tree_joint.joint.kind, tree_joint.reversed
    scalars = list(range(len(COORDINATES[kind])))
    if is_reversed and kind in _UNDONE:
        scalars.reverse()
    ball = tuple(range(len(scalars), len(SPEEDS[kind])))
    moving = [m for m in _motions(kind, is_reversed) if not isinstance(m, _Offset)]
    return tuple(ball if isinstance(m, _Ball) else (scalars.pop(0),) for m in moving)


@cache
def _derive_kind(kind: JointKind, is_reversed: bool) -> JointKernel:
    """The kernel of any joint of a kind, over the symbols of its directions and its pitch."""
    chain = _motions(kind, is_reversed)
    q = tuple(sympy.Symbol(f"q_{name}", real=True) for name in COORDINATES[kind])
    u = tuple(sympy.Symbol(f"u_{name}", real=True) for name in SPEEDS[kind])
    in_chain = q[::-1] if is_reversed and kind in _UNDONE else q
    rotation, displacement, columns = _compose(chain, in_chain)
    subspace = sympy.Matrix.hstack(*columns) if columns else sympy.zeros(6, 0)
    scalar = u[: len(q)][::-1] if in_chain != q else u[: len(q)]
    return JointKernel(
        q=q, u=u, has_ball=any(isinstance(m, _Ball) for m in chain), rotation=rotation, displacement=displacement,
        subspace=_speed_order(subspace, chain, in_chain, q), drift=_drift(chain, columns, scalar, u[len(q) :]),
    )  # fmt: skip


#: The directions of a chain of motions, of which each kind needs up to three, and a screw's pitch.
_DIRECTIONS = tuple(sympy.Matrix(sympy.symbols(f"{name}_x {name}_y {name}_z", real=True)) for name in "abc")
_PITCH = sympy.Symbol("pitch", real=True)


def _motions(kind: JointKind, is_reversed: bool) -> list[_Motion]:
    a, b, c = _DIRECTIONS
    x, y, z = (sympy.Matrix(row) for row in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    chains: dict[JointKind, list[_Motion]] = {
        JointKind.FIXED: [],
        JointKind.REVOLUTE: [_Turn(a)],
        JointKind.PRISMATIC: [_Slide(a)],
        JointKind.CYLINDRICAL: [_Slide(a), _Turn(a)],
        JointKind.SCREW: [_Turn(a, _PITCH)],
        JointKind.UNIVERSAL: [_Turn(a), _Turn(b)],
        JointKind.PLANAR: [_Slide(b), _Slide(c), _Turn(a)],
        JointKind.SPHERICAL: [_Ball()],
        JointKind.POINT_ON_LINE: [_Slide(a), _Ball()],
        # a ball at the inner end of the rod, a universal joint across it at the outer end
        JointKind.DISTANCE: [_Ball(), _Offset(a), _Turn(b), _Turn(c)],
        JointKind.FREE: [_Slide(x), _Slide(y), _Slide(z), _Ball()],
    }
    # seen from the other end; a reversed motion keeps the number of its coordinate
    return chains[kind][::-1] if is_reversed and kind in _UNDONE else chains[kind]


def _given(tree_joint: TreeJoint) -> dict[Scalar, Scalar]:
    """The numbers of one joint for the symbols of its kind; those that are seen from its inner body are turned about if it is reversed."""
    joint = tree_joint.joint
    sign = -1 if tree_joint.reversed else 1
    directions = [sign * sympy.Matrix(axis) for axis in joint.axes]
    if joint.kind is JointKind.PLANAR:
        directions += [sign * tangent for tangent in tangents(joint, joint.axes[0])]
    if joint.kind is JointKind.DISTANCE:
        rod = sign * (sympy.Matrix(joint.to) - sympy.Matrix(joint.at))
        directions = [rod, *tangents(joint, tuple(rod))]
    pairs = zip(_DIRECTIONS, directions, strict=False)
    given = {symbol: value for symbols, values in pairs for symbol, value in zip(symbols, values, strict=True)}
    return {**given, _PITCH: joint.pitch} if joint.pitch is not None else given


def _compose(chain: Sequence[_Motion], q: tuple[Scalar, ...]) -> tuple[Matrix, Matrix, list[Matrix]]:
    """Rotation, displacement and the columns of the subspace in the chain's order."""
    rotation, displacement = sympy.eye(3), sympy.zeros(3, 1)
    columns: list[Matrix] = []
    coordinates = iter(q)
    for motion in chain:
        if isinstance(motion, _Slide):
            direction = rotation * motion.axis
            displacement = displacement + direction * next(coordinates)
            columns.append(sympy.Matrix.vstack(direction, sympy.zeros(3, 1)))
        elif isinstance(motion, _Turn):
            angle, direction = next(coordinates), rotation * motion.axis
            columns.append(sympy.Matrix.vstack(displacement.cross(direction) + motion.pitch * direction, direction))
            displacement = displacement + motion.pitch * direction * angle
            rotation = rotation * rotation_about(motion.axis, angle)
        elif isinstance(motion, _Ball):
            columns.extend(
                sympy.Matrix.vstack(displacement.cross(sympy.eye(3)[:, i]), sympy.eye(3)[:, i]) for i in range(3)
            )
            rotation = rotation * rotation_of(QUATERNION)
        else:
            displacement = displacement + rotation * motion.vector
    return rotation, displacement, columns


def _speed_order(subspace: Matrix, chain: Sequence[_Motion], in_chain: tuple[Scalar, ...], q: tuple[Scalar, ...]) -> Matrix:
    """Columns of scalar motions first, in the coordinates' order, the ball's behind."""
    ball: list[int] = []
    scalar: list[int] = []
    column = 0
    for motion in chain:
        if isinstance(motion, _Ball):
            ball += [column, column + 1, column + 2]
            column += 3
        elif not isinstance(motion, _Offset):
            scalar.append(column)
            column += 1
    placed = [scalar[in_chain.index(x)] for x in q]
    return subspace[:, placed + ball] if column else subspace


def _drift(chain: Sequence[_Motion], columns: Sequence[Matrix], scalar: Sequence[Scalar], ball: Sequence[Scalar]) -> Matrix:
    """dS/dt u of a chain with columns in its order: what the motions before it carry along turns and moves a column.

    ``scalar`` are the speeds of slides and turns in the chain's order, ``ball`` those of the ball, whose axes are the inner body's and
    before which nothing turns.
    """
    drift, twist = sympy.zeros(6, 1), sympy.zeros(6, 1)
    remaining, speeds = iter(columns), iter(scalar)
    for motion in chain:
        v, w = twist[:3, :], twist[3:, :]
        if isinstance(motion, _Ball):
            drift += sympy.Matrix.vstack(v.cross(sympy.Matrix(ball)), sympy.zeros(3, 1))
            twist += sum((next(remaining) * speed for speed in ball), sympy.zeros(6, 1))
        elif not isinstance(motion, _Offset):
            added = next(remaining) * next(speeds)
            drift += sympy.Matrix.vstack(w.cross(added[:3, :]) + v.cross(added[3:, :]), w.cross(added[3:, :]))
            twist += added
    return drift


def rotation_about(axis: Matrix, angle: Scalar) -> Matrix:
    """Rodrigues' formula for a unit axis, (3, 3)."""
    c, s = sympy.cos(angle), sympy.sin(angle)
    x, y, z = axis
    skew = sympy.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return c * sympy.eye(3) + s * skew + (1 - c) * (axis * axis.T)


def rotation_of(quaternion: Sequence[Scalar]) -> Matrix:
    """The rotation of a unit quaternion (scalar first), (3, 3)."""
    w, x, y, z = quaternion
    return sympy.Matrix([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
