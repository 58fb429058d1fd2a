"""Forces, those of joints included: from the document's parts to records, not yet mirrored."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any

import sympy

from cutjoint.elements.force import Bristle, Law
from cutjoint.elements.forces import FORCES
from cutjoint.elements.forces.joint_force import BallSpring, JointForce, law_on
from cutjoint.model.document import element_parts as force_parts
from cutjoint.model.document import element_parts as joint_parts
from cutjoint.model.document.source import Path
from cutjoint.model.document.values import SpringDamper
from cutjoint.model.elements.friction import read_friction
from cutjoint.model.elements.gears import Naming, read_coordinate
from cutjoint.model.elements.geometry import GLOBAL_AXES, coincide, read_across, read_axes, read_direction, read_point, rotated_axes
from cutjoint.model.expressions.laws import LawKind, read_law, read_names, soft_stops
from cutjoint.model.expressions.parse import variable
from cutjoint.model.expressions.scope import Element
from cutjoint.model.expressions.units import ANGLE, ANGULAR_SPEED, FORCE, INERTIA, LENGTH, NONE, SPEED, TIME, TORQUE, Dimension
from cutjoint.model.names import name_problem
from cutjoint.model.records import Force, Scalar, Vector

#: The dimensions of the units in the catalogue of force kinds.
_DIMENSIONS: Mapping[str, Dimension] = {
    "m": LENGTH, "m/s": SPEED, "rad": ANGLE, "rad/s": ANGULAR_SPEED, "N": FORCE, "N/m": FORCE / LENGTH, "N*s/m": FORCE / SPEED,
    "N*m": TORQUE, "1": NONE, "N*m*s": TORQUE / ANGULAR_SPEED, "kg*m^2": INERTIA,
}  # fmt: skip
#: The endings of the names of a joint's own forces, by the field that makes them.
JOINT_FORCES = {"spring": "spring", "limits": "stop"}


def _kind_of(law: Law) -> LawKind:
    """A law of the catalogue with its dimensions, over time too."""
    variables = {name: _DIMENSIONS[unit] for name, unit in law.variables.items()}
    return LawKind({**variables, "t": TIME}, _DIMENSIONS[law.unit])


@dataclass(frozen=True)
class _Reader:
    """Reads the fields of one force, as `cutjoint.elements.force.Reader` says."""

    element: Element
    part: force_parts.Force

    def common(self) -> Mapping[str, Any]:
        fields = {"name": self.element.name, "active": self.part.active, "span": self.element.span}
        if hasattr(self.part, "bodies"):
            fields["base"], fields["follower"] = self.element.two_bodies(self.part.bodies)
        return fields

    def field(self, name: str) -> Any:
        return getattr(self.part, force_parts.attribute(name))

    def body(self, name: str) -> str:
        return self.element.body(self.field(name), (name,))

    def coordinate(self, joint: str, coordinate: str) -> tuple[str, str, str]:
        name, part = self.element.joint(self.field(joint), (joint,))
        if part is None:
            return name, "", ""
        found = read_coordinate(self.element, name, part, self.field(coordinate), _naming((joint,), (coordinate,)))
        return name, found.name, found.unit

    def point(self, name: str) -> Vector:
        return read_point(self.element, self.field(name), (name,))

    def distinct(self, start: Vector, end: Vector, *, names: tuple[str, str], hint: str) -> None:
        if coincide(self.element, start, end):
            self.element.fail(f"{' and '.join(names)} are the same point", hint, (names[1],))

    def direction(self, name: str) -> Vector:
        return read_direction(self.element, self.field(name), (name,))

    def across(self, direction: Vector, name: str) -> Vector:
        if self.field(name) is None:
            sizes = [abs(self.element.value(component)) for component in direction]
            return read_across(self.element, direction, GLOBAL_AXES[sizes.index(min(sizes))], ())
        return read_across(self.element, direction, self.direction(name), (name,))

    def frame(self) -> tuple[Vector, Vector, Vector]:
        is_given = any(self.field(axis) is not None for axis in "xyz")
        return read_axes(self.element, self.part, ()) if is_given else GLOBAL_AXES

    def number(self, *path: str | int, unit: str) -> Scalar:
        found = self.element.scalar(self._at(path, missing=0), _DIMENSIONS[unit] if unit else None, path)
        if path in (("radius",), ("cylinder",)):
            value, may_be_point = self.element.value(found), type(self.part).model_fields[str(path[0])].default == 0
            if value < 0 or (value == 0 and not may_be_point):
                self.element.fail(f"{path[0]} must be greater than zero", "", path)
        return found

    def expression(self, name: str, *, unit: str) -> Scalar:
        return self.element.scalar(self.field(name), _DIMENSIONS[unit], (name,), self.element.scope.reading("t"))

    def triple(self, name: str, law: Law, *, let: str) -> Vector:
        names = read_names(self.element, self.field(let), (let,), self.element.scope.reading(units=_kind_of(law).variables))
        return self.element.triple(self.field(name), _DIMENSIONS[law.unit], (name,), names)

    def law(self, *path: str | int, law: Law, drawn: Scalar = 0) -> Scalar:
        return read_law(self.element, self._at(path), _kind_of(law), path, drawn=drawn)

    def friction(self, unit: str) -> tuple[Scalar, Bristle]:
        return read_friction(self.element, self.part, unit)

    def distance(self, start: Vector, end: Vector) -> Scalar:
        return sympy.sqrt(sum((b - a) ** 2 for a, b in zip(start, end, strict=True)))

    def variable(self, name: str) -> Scalar:
        return variable(name)

    def _at(self, path: Path, missing: Any = None) -> Any:
        """The value at a path, through lists and parts."""
        first, *rest = path
        field = self.field(str(first))
        if field is None:
            return missing
        return reduce(lambda value, key: value[key] if isinstance(key, int) else getattr(value, key), rest, field)


def read_force(element: Element, force: force_parts.Force) -> Force:
    """One of the elements under ``forces``."""
    return FORCES[force.kind].read(_Reader(element, force))


def _naming(joint: Path, coordinate: Path) -> Naming:
    return Naming("a force needs one to act on", "coordinate: ", "", joint, coordinate)


def joint_forces(element: Element, joint: joint_parts.Joint) -> Iterator[Force]:
    """The spring and the stops that are defined in a joint."""
    for field, suffix in JOINT_FORCES.items():
        part: joint_parts.JointSpring | joint_parts.BallSpring | joint_parts.JointLimits | None = getattr(joint, field)
        if part is None:
            continue
        span = element.scope.source.key_span((*element.path, field))
        common: dict[str, Any] = {"name": f"{element.name}_{suffix}", "active": True, "span": span}
        if isinstance(part, joint_parts.BallSpring):
            yield _ball_spring(element, joint, part, common)
        else:
            coordinate = read_coordinate(element, element.name, joint, part.coordinate, _naming((field,), (field, "coordinate")))
            kind = _kind_of(law_on(coordinate.unit))
            law = _spring_law(element, part, kind) if isinstance(part, joint_parts.JointSpring) else _stop_law(element, part, kind)
            yield JointForce(**common, joint=element.name, coordinate=coordinate.name, unit=coordinate.unit, law=law)
        problem = name_problem(f"{element.path[-1]}_{suffix}")
        if problem:
            element.fail(f"{field}: {problem[0]}", "rename the joint", (field,), at_key=True)


def _ball_spring(element: Element, joint: joint_parts.Joint, spring: joint_parts.BallSpring, common: Mapping[str, Any]) -> BallSpring:
    base, follower = element.two_bodies(joint.bodies)
    stiffness, damping = (
        element.scalar(getattr(spring, name), _DIMENSIONS[unit], ("spring", name))
        for name, unit in (("stiffness", "N*m"), ("damping", "N*m*s"))
    )
    rest = None if spring.free_rotation is None else element.triple(spring.free_rotation, ANGLE, ("spring", "free_rotation"))
    axes = GLOBAL_AXES if rest is None else rotated_axes(rest)
    return BallSpring(**common, of=element.name, base=base, follower=follower, axes=axes, stiffness=stiffness, damping=damping)


def _spring_law(element: Element, spring: joint_parts.JointSpring, kind: LawKind) -> Scalar:
    rest = 0 if spring.free_position is None and spring.preload is None else spring.free_position
    law = SpringDamper(stiffness=spring.stiffness, damping=spring.damping, preload=spring.preload, free_position=rest)
    return read_law(element, law, kind, ("spring",))


def _stop_law(element: Element, limits: joint_parts.JointLimits, kind: LawKind) -> Scalar:
    lower, upper = limits.lower, limits.upper
    if lower is not None and upper is not None:
        low, high = (element.value(element.scalar(x, None, ("limits", key))) for x, key in ((lower, "lower"), (upper, "upper")))
        if low >= high:
            element.fail("limits: lower is not below upper", "", ("limits",))
    return soft_stops(element, kind, ("limits",), limits.stiffness, limits.damping, lower=lower, upper=upper)
