"""The plane of a reflection, and how vectors and expressions compare across it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias, TypeVar

import sympy

from cutjoint.model.geometry import GLOBAL_AXES, cross, least_component
from cutjoint.model.mirror import Mirror
from cutjoint.model.records import Model, Scalar, Span, Vector
from cutjoint.reduce.records import Note

_Record = TypeVar("_Record")

#: A comparison: True if two values of records' fields count as the same.
Same: TypeAlias = Callable[[Any, Any], bool]

#: The angles of a body by the axis that each turns about.
ANGLES: Mapping[str, str] = {"x": "roll", "y": "pitch", "z": "yaw"}


class AsymmetryError(ValueError):
    """Something has no image, or cannot be cut in half; ``note`` names it."""

    def __init__(self, element: str, words: str, span: Span) -> None:
        super().__init__(f"{span}: '{element}' {words}")
        self.note = Note(element=element, words=words, span=span)


@dataclass(frozen=True, kw_only=True)
class Plane:
    """The plane through the design frame's origin across the global ``axis`` "x", "y" or "z"."""

    axis: str

    def __str__(self) -> str:
        return f"{self.axis} = 0"

    @property
    def mirror(self) -> Mirror:
        """The reflection."""
        x, y, z = (-1 if name == self.axis else 1 for name in "xyz")
        return Mirror((x, y, z))

    @property
    def normal(self) -> Vector:
        """The unit vector along the axis."""
        return GLOBAL_AXES["xyz".index(self.axis)]

    @property
    def across(self) -> str:
        """An axis in the plane: angles and angular velocities about it leave the plane."""
        return "z" if self.axis == "x" else "x"

    def sign(self, quantity: str) -> int:
        """The sign of the image of a quantity: 1 if it counts the same way, else -1.

        Quantities are by components (x, vy, az, Fx), an angle (roll) or a turn (wx, Mz).
        """
        turns = {**{angle: axis for axis, angle in ANGLES.items()}, **{f"{name}{axis}": axis for name in "wM" for axis in "xyz"}}
        if quantity in turns:
            return 1 if turns[quantity] == self.axis else -1
        return -1 if quantity[-1] == self.axis else 1

    def along_normal(self, direction: Vector) -> bool:
        """Return whether a direction stands across the plane."""
        return all(is_nought(c) for c in cross(self.normal, direction))

    def within(self, direction: Vector) -> bool:
        """Return whether a direction, or a point, lies in the plane."""
        return is_nought(direction["xyz".index(self.axis)])

    def tangents(self) -> tuple[Vector, Vector]:
        """The directions of the displacements of a planar joint whose normal is the plane's."""
        first = cross(self.normal, GLOBAL_AXES[least_component(self.normal)])
        return first, cross(self.normal, first)


def require_gravity(model: Model, plane: Plane) -> None:
    """Raises AsymmetryError where gravity pulls out of the plane."""
    if not plane.within(model.gravity):
        raise AsymmetryError(model.name, f"has gravity that pulls out of the plane {plane}", model.span)


def is_nought(expression: Scalar) -> bool:
    """Return whether an expression is zero for all values of its symbols, as far as multiplying out shows."""
    return bool(expression == 0 or sympy.expand(expression) == 0)


def is_same(a: Any, b: Any) -> bool:
    """Return whether two values of records' fields are equal: expressions, or mappings and tuples of them."""
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(is_same(a[key], b[key]) for key in a)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(is_same(x, y) for x, y in zip(a, b, strict=True))
    if a == b:
        return True
    return isinstance(a, sympy.Expr) and isinstance(b, sympy.Expr) and is_nought(a - b)


def put_in(record: _Record, values: Mapping[Scalar, Scalar]) -> _Record:
    """A record with values in place of symbols, in all its expressions."""
    return replace(record, **{f.name: _put_in(getattr(record, f.name), values) for f in fields(record)})  # type: ignore[type-var, arg-type]


def _put_in(value: Any, values: Mapping[Scalar, Scalar]) -> Any:
    if isinstance(value, tuple):
        return tuple(_put_in(part, values) for part in value)
    if isinstance(value, Mapping):
        return {key: _put_in(part, values) for key, part in value.items()}
    return value.xreplace(values) if isinstance(value, sympy.Basic) else value
