"""Directions across a joint's own."""

from __future__ import annotations

from typing import Any, TypeAlias

import sympy

from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.geometry import least_component
from cutjoint.model.records import Joint, Vector

Matrix: TypeAlias = Any


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
