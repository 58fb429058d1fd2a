"""Elements that nearly are each other's images, and their means."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import chain
from math import hypot
from typing import Any

import sympy

from cutjoint.elements.interaction import Axis, Point
from cutjoint.model.elements import Elements
from cutjoint.model.evaluate import evaluate
from cutjoint.model.geometry import unit
from cutjoint.model.mirror import mirror_elements, reflected_law
from cutjoint.model.records import Body, Force, Joint, Model, Scalar, Vector
from cutjoint.reduce.half.images import NAMING, Images, Pairs
from cutjoint.reduce.half.plane import is_same

#: The tolerance of nearness: a share of a mechanism's size, of a number, of a law's values.
NEAR = 0.05

#: The largest difference of a unit vector's length from one.
_UNIT = 1e-9

#: The samples at which laws are compared: values that their variables take in turn.
_SAMPLES = (-0.7, -0.2, 0.0, 0.3, 0.6, 1.1)


@dataclass(frozen=True, kw_only=True)
class Nearness:
    """Compares fields of records: places by the mechanism's ``size`` (m), directions and numbers by their own, laws by what they give."""

    values: Mapping[Scalar, float]
    size: float

    def __call__(self, a: Any, b: Any) -> bool:
        if a is b or a == b:
            return True
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            return a.keys() == b.keys() and all(self(a[key], b[key]) for key in a)
        if isinstance(a, tuple) and isinstance(b, tuple):
            return len(a) == len(b) and self._are_near(a, b)
        return isinstance(a, sympy.Basic) and isinstance(b, sympy.Basic) and self._are_near((a,), (b,))

    def _are_near(self, a: tuple[Any, ...], b: tuple[Any, ...]) -> bool:
        if any(isinstance(x, tuple) for x in (*a, *b)):
            return all(self(x, y) for x, y in zip(a, b, strict=True))
        free = sorted({s for x in (*a, *b) for s in sympy.sympify(x).free_symbols} - self.values.keys(), key=str)
        for shift in range(len(_SAMPLES) if free else 1):
            place = {s: _SAMPLES[(shift + i) % len(_SAMPLES)] for i, s in enumerate(free)}
            ours, theirs = ([evaluate(sympy.sympify(x), {**self.values, **place}) for x in side] for side in (a, b))
            reach = max(map(abs, (*ours, *theirs)))
            is_place = len(a) == 3 and not free and not (_is_direction(ours) and _is_direction(theirs))
            reach = max(reach, self.size) if is_place else reach
            if any(abs(x - y) > NEAR * reach for x, y in zip(ours, theirs, strict=True)):
                return False
        return True


def _is_direction(vector: Sequence[float]) -> bool:
    return abs(hypot(*vector) - 1) < _UNIT


def nearness(model: Model) -> Nearness:
    """The comparison at the values of a model's parameters; its size is the widest way between joints' points along an axis."""
    values = {p.symbol: p.value for p in model.parameters}
    places = [[evaluate(sympy.sympify(c), values) for c in joint.at] for joint in model.joints]
    return Nearness(values=values, size=max((max(column) - min(column) for column in zip(*places, strict=True)), default=0.0))


def mean(a: Any, b: Any) -> Any:
    """The mean of two values of a field; the first of two values without a mean."""
    if is_same(a, b):
        return a
    if isinstance(a, tuple):
        return tuple(mean(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, Mapping):
        return {key: mean(a[key], b[key]) for key in a}
    return (a + b) / 2 if isinstance(a, sympy.Basic) else a


def mean_direction(a: Vector, b: Vector) -> Vector:
    """The unit vector between two that may be opposite; ``a`` is its side."""
    if is_same(a, b):
        return a
    opposite = hypot(*(float(x + y) for x, y in zip(a, b, strict=True))) < 1
    x, y, z = mean(a, tuple(-c for c in b) if opposite else b)
    return unit((x, y, z))


@dataclass(frozen=True, kw_only=True)
class AveragedModel:
    """A model with the mean of each element and the reflection of its image."""

    model: Model
    pairs: Pairs
    images: Images

    def model_between(self) -> Model:
        """The model; elements without an image stay."""
        axis = self.pairs.plane.axis
        model, shown = self.model, mirror_elements(Elements(self.model.bodies, self.model.joints, self.model.forces, (), ()), axis)
        seen = {e.name: e for e in chain[Any](shown.bodies, shown.joints, shown.forces)}
        known = {e.name for e in chain[Any](self.pairs.elements.bodies, self.pairs.elements.joints)}
        bodies = tuple(_mean_body(b, seen[self.images.bodies[b.name]]) if b.name in known else b for b in model.bodies)
        joints = tuple(mean_joint(j, seen[self.images.joints[j.name]]) if j.name in known else j for j in model.joints)
        forces = tuple(self._mean_force(f, seen[self.images.forces[f.name]]) if f.name in self.images.forces else f for f in model.forces)
        across = self.pairs.plane.mirror.vector(model.gravity)
        gravity = mean(model.gravity, across) if self.pairs.same(model.gravity, across) else model.gravity
        return replace(model, bodies=bodies, joints=joints, forces=forces, gravity=gravity)

    def _mean_force(self, force: Force, seen: Force) -> Force:
        if force.joint_of:
            image, sign = next(f for f in self.model.forces if f.name == seen.name), self.images.signs[force.joint_of][force.coordinate_of]
            laws = {name: mean(getattr(force, name), reflected_law(getattr(image, name), sign)) for name in force.element.laws}
            return replace(force, **laws)
        if tuple(self.images.bodies[body] for body in force.bodies) != seen.bodies:
            seen = replace(seen, **seen.swapped)
        directions = [place for place in force.places if not isinstance(place, Point)]
        names = [f.name for f in fields(force) if f.name not in (*NAMING, *(place.field for place in directions))]
        between = {name: mean(getattr(force, name), getattr(seen, name)) for name in names}
        for axis in (place for place in directions if isinstance(place, Axis)):
            between[axis.field] = mean_direction(axis.of(force), axis.of(seen))
        return replace(force, **between)


def _mean_body(body: Body, seen: Body) -> Body:
    names = ("mass", "centre_of_mass", "inertia")
    return replace(body, **{name: mean(getattr(body, name), getattr(seen, name)) for name in names})


def mean_joint(joint: Joint, seen: Joint) -> Joint:
    """A joint between itself and what the mirror shows of another; its guide is its own."""
    axes = mean_axes(joint.axes, seen.axes)
    return replace(joint, at=mean(joint.at, seen.at), axes=axes, to=mean(joint.to, seen.to), pitch=mean(joint.pitch, seen.pitch))


def mean_axes(axes: Iterable[Vector], seen: Iterable[Vector]) -> tuple[Vector, ...]:
    """The mean directions of a joint and of its reflection."""
    return tuple(mean_direction(a, b) for a, b in zip(axes, seen, strict=True))
