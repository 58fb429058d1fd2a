"""Joint kernels, derived by SymPy: how a joint moves its outer body, seen from its inner body.

A joint is a chain of elementary motions, slides, turns and at most one ball.  Derived are the rotation R(q), the displacement p(q)
of the outer joint point from the inner one, the motion subspace S with [v; w] = S u at the inner joint point, and its drift
c = dS/dt u, all in the inner body's axes (Featherstone 2008, section 3.5; Cuadrado et al. 2000, eqs. 26-27).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, TypeAlias

import sympy

from cutjoint.elements.joint import DESIGN_FRAME, SPIN, Ball, Direction, JointElement, Motion, Offset, Rotation, Translation, rate_name
from cutjoint.elements.joints import JOINTS
from cutjoint.model.elements.geometry import GLOBAL_AXES, least_component
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Joint, Scalar, Vector

Matrix: TypeAlias = Any

QUATERNION = sympy.symbols("e0:4", real=True)
#: The directions of a chain of motions by their symbols, which no kind uses for two of them, and a joint's pitch.
_A, _B, _C = (sympy.Matrix(sympy.symbols(f"{name}_x {name}_y {name}_z", real=True)) for name in "abc")
_SYMBOLS = {
    Direction.AXIS: _A, Direction.ROD: _A, Direction.AXIS_2: _B, Direction.ACROSS_1: _B, Direction.ACROSS_2: _C,
    **{d: sympy.Matrix(axis) for d, axis in zip(DESIGN_FRAME, GLOBAL_AXES, strict=True)},
}  # fmt: skip
_PITCH = sympy.Symbol("pitch", real=True)


@dataclass(frozen=True, kw_only=True)
class JointKernel:
    """The motion of one joint.

    ``q`` are its scalar coordinates, ``has_ball`` is whether a quaternion follows them, ``u`` its speeds: the rates of q, then the ball's
    angular velocity in the inner body's axes.  ``rotation`` (3, 3), ``displacement`` (3, 1), ``subspace`` (6, nu), ``drift`` (6, 1).
    ``columns`` (6, n) are those of the elementary motions in the chain's order, whose sums by speeds are the subspace.
    """

    q: tuple[Scalar, ...]
    u: tuple[Scalar, ...]
    has_ball: bool
    rotation: Matrix
    displacement: Matrix
    subspace: Matrix
    drift: Matrix
    columns: Matrix


def derive_joint(joint: Joint, is_reversed: bool) -> JointKernel:
    """The kernel of a tree joint. A reversed joint moves its base: its motions are undone in the opposite order, so that a coordinate keeps
    its sign and meaning. Raises ModelError: tangents are needed across a direction that depends on a tunable parameter."""
    general, known = _derive_kind(joint.kind, is_reversed), _given(joint, is_reversed)
    return replace(
        general, rotation=general.rotation.xreplace(known), displacement=general.displacement.xreplace(known),
        subspace=general.subspace.xreplace(known), drift=general.drift.xreplace(known), columns=general.columns.xreplace(known),
    )  # fmt: skip


def inner_point(joint: Joint, is_reversed: bool) -> tuple[Scalar, Scalar, Scalar]:
    """The inner body's point of a tree joint in the design position."""
    return joint.at if joint.to is None or not is_reversed else joint.to


@dataclass(frozen=True)
class ElementaryMotion:
    """A motion of a chain: the places of its speeds among the joint's, three of a ball, and its share of the coordinate."""

    places: tuple[int, ...]
    share: float


def elementary_motions(joint: Joint, is_reversed: bool) -> tuple[ElementaryMotion, ...]:
    """A joint's elementary motions, those next to the inner body first."""
    element = joint.element
    return tuple(_elementary(element, m) for m in element.chain_from_inner(is_reversed) if not isinstance(m, Offset))


def _elementary(element: JointElement, motion: Translation | Rotation | Ball) -> ElementaryMotion:
    if isinstance(motion, Ball):
        return ElementaryMotion(tuple(range(len(element.coordinates), len(element.speeds))), 1.0)
    share = float(motion.share) if isinstance(motion, Rotation) else 1.0
    return ElementaryMotion((element.coordinates.index(motion.coordinate),), share)


@cache
def _derive_kind(kind: str, is_reversed: bool) -> JointKernel:
    """The kernel of any joint of a kind, over the symbols of its directions and its pitch."""
    element = JOINTS[kind]
    chain = element.chain_from_inner(is_reversed)
    q = {name: sympy.Symbol(f"q_{name}", real=True) for name in element.coordinates}
    u = {name: sympy.Symbol(f"u_{name}", real=True) for name in element.speeds}
    rotation, displacement, columns = _compose(chain, q)
    return JointKernel(
        q=tuple(q.values()), u=tuple(u.values()), has_ball=element.has_ball, rotation=rotation, displacement=displacement,
        subspace=_subspace(element, chain, columns), drift=_drift(chain, columns, u),
        columns=sympy.Matrix.hstack(*columns) if columns else sympy.zeros(6, 0),
    )  # fmt: skip


def _given(joint: Joint, is_reversed: bool) -> dict[Scalar, Scalar]:
    """The numbers of one joint for the symbols of its kind, as seen from its inner body."""
    used = dict.fromkeys(m.direction for m in joint.element.chain if not isinstance(m, Ball) and m.direction not in DESIGN_FRAME)
    directions = {x: value for d in used for x, value in zip(_SYMBOLS[d], _seen_direction(joint, is_reversed, d), strict=True)}
    return {**directions, _PITCH: joint.pitch} if joint.pitch is not None else directions


def _seen_direction(joint: Joint, is_reversed: bool, direction: Direction) -> Matrix:
    """A direction as the inner body of a joint sees it: turned about if the joint is reversed."""
    if not is_reversed:
        return sympy.Matrix(direction_of(joint, direction))
    if joint.element.from_inner:
        return sympy.Matrix(direction_of(replace(joint, at=joint.to or joint.at, to=joint.at), direction))
    return -sympy.Matrix(direction_of(joint, direction))


def _compose(chain: Sequence[Motion], q: Mapping[str, Scalar]) -> tuple[Matrix, Matrix, list[Matrix]]:
    """Rotation, displacement and the columns of the motions by their speeds in the chain's order, three of a ball."""
    rotation, displacement = sympy.eye(3), sympy.zeros(3, 1)
    columns: list[Matrix] = []
    for motion in chain:
        if isinstance(motion, Translation):
            direction = rotation * _SYMBOLS[motion.direction]
            displacement = displacement + direction * q[motion.coordinate]
            columns.append(sympy.Matrix.vstack(direction, sympy.zeros(3, 1)))
        elif isinstance(motion, Rotation):
            share = sympy.sympify(motion.share)
            angle, pitch = share * q[motion.coordinate], _PITCH if motion.is_screw else sympy.Integer(0)
            direction = rotation * _SYMBOLS[motion.direction]
            columns.append(share * sympy.Matrix.vstack(displacement.cross(direction) + pitch * direction, direction))
            displacement = displacement + pitch * direction * angle
            rotation = rotation * rotation_about(_SYMBOLS[motion.direction], angle)
        elif isinstance(motion, Ball):
            columns.extend(sympy.Matrix.vstack(displacement.cross(sympy.eye(3)[:, i]), sympy.eye(3)[:, i]) for i in range(3))
            rotation = rotation * rotation_of(QUATERNION)
        else:
            displacement = displacement + rotation * _SYMBOLS[motion.direction]
    return rotation, displacement, columns


def _names(chain: Sequence[Motion]) -> list[str]:
    """The speed of each column of a chain."""
    names: list[str] = []
    for motion in chain:
        if isinstance(motion, Ball):
            names += SPIN
        elif not isinstance(motion, Offset):
            names.append(rate_name(motion.coordinate))
    return names


def _subspace(element: JointElement, chain: Sequence[Motion], columns: Sequence[Matrix]) -> Matrix:
    """The columns in the order of the speeds; those of motions that share a coordinate add up."""
    by_name: dict[str, Matrix] = {}
    for name, column in zip(_names(chain), columns, strict=True):
        by_name[name] = by_name[name] + column if name in by_name else column
    return sympy.Matrix.hstack(*(by_name[name] for name in element.speeds)) if columns else sympy.zeros(6, 0)


def _drift(chain: Sequence[Motion], columns: Sequence[Matrix], u: Mapping[str, Scalar]) -> Matrix:
    """dS/dt u of a chain with columns in its order: what the motions before it carry along turns and moves a column.
    A ball's axes are the inner body's; nothing turns before it."""
    drift, twist = sympy.zeros(6, 1), sympy.zeros(6, 1)
    remaining = iter(columns)
    for motion in chain:
        v, w = twist[:3, :], twist[3:, :]
        if isinstance(motion, Ball):
            spin = [u[name] for name in SPIN]
            drift += sympy.Matrix.vstack(v.cross(sympy.Matrix(spin)), sympy.zeros(3, 1))
            twist += sum((next(remaining) * speed for speed in spin), sympy.zeros(6, 1))
        elif not isinstance(motion, Offset):
            added = next(remaining) * u[rate_name(motion.coordinate)]
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


def direction_of(joint: Joint, direction: Direction) -> Vector:
    """A direction of a joint. Raises ModelError: two directions are needed across one that depends on a tunable parameter."""
    match direction:
        case Direction.AXIS:
            return joint.axes[0]
        case Direction.AXIS_2:
            return joint.axes[1]
        case Direction.NORMAL:
            first, second = map(sympy.Matrix, joint.axes)
            return _vector(first.cross(second))
        case Direction.ROD:
            return rod_of(joint)
        case Direction.ACROSS_1 | Direction.ACROSS_2:
            along = joint.axes[0] if joint.to is None else rod_of(joint)
            return _vector(tangents(joint, along)[direction is Direction.ACROSS_2])
    return GLOBAL_AXES[DESIGN_FRAME.index(direction)]


def slide_axis(joint: Joint, coordinate: str) -> Vector:
    """The direction along which a displacement counts."""
    return direction_of(joint, joint.element.slide_direction(coordinate))


def rotation_axis(joint: Joint, is_reversed: bool, coordinate: str) -> tuple[str, Vector]:
    """The axis of a rotation: the body that carries it and its direction there, over the coordinates between them.

    A first axis is fixed in the base, a last one in the follower; behind a ball axes are those of the outer body.  Where two rotations
    share a coordinate it is that of their sum.
    """
    chain = [m for m in joint.element.chain if isinstance(m, Rotation)]
    if not joint.element.from_inner and len(chain) > 1 and [m.coordinate == coordinate for m in chain].index(True) == len(chain) - 1:
        return joint.follower, direction_of(joint, chain[-1].direction)
    body, sense, seen = joint.base, 1, False
    if joint.element.from_inner:
        body, sense, seen, chain = joint.base if is_reversed else joint.follower, -1, is_reversed, chain[::-1]
    rotation, axes = sympy.eye(3), []
    for motion in chain:
        direction = _seen_direction(joint, seen, motion.direction)
        if motion.coordinate == coordinate:
            axes.append(rotation * direction)
        angle = sense * sympy.sympify(motion.share) * sympy.Symbol(f"q_{motion.coordinate}", real=True)
        rotation = rotation * rotation_about(direction, angle)
    total = sum(axes[1:], axes[0])
    return body, _vector(total if len(axes) == 1 else total / sympy.sqrt(total.dot(total)))


def rod_of(joint: Joint) -> Vector:
    """The vector from the base's point to the follower's in the design position."""
    assert joint.to is not None
    return _vector(sympy.sympify(b) - a for a, b in zip(joint.at, joint.to, strict=True))


def _vector(components: Iterable[Scalar]) -> Vector:
    x, y, z = components
    return x, y, z


def tangents(joint: Joint, normal: Vector) -> tuple[Matrix, Matrix]:
    """Two unit vectors across a direction of a joint; the three make a right-handed frame.
    Raises ModelError: the direction depends on a tunable parameter."""
    n = sympy.Matrix(normal)
    if n.free_symbols:
        names = ", ".join(sorted(f"'{str(symbol).removeprefix('p_')}'" for symbol in n.free_symbols))
        message = f"the direction of this {joint.kind} joint depends on the tunable parameter {names}, but needs two others across it"
        hint = "give the parameter binding: const"
        raise ModelError([Problem(span=joint.span, element=f"joint '{joint.name}'", message=message, hint=hint)])
    n = n / n.norm()
    least = least_component(tuple(n))
    across = n.cross(sympy.Matrix([int(i == least) for i in range(3)]))
    first = across / across.norm()
    return first, n.cross(first)
