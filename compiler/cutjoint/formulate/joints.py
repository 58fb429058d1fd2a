"""Joint kernels, derived by SymPy: how a joint moves its outer body, seen from its inner body.

A joint is a chain of elementary motions, slides, turns and at most one ball.  Derived are the rotation R(q), the displacement p(q)
of the outer joint point from the inner one, the motion subspace S with [v; w] = S u at the inner joint point, and its drift
c = dS/dt u, all in the inner body's axes (Featherstone 2008, section 3.5; Cuadrado et al. 2000, eqs. 26-27).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy

from cutjoint.model.records import COORDINATES, SPEEDS, JointKind, Scalar, Vector
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
    """
    kind = tree_joint.joint.kind
    names = COORDINATES[kind]
    chain = _motions(tree_joint)
    q = tuple(sympy.Symbol(f"q_{name}", real=True) for name in names)
    u = tuple(sympy.Symbol(f"u_{name}", real=True) for name in SPEEDS[kind])
    in_chain = q[::-1] if tree_joint.reversed and kind in _UNDONE else q
    rotation, displacement, columns = _compose(chain, in_chain)
    subspace = sympy.Matrix.hstack(*columns) if columns else sympy.zeros(6, 0)
    has_ball = any(isinstance(m, _Ball) for m in chain)
    subspace = _speed_order(subspace, chain, in_chain, q)
    return JointKernel(
        q=q, u=u, has_ball=has_ball, rotation=rotation, displacement=displacement, subspace=subspace,
        drift=_drift(subspace, q, u, has_ball),
    )  # fmt: skip


def _motions(tree_joint: TreeJoint) -> list[_Motion]:
    joint = tree_joint.joint
    sign = -1 if tree_joint.reversed else 1
    axes = [sign * sympy.Matrix(a) for a in joint.axes]
    x, y, z = (sympy.Matrix(row) for row in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    match joint.kind:
        case JointKind.FIXED:
            return []
        case JointKind.REVOLUTE:
            return [_Turn(axes[0])]
        case JointKind.PRISMATIC:
            return [_Slide(axes[0])]
        case JointKind.CYLINDRICAL:
            return [_Slide(axes[0]), _Turn(axes[0])]
        case JointKind.SCREW:
            return [_Turn(axes[0], joint.pitch)]
        case JointKind.UNIVERSAL:
            return _undone([_Turn(axes[0]), _Turn(axes[1])], tree_joint.reversed)
        case JointKind.PLANAR:
            first, second = tangents(joint.axes[0])
            return _undone([_Slide(sign * first), _Slide(sign * second), _Turn(axes[0])], tree_joint.reversed)
        case JointKind.SPHERICAL:
            return [_Ball()]
        case JointKind.POINT_ON_LINE:
            return _undone([_Slide(axes[0]), _Ball()], tree_joint.reversed)
        case JointKind.DISTANCE:
            return _rod(joint.at, joint.to, tree_joint.reversed)
        case JointKind.FREE:
            return [_Slide(x), _Slide(y), _Slide(z), _Ball()]
    raise AssertionError(joint.kind)


def _undone(chain: list[_Motion], is_reversed: bool) -> list[_Motion]:
    """The chain as seen from the other end; a reversed motion keeps the number of its coordinate."""
    return chain[::-1] if is_reversed else chain


def _rod(at: Vector, to: Vector | None, is_reversed: bool) -> list[_Motion]:
    """A ball at the inner end of the rod, a universal joint across it at the outer end."""
    rod = (sympy.Matrix(to) - sympy.Matrix(at)) * (-1 if is_reversed else 1)
    first, second = tangents(tuple(rod))
    return [_Ball(), _Offset(rod), _Turn(first), _Turn(second)]


def tangents(normal: Vector) -> tuple[Matrix, Matrix]:
    """Two unit vectors across a direction; the three make a right-handed frame."""
    n = sympy.Matrix(normal)
    if n.free_symbols:
        raise ValueError("a plane whose normal depends on an open parameter is not supported; give the parameter binding const")
    n = n / n.norm()
    least = min(range(3), key=lambda i: (abs(float(n[i])), i))
    across = n.cross(sympy.Matrix([int(i == least) for i in range(3)]))
    first = across / across.norm()
    return first, n.cross(first)


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


def _drift(subspace: Matrix, q: tuple[Scalar, ...], u: tuple[Scalar, ...], has_ball: bool) -> Matrix:
    """dS/dt u, with the quaternion's rate e' = (0, w) e / 2 for an angular velocity in inner axes."""
    if not u:
        return sympy.zeros(6, 1)
    rates = dict(zip(q, u, strict=False))
    if has_ball:
        wx, wy, wz = u[-3:]
        e0, e1, e2, e3 = QUATERNION
        half = sympy.Rational(1, 2)
        rates |= {
            e0: -half * (wx * e1 + wy * e2 + wz * e3), e1: half * (wx * e0 + wy * e3 - wz * e2),
            e2: half * (wy * e0 + wz * e1 - wx * e3), e3: half * (wz * e0 + wx * e2 - wy * e1),
        }  # fmt: skip
    rate = sum((subspace.diff(x) * dx for x, dx in rates.items()), sympy.zeros(*subspace.shape))
    return rate * sympy.Matrix(u)


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
