"""The force elements of a description, over forms of points and directions.

- ``point_spring``: forms way; a law over its length,
- ``along``: forms way, axis; a law over way . axis,
- ``angle``: a law over a node; ``course``: over a guided coordinate, for its reports alone,
- ``bushing``: forms way, three axes of the base, three of the follower; six laws,
- ``load``: forms [point,] [three axes of the body]; components over place, velocity and angular velocity, with their derivatives,
- ``tyre``: forms centre, axis, three axes of the body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import sympy

from cutjoint.elements.interaction import Interaction, Point
from cutjoint.elements.interactions.axis_force import AxisForce
from cutjoint.elements.interactions.compliance import Compliance
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.elements.interactions.on_coordinate import OnCoordinate
from cutjoint.elements.interactions.road_contact import RoadContact
from cutjoint.elements.interactions.wrench import Wrench
from cutjoint.formulate.natural.nodes import Uses
from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.expressions.parse import variable
from cutjoint.model.records import GROUND, BodyLoad, Force, JointForce, LawForce, Output, Tyre, Vector
from cutjoint_bench.generic.mechanism import placed_forces
from cutjoint_bench.generic.natural.forms import FormTable
from cutjoint_bench.generic.trees import Json, Trees, quantity_names

ORIGIN: Vector = (sympy.Integer(0),) * 3


@dataclass(frozen=True, kw_only=True)
class ForceElement:
    """A force element and the forms that it works on."""

    name: str
    kind: str
    quantities: list[str]
    details: Json
    forms: tuple[Uses, ...] = ()


def force_elements(table: FormTable, trees: Trees, outputs: tuple[Output, ...]) -> Iterator[ForceElement]:
    """The forces that the scene has switched on, and those of which outputs ask where their parts are."""
    maker = _Forces(table, trees)
    rules: Mapping[type[Interaction], Callable[..., tuple[str, Json, tuple[Uses, ...]]]] = {
        LineForce: maker.stretch, AxisForce: maker.travel, OnCoordinate: maker.on_coordinate, Compliance: maker.compliance,
        Wrench: maker.load, RoadContact: maker.contact,
    }  # fmt: skip
    for force in placed_forces(trees.model, trees.scene, outputs):
        how = force.interaction
        kind, details, forms = rules[type(how)](force, how)
        yield ForceElement(name=force.name, kind=kind, quantities=quantity_names(force), details=details, forms=forms)


class _Forces:
    def __init__(self, table: FormTable, trees: Trees) -> None:
        self._table = table
        self._trees = trees
        self._joints = {j.name: j for j in trees.model.joints}
        self._tyres: list[Force] = [f for f in trees.model.forces if f.has_road]

    def _axes(self, body: str, axes: tuple[Vector, ...] = GLOBAL_AXES) -> tuple[Uses, ...]:
        return tuple(self._table.direction(body, axis) for axis in axes)

    def _way(self, end: Point, start: Point, force: Force) -> Uses:
        return self._table.way((end.body(force), end.of(force)), (start.body(force), start.of(force)))

    def stretch(self, force: LawForce, how: LineForce) -> tuple[str, Json, tuple[Uses, ...]]:
        way = self._way(how.end, how.start, force)
        return "point_spring", {"law": self._trees.law(force.law, "length")}, (way,)

    def travel(self, force: LawForce, how: AxisForce) -> tuple[str, Json, tuple[Uses, ...]]:
        way = self._way(how.point, how.origin, force)
        details = {"variable": "travel", "law": self._trees.law(force.law, "travel")}
        return "along", details, (way, self._table.direction(how.axis.body(force), how.axis.of(force)))

    def on_coordinate(self, force: JointForce, how: OnCoordinate) -> tuple[str, Json, tuple[Uses, ...]]:
        joint, layout, law = self._joints[force.joint], self._table.layout, self._trees.law(force.law, "position")
        if joint.guide is not None:
            guide = joint.guide[joint.element.coordinates.index(force.coordinate)]
            return "course", {"law": law, "course": self._trees.guide(guide)}, ()
        if force.coordinate in joint.element.measures:
            return "angle", {"law": law, "angle": layout.nodes.index(layout.angles[joint.name, force.coordinate])}, ()
        return "along", {"variable": "position", "law": law}, self._table.slide(joint, force.coordinate)

    def compliance(self, force: Force, how: Compliance) -> tuple[str, Json, tuple[Uses, ...]]:
        laws = [self._trees.law(law, "position") for law in force.expressions]
        axes = (self._axes(end.body(force), how.frame.of(force)) for end in (how.base, how.follower))
        return "bushing", {"laws": laws}, (self._way(how.follower, how.base, force), *(axis for several in axes for axis in several))

    def load(self, load: BodyLoad, how: Wrench) -> tuple[str, Json, tuple[Uses, ...]]:
        at = () if load.point is None else (self._table.way((load.body, load.point), (GROUND, ORIGIN)),)
        axes = self._axes(load.body) if load.needs_attitude else ()
        by = [
            [[i, *self._trees.only_moving(load, [self._trees.one(derivative)])] for i, derivative in derivatives(component)]
            for component in load.components
        ]
        details = {"torque": load.point is None, "in_body": load.has_frame, "components": self._trees.loads(load), "by": by}
        return "load", details, (*at, *axes)

    def contact(self, tyre: Tyre, how: RoadContact) -> tuple[str, Json, tuple[Uses, ...]]:
        centre = self._table.way((tyre.body, tyre.centre), (GROUND, ORIGIN))
        details = {"road": self._tyres.index(tyre), "constants": self._trees.constants(tyre)}
        return "tyre", details, (centre, self._table.direction(tyre.body, tyre.axis), *self._axes(tyre.body))


def derivatives(component: Any) -> Iterator[tuple[int, Any]]:
    """The derivatives of a load's component by those variables (x to z, vx to vz, wx to wz) that it uses."""
    for i, name in enumerate(["x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz"]):
        derivative = sympy.diff(component, variable(name))
        if derivative != 0:
            yield i, derivative
