"""Points, directions and inertia of the design position, as exact as their expressions allow."""

from __future__ import annotations

import math
from typing import Any

import sympy

from cutjoint.model import values
from cutjoint.model.errors import nearest
from cutjoint.model.records import Scalar, Vector
from cutjoint.model.scope import FAILED, Element
from cutjoint.model.source import Path
from cutjoint.model.units import INERTIA, LENGTH

#: Cosine of the angle between directions that must be perpendicular.
PERPENDICULAR = 1e-9
#: Directions shorter than this are zero.
SHORTEST = 1e-12

Inertia = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]


def read_point(element: Element, point: Any, keys: Path) -> Vector:
    """A point: three numbers in m, a point's name, or half way between two."""
    if isinstance(point, values.Midpoint):
        p, q = (_named_point(element, name, (*keys, "midpoint", i)) for i, name in enumerate(point.midpoint))
        return _vector((a + b) / 2 for a, b in zip(p, q, strict=True))
    if isinstance(point, str):
        return _named_point(element, point, keys)
    return element.triple(point, LENGTH, keys)


def _named_point(element: Element, name: str, keys: Path) -> Vector:
    points = element.scope.points
    if name not in points:
        element.fail(f"unknown point '{name}'", nearest(name, points, "points here") or "define it under points", keys)
        return (FAILED, FAILED, FAILED)
    return points[name]


def read_direction(element: Element, direction: Any, keys: Path) -> Vector:
    """A unit vector: three numbers of any length, or from one point to another."""
    if isinstance(direction, values.FromTo):
        start = _named_point(element, direction.from_, (*keys, "from"))
        end = _named_point(element, direction.to, (*keys, "to"))
        vector = _vector(b - a for a, b in zip(start, end, strict=True))
    else:
        vector = element.triple(direction, None, keys)
    if math.hypot(*map(element.value, vector)) < SHORTEST:
        element.fail(f"{keys[0]} has no direction: its length is zero", "", keys)
    return unit(vector)


def unit(vector: Vector) -> Vector:
    """``vector`` at length one: in numbers where it is numeric, else symbolically."""
    if any(component.free_symbols for component in vector):
        norm = sympy.sqrt(dot(vector, vector))
        return _vector(component / norm for component in vector)
    length = math.hypot(*(float(component) for component in vector))
    if length in (0.0, 1.0) or math.isnan(length):
        return vector
    return _vector(sympy.Float(float(c) / length) if c != 0 else sympy.Integer(0) for c in vector)


def dot(a: Vector, b: Vector) -> Scalar:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def coincide(element: Element, a: Vector, b: Vector) -> bool:
    """Whether two points are the same at the parameters' values; False when that cannot be told."""
    return math.dist([element.value(c) for c in a], [element.value(c) for c in b]) < SHORTEST


def perpendicular(element: Element, a: Vector, b: Vector) -> bool:
    """Whether two unit vectors are perpendicular at the parameters' values; True when that cannot be told."""
    return not abs(element.value(dot(a, b))) > PERPENDICULAR


def read_inertia(element: Element, inertia: Any) -> Inertia:
    """The inertia matrix about the centre of mass in global axes, kg m2: Ixx, Iyy, Izz, Ixy, Ixz, Iyz."""
    zero = sympy.Integer(0)
    if inertia is None:
        return (zero,) * 6
    if isinstance(inertia, values.Principal):
        return _principal_inertia(element, inertia)
    entries = [element.scalar(value, INERTIA, ("inertia", index)) for index, value in enumerate(inertia)]
    a, b, c, d, e, f = [*entries, zero, zero, zero][:6]
    return (a, b, c, d, e, f)


def _principal_inertia(element: Element, inertia: values.Principal) -> Inertia:
    moments = element.triple(inertia.principal, INERTIA, ("inertia", "principal"))
    axes = _principal_axes(element, inertia)

    def entry(row: int, column: int) -> Scalar:
        return sum((m * axis[row] * axis[column] for m, axis in zip(moments, axes, strict=True)), sympy.Integer(0))

    return (entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2))


def _principal_axes(element: Element, inertia: values.Principal) -> tuple[Vector, Vector, Vector]:
    """The three directions x, y, z; the sign of the one that is not given does not matter to the inertia."""
    given = {key: getattr(inertia, key) for key in "xyz" if getattr(inertia, key) is not None}
    failed = (FAILED, FAILED, FAILED)
    if len(given) != 2:
        element.fail("inertia needs two of the principal directions x, y, z", "", ("inertia",))
        return (failed, failed, failed)
    axes = {key: read_direction(element, value, ("inertia", key)) for key, value in given.items()}
    (first, a), (second, b) = axes.items()
    if not perpendicular(element, a, b):
        message = f"the principal directions {first} and {second} are not perpendicular"
        element.fail(message, "", ("inertia", second))
    third = ({"x", "y", "z"} - axes.keys()).pop()
    axes[third] = cross(a, b)
    return (axes["x"], axes["y"], axes["z"])


def _vector(components: Any) -> Vector:
    a, b, c = components
    return (a, b, c)
