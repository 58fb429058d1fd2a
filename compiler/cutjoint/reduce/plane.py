"""A plane in which a mechanism may move: reflection in it, comparison of expressions, and joints with the motions in it alone."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import sympy

from cutjoint.elements.force import Mirror
from cutjoint.model.elements.geometry import GLOBAL_AXES, cross, least_component
from cutjoint.model.elements.mirror import mirror_along
from cutjoint.model.outcome import Note
from cutjoint.model.records import COORDINATES, GROUND, Joint, JointKind, Scalar, Span, Vector

K = JointKind


class AsymmetryError(ValueError):
    """An element is not symmetric about a plane, or leaves it; ``note`` names it."""

    def __init__(self, element: str, text: str, span: Span) -> None:
        super().__init__(f"{span}: '{element}' {text}")
        self.note = Note(element=element, text=text, span=span)


@dataclass(frozen=True, kw_only=True)
class Plane:
    """The plane through the design frame's origin across the global ``axis`` "x", "y" or "z"."""

    axis: str

    def __str__(self) -> str:
        return f"{self.axis} = 0"

    @property
    def mirror(self) -> Mirror:
        """The reflection matrix."""
        return mirror_along(self.axis)

    @property
    def normal(self) -> Vector:
        """The unit vector along the axis."""
        return GLOBAL_AXES["xyz".index(self.axis)]

    @property
    def across(self) -> str:
        """An axis in the plane: angles and angular velocities about it leave the plane."""
        return "z" if self.axis == "x" else "x"

    def along_normal(self, direction: Vector) -> bool:
        """Return whether a direction is normal to the plane."""
        return all(is_zero(c) for c in cross(self.normal, direction))

    def within(self, direction: Vector) -> bool:
        """Return whether a direction, or a point, lies in the plane."""
        return is_zero(direction["xyz".index(self.axis)])

    def tangents(self) -> tuple[Vector, Vector]:
        """The directions of the displacements of a planar joint whose normal is the plane's."""
        first = cross(self.normal, GLOBAL_AXES[least_component(self.normal)])
        return first, cross(self.normal, first)


def is_zero(expression: Scalar) -> bool:
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
    return isinstance(a, sympy.Expr) and isinstance(b, sympy.Expr) and is_zero(a - b)


@dataclass(frozen=True, kw_only=True)
class InPlane:
    """A joint in the plane: ``kept`` has for a coordinate or speed of the whole joint its name here and a factor.
    Those that are not kept would leave the plane and are zero; ``unknown`` ones depend on which of its bodies is the inner one."""

    joint: Joint
    kept: Mapping[str, tuple[str, int]]
    unknown: frozenset[str] = frozenset()


def restrict(joint: Joint, plane: Plane) -> InPlane:
    """A tree joint between bodies in the plane with the motions in the plane alone. A joint that the model cuts needs no such change: its
    other equations hold by themselves. Raises AsymmetryError: the motions that remain are not those of one of the joint kinds."""
    found = _RULES[joint.kind](joint, plane) if joint.kind in _RULES else None
    if found is None:
        raise AsymmetryError(joint.name, f"is a {joint.kind} joint without a counterpart in the plane {plane}", joint.span)
    return found


def _changed(joint: Joint, kind: str, axes: tuple[Vector, ...], kept: Mapping[str, str]) -> InPlane:
    """A joint of another kind that keeps some coordinates under new names, with their rates."""
    names = COORDINATES[joint.kind]
    guides = dict(zip(names, joint.guide or (), strict=False))
    guide = tuple(guides[name] for name in kept) if joint.guide is not None and kept else None
    rates = {f"{old}_rate": f"{new}_rate" for old, new in kept.items()}
    return InPlane(
        joint=replace(joint, kind=kind, axes=axes, to=None, pitch=None, guide=guide),
        kept={old: (new, 1) for old, new in {**kept, **rates}.items()},
    )  # fmt: skip


def _unchanged(joint: Joint, plane: Plane) -> InPlane:
    return _changed(joint, joint.kind, joint.axes, {name: name for name in COORDINATES[joint.kind]})


def _at_rest(joint: Joint) -> InPlane:
    return _changed(joint, K.FIXED, (), {})


def _revolute(joint: Joint, plane: Plane) -> InPlane:
    return _unchanged(joint, plane) if plane.along_normal(joint.axes[0]) else _at_rest(joint)


def _prismatic(joint: Joint, plane: Plane) -> InPlane | None:
    if plane.within(joint.axes[0]):
        return _unchanged(joint, plane)
    return _at_rest(joint) if plane.along_normal(joint.axes[0]) else None


def _cylindrical(joint: Joint, plane: Plane) -> InPlane | None:
    if plane.along_normal(joint.axes[0]):
        return _changed(joint, K.REVOLUTE, joint.axes, {"angle": "angle"})
    return _changed(joint, K.PRISMATIC, joint.axes, {"displacement": "displacement"}) if plane.within(joint.axes[0]) else None


def _universal(joint: Joint, plane: Plane) -> InPlane | None:
    """A universal joint becomes a hinge: one axis is normal to the plane, the other does not rotate."""
    along = [i for i, axis in enumerate(joint.axes) if plane.along_normal(axis)]
    return _changed(joint, K.REVOLUTE, (joint.axes[along[0]],), {f"angle_{along[0] + 1}": "angle"}) if along else None


def _spherical(joint: Joint, plane: Plane) -> InPlane:
    hinge = _changed(joint, K.REVOLUTE, (plane.normal,), {})
    return replace(hinge, unknown=frozenset({f"w{plane.axis}"}))


def _free(joint: Joint, plane: Plane) -> InPlane | None:
    """A planar joint relative to the ground, with displacements along global axes."""
    if GROUND not in (joint.base, joint.follower):
        return None
    body = joint.follower if joint.base == GROUND else joint.base
    kept = {f"w{plane.axis}": ("angle_rate", 1)}
    for name, tangent in zip(("displacement_1", "displacement_2"), plane.tangents(), strict=True):
        (axis,) = (a for a, component in zip("xyz", tangent, strict=True) if component != 0)
        sign = int(tangent["xyz".index(axis)])
        kept |= {axis: (name, sign), f"v{axis}": (f"{name}_rate", sign)}
    return InPlane(joint=replace(joint, kind=K.PLANAR, base=GROUND, follower=body, axes=(plane.normal,), cut=False), kept=kept)


_RULES: Mapping[str, Callable[[Joint, Plane], InPlane | None]] = {
    K.FIXED: _unchanged, K.REVOLUTE: _revolute, K.PRISMATIC: _prismatic, K.CYLINDRICAL: _cylindrical, K.UNIVERSAL: _universal,
    K.PLANAR: lambda joint, plane: _unchanged(joint, plane) if plane.along_normal(joint.axes[0]) else None,
    K.SPHERICAL: _spherical, K.FREE: _free,
}  # fmt: skip
