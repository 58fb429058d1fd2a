"""The attitude of a ball at the start of a scene: from a rotation vector, Euler angles or a quaternion to a quaternion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

import sympy

from cutjoint.elements.joint import ATTITUDE
from cutjoint.model.operations import choice
from cutjoint.model.ranges import fault_of_state
from cutjoint.model.records import Scalar
from cutjoint.model.scope import FAILED, Element
from cutjoint.model.source import Path
from cutjoint.model.units import NONE
from cutjoint.model.values import Attitude, Number

#: How far the length of a quaternion may be from one.
UNIT_BOUND = 1e-3

#: Four expressions, scalar first.
Quaternion: TypeAlias = tuple[Scalar, ...]

def read_attitude(where: Element, attitude: Attitude, keys: Path) -> Quaternion:
    """The quaternion of an attitude, its length one within `UNIT_BOUND` at the parameters' values.

    Source: Shuster 1993, "A survey of attitude representations", J. Astronaut. Sci. 41.
    """
    if attitude.quaternion is not None:
        return _given(where, attitude.quaternion, (*keys, "quaternion"))
    if attitude.rotation_vector is not None:
        return _about(_angles(where, attitude.rotation_vector, (*keys, "rotation_vector")))
    assert attitude.euler is not None
    assert attitude.order is not None
    turns = (_about_axis(axis, angle) for axis, angle in zip(attitude.order, _angles(where, attitude.euler, (*keys, "euler")), strict=True))
    first, second, third = turns
    return _product(_product(first, second), third)


def fault_of_quaternion(values: Sequence[float]) -> str:
    """The fault in a quaternion's length and its remedy; "" without a fault, and of NaN."""
    length = math.hypot(*values)
    if not abs(length - 1) > UNIT_BOUND:
        return ""
    return f"the quaternion has the length {length:g}; write one of length 1, within {UNIT_BOUND:g}"


def normalised(positions: Mapping[str, float], joints: Iterable[str]) -> dict[str, float]:
    """Initial coordinates by "joint.component" with the quaternions of some joints at length one."""
    scaled = dict(positions)
    for joint in joints:
        keys = [f"{joint}.{name}" for name in ATTITUDE]
        length = math.hypot(*(scaled[key] for key in keys))
        scaled |= {key: scaled[key] / length for key in keys}
    return scaled


def _given(where: Element, quaternion: Sequence[Number], keys: Path) -> Quaternion:
    components = tuple(where.scalar(value, NONE, (*keys, i)) for i, value in enumerate(quaternion))
    message, _, hint = fault_of_quaternion([where.value(c) for c in components]).partition("; ")
    if message:
        where.fail(f"{keys[0]}: '{keys[1]}': {message}", hint, keys)
    return components


def _angles(where: Element, angles: Sequence[Number], keys: Path) -> tuple[Scalar, ...]:
    found = []
    for i, value in enumerate(angles):
        angle = where.scalar(value, NONE, (*keys, i))
        if fault := fault_of_state(where.value(angle), is_angle=True):
            where.fail(f"{keys[0]}: '{keys[1]}': {fault}", "", (*keys, i))
            angle = FAILED
        found.append(angle)
    return tuple(found)


def _about(vector: Sequence[Scalar]) -> Quaternion:
    """The turn by a rotation vector's length about its direction."""
    angle = sympy.sqrt(sum(c**2 for c in vector))
    if angle.has(FAILED):
        return (FAILED,) * 4
    share = choice((sympy.sin(angle / 2) / angle, angle > 0), (sympy.Rational(1, 2), sympy.true))
    return (sympy.cos(angle / 2), *(share * c for c in vector))


def _about_axis(axis: str, angle: Scalar) -> Quaternion:
    return (sympy.cos(angle / 2), *(sympy.sin(angle / 2) if axis == name else sympy.Integer(0) for name in "xyz"))


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The turn b seen from the axes that the turn a has carried along: R(a) R(b)."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )
