"""Mass, centre of mass and inertia of bodies: as given in any frame and about any point, or of their shapes.

An inertia is a symmetric 3x3 SymPy matrix in global design axes; :func:`moments_problem` says whether one can exist.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.model.document import body_parts, values
from cutjoint.model.document.source import Path
from cutjoint.model.elements.geometry import GLOBAL_AXES, coincide, read_axes, read_direction, read_point
from cutjoint.model.expressions.scope import FAILED, LARGEST, Element
from cutjoint.model.expressions.units import INERTIA, LENGTH, MASS, Dimension
from cutjoint.model.records import Scalar, Shape, ShapeKind, Vector

Array: TypeAlias = NDArray[np.float64]
Matrix: TypeAlias = Any
Inertia: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]

TOLERANCE = 1e-9  #: relative error allowed in the conditions on inertia


@dataclass(frozen=True)
class Lump:
    """A mass with its centre and the inertia about it, (3, 3), and the shapes that it comes from."""

    mass: Scalar
    centre: Vector
    inertia: Matrix
    shapes: tuple[Shape, ...] = ()


def read_mass(element: Element, body: body_parts.Body) -> tuple[Scalar, Vector, Inertia, tuple[Shape, ...]]:
    """Mass, centre of mass, inertia about it (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) in global axes, and the shapes that give them."""
    lump = _given(element, body) if body.shapes is None else _compound(element, body.shapes)
    J = lump.inertia
    return lump.mass, lump.centre, (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]), lump.shapes


def mass_problems(mass: float, inertia: Sequence[float]) -> Iterator[str]:
    """The reasons that no body can have a mass (kg) and an inertia (xx, yy, zz, xy, xz, yz), kg m2."""
    if mass < 0:
        yield f"the mass is negative: {mass:g} kg"
    if any(abs(x) > LARGEST for x in (mass, *inertia)):
        yield f"its mass or inertia is larger than {LARGEST:g} in SI units"
        return
    problem = moments_problem(inertia, has_mass=mass != 0)
    if problem:
        yield problem


def moments_problem(inertia: Sequence[float], *, has_mass: bool = True) -> str:
    """The reason that no body can have an inertia (xx, yy, zz, xy, xz, yz), kg m2; "" if there is none. "" also of an inertia that is not
    finite. Without mass it stands for parts whose mass is counted elsewhere, and one moment may be larger than the sum of the others."""
    if not np.isfinite(inertia).all():
        return ""
    moments = _principal_moments(np.array(inertia, dtype=float))
    shown = ", ".join(f"{moment:g}" for moment in moments)
    if _has_negative(moments):
        return f"a principal moment of inertia is negative: {shown} kg m2"
    if has_mass and _has_too_large(moments):
        return f"a principal moment of inertia is larger than the sum of the other two: {shown} kg m2"
    return ""


def can_exist(masses: Array, inertias: Array) -> NDArray[np.bool_]:
    """Whether bodies can have masses (n,), kg, and inertias (n, 6), kg m2: an array (n,).
    By the conditions of :func:`mass_problems`. Numbers that are not finite have no body."""
    numbers = np.column_stack([masses, inertias])
    able: NDArray[np.bool_] = (masses >= 0) & (np.abs(numbers) <= LARGEST).all(axis=1)
    moments = _principal_moments(inertias[able])
    able[able] = ~_has_negative(moments) & ~((masses[able] != 0) & _has_too_large(moments))
    return able


def _principal_moments(inertias: Array) -> Array:
    """The principal moments of inertias (..., 6), ascending, (..., 3)."""
    matrices = inertias[..., [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(*inertias.shape[:-1], 3, 3)
    return np.asarray(np.linalg.eigvalsh(matrices), dtype=np.float64)


def _has_negative(moments: Array) -> NDArray[np.bool_]:
    return np.asarray(moments[..., 0] < -TOLERANCE * np.abs(moments).max(axis=-1))


def _has_too_large(moments: Array) -> NDArray[np.bool_]:
    """Return whether the largest moment is larger than the sum of the others."""
    return np.asarray(moments[..., 2] > moments[..., 0] + moments[..., 1] + TOLERANCE * np.abs(moments).max(axis=-1))


def _given(element: Element, body: body_parts.Body) -> Lump:
    zero = sympy.Integer(0)
    centre: Vector = (zero, zero, zero)
    if body.centre_of_mass is not None:
        centre = read_point(element, body.centre_of_mass, ("centre_of_mass",))
    mass = zero if body.mass is None else element.scalar(body.mass, MASS, ("mass",))
    inertia = _inertia(element, body.inertia)
    if body.about is not None:
        inertia = _moved(element, inertia, mass, _displacement(read_point(element, body.about, ("about",)), centre))
    return Lump(mass, centre, inertia)


def _moved(element: Element, inertia: Matrix, mass: Scalar, displacement: Matrix) -> Matrix:
    """The inertia about the centre of mass, from that about a point ``displacement`` away, by the parallel-axis theorem."""
    central = inertia - _steiner(mass, displacement)
    problem = moments_problem([element.value(central[ij]) for ij in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])
    if not problem:
        return central
    element.fail(f"no body has this inertia about this point; about its centre of mass {problem}", "check about and mass", ("about",))
    return _scaled(FAILED, sympy.ones(3, 3))


def _displacement(start: Vector, end: Vector) -> Matrix:
    return sympy.Matrix([b - a for a, b in zip(start, end, strict=True)])


def _steiner(mass: Scalar, displacement: Matrix) -> Matrix:
    """The inertia of a point mass at a displacement d: m (d.d 1 - d d^T)."""
    return _scaled(mass, _scaled(displacement.dot(displacement), sympy.eye(3)) - displacement * displacement.T)


def _scaled(factor: Scalar, matrix: Matrix) -> Matrix:
    """A multiple of a matrix; SymPy's own product would lose the matrix where the factor has failed."""
    return matrix.applyfunc(lambda entry: factor * entry)


def _inertia(element: Element, inertia: Any) -> Matrix:
    """The inertia matrix as the file gives it, in global axes."""
    if inertia is None:
        return sympy.zeros(3, 3)
    if isinstance(inertia, values.Principal):
        moments = element.triple(inertia.principal, INERTIA, ("inertia", "principal"))
        if values.ANY in (inertia.x, inertia.y, inertia.z):
            return _axisymmetric(element, inertia, moments)
        return _turned(read_axes(element, inertia, ("inertia",)), sympy.diag(*moments))
    if isinstance(inertia, values.FramedMatrix):
        matrix = _symmetric(element, inertia.matrix, ("inertia", "matrix"))
        return _turned(read_axes(element, inertia, ("inertia",)), matrix)
    if isinstance(inertia, values.AxialInertia):
        moment = element.scalar(inertia.axial, INERTIA, ("inertia", "axial"))
        d = sympy.Matrix(read_direction(element, inertia.axis, ("inertia", "axis")))
        return _scaled(moment, d * d.T)
    return _symmetric(element, inertia, ("inertia",))


def _axisymmetric(element: Element, inertia: values.Principal, moments: Vector) -> Matrix:
    """The inertia with the moment a about an axis d and b across it: b 1 + (a - b) d d^T."""
    directions = {key: direction for key in "xyz" if (direction := getattr(inertia, key)) is not None}
    axes = [key for key, direction in directions.items() if direction != values.ANY]
    failed = _scaled(FAILED, sympy.ones(3, 3))
    if len(axes) != 1 or len(directions) != 2:
        element.fail("inertia: any belongs to one direction beside it", "write for example x: direction, y: any", ("inertia",))
        return failed
    axis = axes[0]
    first, second = (key for key in "xyz" if key != axis)
    about, (a, b) = moments["xyz".index(axis)], (moments["xyz".index(key)] for key in (first, second))
    d = sympy.Matrix(read_direction(element, directions[axis], ("inertia", axis)))
    if not _equal(element, a, b):
        found = f"{element.value(a):g} and {element.value(b):g}"
        message = f"inertia: any needs moments about {first} and {second} that are always equal, not {found}"
        element.fail(message, "give two directions", ("inertia", "principal"))
        return failed
    return _scaled(a, sympy.eye(3)) + _scaled(about - a, d * d.T)


def _equal(element: Element, a: Scalar, b: Scalar) -> bool:
    """Return whether two moments are equal for any values of tunable parameters; True where one is wrong and has been noted."""
    difference = sympy.expand((a - b).xreplace(element.scope.settled))
    if difference.has(FAILED):
        return True
    return not difference.free_symbols and abs(float(difference)) <= TOLERANCE * abs(element.value(a))


def _symmetric(element: Element, numbers: tuple[Any, ...], keys: Path) -> Matrix:
    entries = [element.scalar(value, INERTIA, (*keys, index)) for index, value in enumerate(numbers)]
    xx, yy, zz, xy, xz, yz = [*entries, 0, 0, 0][:6]
    return sympy.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _turned(axes: tuple[Vector, Vector, Vector], matrix: Matrix) -> Matrix:
    """A matrix given along three directions, in global axes."""
    turn = sympy.Matrix([list(axis) for axis in axes]).T
    return turn * matrix * turn.T


# Shapes


def _compound(element: Element, shapes: tuple[body_parts.Shape, ...]) -> Lump:
    lumps = [_lump(element, shape, ("shapes", index)) for index, shape in enumerate(shapes)]
    mass = sum((lump.mass for lump in lumps), sympy.Integer(0))
    if element.value(mass) <= 0:
        element.fail(f"the shapes have no mass: {element.value(mass):g} kg together", "", ("shapes",))
        mass = FAILED
    x, y, z = (sum((lump.mass * lump.centre[i] for lump in lumps), sympy.Integer(0)) / mass for i in range(3))
    inertia = sympy.zeros(3, 3)
    for lump in lumps:
        inertia += lump.inertia + _steiner(lump.mass, _displacement((x, y, z), lump.centre))
    return Lump(mass, (x, y, z), inertia, tuple(shape for lump in lumps for shape in lump.shapes))


def _lump(element: Element, shape: body_parts.Shape, keys: Path) -> Lump:
    match shape:
        case body_parts.PointMass():
            mass = _positive(element, shape.mass, MASS, (*keys, "mass"))
            point = read_point(element, shape.point, (*keys, "point"))
            return Lump(mass, point, sympy.zeros(3, 3), (Shape(kind=ShapeKind.POINT, points=(point,)),))
        case body_parts.Rod():
            return _rod(element, shape, keys)
        case body_parts.Box():
            return _box(element, shape, keys)
        case body_parts.Cylinder():
            return _cylinder(element, shape, keys)
        case body_parts.Sphere():
            r = _positive(element, shape.sphere, LENGTH, (*keys, "sphere"))
            mass = _solid_mass(element, shape, sympy.Rational(4, 3) * sympy.pi * r**3, keys)
            centre = read_point(element, shape.at, (*keys, "at"))
            seen = Shape(kind=ShapeKind.SPHERE, points=(centre,), sizes=(r,), hole=shape.hole)
            return Lump(mass, centre, _scaled(sympy.Rational(2, 5) * mass * r**2, sympy.eye(3)), (seen,))


def _rod(element: Element, shape: body_parts.Rod, keys: Path) -> Lump:
    start = read_point(element, shape.rod.from_, (*keys, "rod", "from"))
    end = read_point(element, shape.rod.to, (*keys, "rod", "to"))
    if coincide(element, start, end):
        element.fail("from and to are the same point", "a rod has two ends", (*keys, "rod", "to"))
    mass = _positive(element, shape.mass, MASS, (*keys, "mass"))
    x, y, z = ((a + b) / 2 for a, b in zip(start, end, strict=True))
    return Lump(mass, (x, y, z), _steiner(mass / 12, _displacement(start, end)), (Shape(kind=ShapeKind.ROD, points=(start, end)),))


def _box(element: Element, shape: body_parts.Box, keys: Path) -> Lump:
    a, b, c = (_positive(element, side, LENGTH, (*keys, "box", index)) for index, side in enumerate(shape.box))
    mass = _solid_mass(element, shape, a * b * c, keys)
    tensor = _scaled(mass / 12, sympy.diag(b**2 + c**2, a**2 + c**2, a**2 + b**2))
    axes = GLOBAL_AXES
    if shape.x is not None or shape.y is not None or shape.z is not None:
        axes = read_axes(element, shape, keys)
        tensor = _turned(axes, tensor)
    centre = read_point(element, shape.at, (*keys, "at"))
    return Lump(mass, centre, tensor, (Shape(kind=ShapeKind.BOX, points=(centre,), axes=axes, sizes=(a, b, c), hole=shape.hole),))


def _cylinder(element: Element, shape: body_parts.Cylinder, keys: Path) -> Lump:
    r, length = (_positive(element, getattr(shape.cylinder, n), LENGTH, (*keys, "cylinder", n)) for n in ("radius", "length"))
    mass = _solid_mass(element, shape, sympy.pi * r**2 * length, keys)
    direction = read_direction(element, shape.axis, (*keys, "axis"))
    axis = sympy.Matrix(direction)
    along, across = mass * r**2 / 2, mass * (3 * r**2 + length**2) / 12
    inertia = _scaled(across, sympy.eye(3)) + _scaled(along - across, axis * axis.T)
    centre = read_point(element, shape.at, (*keys, "at"))
    seen = Shape(kind=ShapeKind.CYLINDER, points=(centre,), axes=(direction,), sizes=(r, length), hole=shape.hole)
    return Lump(mass, centre, inertia, (seen,))


def _solid_mass(element: Element, shape: body_parts.Solid, volume: Scalar, keys: Path) -> Scalar:
    """The mass of a shape with a volume, negative of a hole."""
    if shape.mass is not None:
        mass = _positive(element, shape.mass, MASS, (*keys, "mass"))
    else:
        assert shape.density is not None
        mass = _positive(element, shape.density, MASS / LENGTH**3, (*keys, "density")) * volume
    return -mass if shape.hole else mass


def _positive(element: Element, value: Any, dimension: Dimension, keys: Path) -> Scalar:
    expression = element.scalar(value, dimension, keys)
    if element.value(expression) <= 0:
        what = next(key for key in reversed(keys) if isinstance(key, str))
        hint = "write hole: true for what is missing" if what in ("mass", "density") else ""
        element.fail(f"shapes: {what} must be greater than zero", hint, keys)
        return FAILED
    return expression
