"""Points, directions and frames of the design position, as exact as their expressions allow."""

import math
from typing import Any

import sympy

from cutjoint.model.document import values
from cutjoint.model.document.source import Path, field_name
from cutjoint.model.errors import nearest, worded
from cutjoint.model.expressions.scope import FAILED, Element
from cutjoint.model.expressions.units import LENGTH, NONE
from cutjoint.model.ranges import fault_of_state
from cutjoint.model.records import Scalar, Vector

PERPENDICULAR = 1e-9  #: cosine of the angle between directions that must be perpendicular
#: The directions x, y, z of the design frame.
GLOBAL_AXES: tuple[Vector, Vector, Vector] = (
    (sympy.Integer(1), sympy.Integer(0), sympy.Integer(0)),
    (sympy.Integer(0), sympy.Integer(1), sympy.Integer(0)),
    (sympy.Integer(0), sympy.Integer(0), sympy.Integer(1)),
)
_TINY = 1e-300  #: added to the square of an angle, rad, so that a rotation by zero has a direction
SHORTEST = 1e-12  #: directions shorter than this are zero


def read_point(element: Element, point: Any, keys: Path) -> Vector:
    """A point: three numbers in m, a point's name, the midpoint of two, or the sum of a point and vectors."""
    if isinstance(point, values.Midpoint):
        p, q = (_named_point(element, name, (*keys, "midpoint", i)) for i, name in enumerate(point.midpoint))
        return _vector((a + b) / 2 for a, b in zip(p, q, strict=True))
    if isinstance(point, str):
        return _named_point(element, point, keys)
    is_sum = isinstance(point, values.PointSum)
    found = _sum(element, point.sum, (*keys, "sum")) if is_sum else element.triple(point, LENGTH, keys)
    for i, component in enumerate(found):
        if fault := fault_of_state(element.value(component), is_angle=False):
            element.fail(worded(field_name(keys), fault), "", keys if is_sum else (*keys, i))
            return (FAILED, FAILED, FAILED)
    return found


def _sum(element: Element, addends: tuple[Any, ...], keys: Path) -> Vector:
    """A point, and vectors that lead on from it."""
    if isinstance(addends[0], values.ScaledDisplacement | values.Along):
        element.fail(f"{field_name(keys)} begins with a vector", "begin with a point", (*keys, 0))
        return (FAILED, FAILED, FAILED)
    total = read_point(element, addends[0], (*keys, 0))
    for i, addend in enumerate(addends[1:], 1):
        vector = _read_vector(element, addend, (*keys, i))
        total = _vector(a + b for a, b in zip(total, vector, strict=True))
    return total


def _read_vector(element: Element, vector: Any, keys: Path) -> Vector:
    """A vector in m: three numbers, from one point to another, or along a direction."""
    match vector:
        case values.ScaledDisplacement():
            times = element.scalar(vector.times, NONE, (*keys, "times"))
            return _vector(times * c for c in _between(element, vector, keys))
        case values.Along():
            direction, by = read_direction(element, vector.along, (*keys, "along")), element.scalar(vector.by, LENGTH, (*keys, "by"))
            return _vector(by * c for c in direction)
        case values.LOST:
            return (FAILED, FAILED, FAILED)
        case str() | values.Midpoint():
            element.fail(f"{field_name(keys)}: only the first can be a point", "write {from: P, to: Q} for a vector", keys)
            return (FAILED, FAILED, FAILED)
    return element.triple(vector, LENGTH, keys)


def _between(element: Element, ends: values.FromTo, keys: Path) -> Vector:
    """The vector from one point to another."""
    start = _named_point(element, ends.from_, (*keys, "from"))
    end = _named_point(element, ends.to, (*keys, "to"))
    return _vector(b - a for a, b in zip(start, end, strict=True))


def _named_point(element: Element, name: str, keys: Path) -> Vector:
    scope, points = element.scope, element.scope.points
    if name in points:
        return points[name]
    if scope.prefix and name in scope.directory.points:
        remedy = "define it under points of the submodel; points of an instance move it"
        element.fail(f"'{name}' is a point of the model, and a submodel does not see it", remedy, keys)
    elif not scope.directory.misses(scope.prefix + name):
        hint = nearest(name, [*points, *scope.broken("points")], "points here") or "define it under points"
        element.fail(f"unknown point '{name}'", hint, keys)
    return (FAILED, FAILED, FAILED)


def read_direction(element: Element, direction: Any, keys: Path) -> Vector:
    """A unit vector: an axis of the design frame by its name, three numbers of any length, or from one point to another."""
    if isinstance(direction, str):
        axis = GLOBAL_AXES["xyz".index(direction[-1])]
        return _vector(-c for c in axis) if direction.startswith("-") else axis
    vector = _between(element, direction, keys) if isinstance(direction, values.FromTo) else element.triple(direction, None, keys)
    vector = element.settle(vector)
    if math.hypot(*map(element.value, vector)) < SHORTEST:
        element.fail(f"{field_name(keys)} has no direction: its length is zero", "", keys)
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


def least_component(direction: Vector) -> int:
    """The first of the components of a numeric direction that are least in size: tangents across it begin with that axis."""
    return min(range(3), key=lambda i: (abs(float(direction[i])), i))


def dot(a: Vector, b: Vector) -> Scalar:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def coincide(element: Element, a: Vector, b: Vector) -> bool:
    """Return whether two points coincide at the parameters' values; False when that cannot be decided."""
    return math.dist([element.value(c) for c in a], [element.value(c) for c in b]) < SHORTEST


def perpendicular(element: Element, a: Vector, b: Vector) -> bool:
    """Return whether two unit vectors are perpendicular at the parameters' values; True when that cannot be decided."""
    return not abs(element.value(dot(a, b))) > PERPENDICULAR


def read_across(element: Element, direction: Vector, vector: Vector, keys: Path) -> Vector:
    """The unit vector of a vector's part across a direction; notes a vector along it."""
    share = dot(direction, vector)
    part = _vector(v - share * d for v, d in zip(vector, direction, strict=True))
    if math.hypot(*map(element.value, part)) < PERPENDICULAR:
        element.fail(f"{field_name(keys)} is along the normal", "write a direction across it, or leave it out", keys)
        return (FAILED, FAILED, FAILED)
    return unit(part)


def read_axes(element: Element, part: Any, keys: Path) -> tuple[Vector, Vector, Vector]:
    """The directions x, y, z of a frame, of which the part gives two; the three make a right-handed frame."""
    axes = {key: getattr(part, key) for key in "xyz" if getattr(part, key) is not None}
    failed = (FAILED, FAILED, FAILED)
    if len(axes) != 2:
        element.fail(f"{field_name(keys) or 'its frame'} needs two of the directions x, y, z", "", keys)
        return (failed, failed, failed)
    axes = {key: read_direction(element, value, (*keys, key)) for key, value in axes.items()}
    (first, a), (second, b) = axes.items()
    if not perpendicular(element, a, b):
        element.fail(f"the directions {first} and {second} are not perpendicular", "", (*keys, second))
        return (failed, failed, failed)
    third = ({"x", "y", "z"} - axes.keys()).pop()
    axes[third] = cross(b, a) if third == "y" else cross(a, b)
    return (axes["x"], axes["y"], axes["z"])


def rotated_axes(rotation_vector: Vector) -> tuple[Vector, Vector, Vector]:
    """The directions x, y, z rotated by a rotation vector, rad (Rodrigues); a zero vector may depend on parameters."""
    angle = sympy.sqrt(sum(part**2 for part in rotation_vector) + _TINY)
    first, second = sympy.sin(angle) / angle, 2 * (sympy.sin(angle / 2) / angle) ** 2
    along = [_vector(rotation_vector[i] * part for part in rotation_vector) for i in range(3)]
    x, y, z = (
        _vector(
            (sympy.cos(angle) if i == k else 0) + first * part + second * along[k][i]
            for i, part in enumerate(cross(rotation_vector, GLOBAL_AXES[k]))
        )
        for k in range(3)
    )
    return x, y, z


def _vector(components: Any) -> Vector:
    a, b, c = components
    return (a, b, c)
