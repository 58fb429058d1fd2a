"""The directions of joints in the design position, by their meaning."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

import sympy

from cutjoint.elements.joint import DESIGN_FRAME, Direction
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.geometry import GLOBAL_AXES, least_component
from cutjoint.model.records import Joint, Scalar, Vector

Matrix: TypeAlias = Any


def direction_of(joint: Joint, direction: Direction) -> Vector:
    """A direction of a joint.

    Raises:
        ModelError: two directions are needed across one that depends on an open parameter.
    """
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


def rod_of(joint: Joint) -> Vector:
    """The way from the base's point to the follower's in the design position."""
    assert joint.to is not None
    return _vector(sympy.sympify(b) - a for a, b in zip(joint.at, joint.to, strict=True))


def _vector(components: Iterable[Scalar]) -> Vector:
    x, y, z = components
    return x, y, z


def tangents(joint: Joint, normal: Vector) -> tuple[Matrix, Matrix]:
    """Two unit vectors across a direction of a joint; the three make a right-handed frame.

    Raises:
        ModelError: the direction depends on an open parameter.
    """
    n = sympy.Matrix(normal)
    if n.free_symbols:
        names = ", ".join(sorted(f"'{str(symbol).removeprefix('p_')}'" for symbol in n.free_symbols))
        message = f"the direction of this {joint.kind} joint depends on the open parameter {names}, but needs two others across it"
        hint = "give the parameter binding: const"
        raise ModelError([Problem(span=joint.span, element=f"joint '{joint.name}'", message=message, hint=hint)])
    n = n / n.norm()
    least = least_component(tuple(n))
    across = n.cross(sympy.Matrix([int(i == least) for i in range(3)]))
    first = across / across.norm()
    return first, n.cross(first)
