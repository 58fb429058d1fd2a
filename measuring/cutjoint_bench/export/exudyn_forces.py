"""Forces -> statements of a script for Exudyn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from cutjoint.elements.interaction import Point
from cutjoint.elements.interactions.axis_force import AxisForce
from cutjoint.elements.interactions.compliance import Compliance
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.elements.interactions.on_coordinate import OnCoordinate
from cutjoint.elements.interactions.road_contact import RoadContact
from cutjoint.elements.interactions.wrench import Wrench
from cutjoint.elements.joint import AXIAL_FRAME
from cutjoint.formulate.inputs import TIME
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import variable
from cutjoint.model.records import COORDINATES, GROUND, Force, JointKind, Scalar, Scene, Vector
from cutjoint.run.roads import road_pieces
from cutjoint_bench.export.chains import frame
from cutjoint_bench.export.exudyn_laws import function
from cutjoint_bench.export.forces_cpp import arm, radii_on_road
from cutjoint_bench.export.laws import Array, Numbers, Triple
from cutjoint_bench.export.records import Mechanism, PeerJoint, Place

_GLOBAL: Sequence[Vector] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
_PLACE, _SPIN = ("x", "y", "z", "vx", "vy", "vz"), ("wx", "wy", "wz")
LENGTH, RATE = variable("length"), variable("rate")


@dataclass(frozen=True)
class ForceWriter:
    """Writes the statement of one force; ``roads`` are the names of roads by the radius of the wheels on them."""

    mechanism: Mechanism
    numbers: Numbers
    roads: Mapping[float, str]

    def statement(self, force: Force) -> str | None:
        """The statement that adds a force, None for one within a body or on a coordinate that does not move freely."""
        if len(force.bodies) == 2 and len({self.place(body).of for body in force.bodies}) == 1:
            return None
        match force.interaction:
            case LineForce() as how:
                return self.spring(force, how)
            case OnCoordinate():
                return self.joint_force(force)
            case AxisForce() as how:
                base, follower = (self.arm_of(point, force) for point in (how.origin, how.point))
                law = function((how.position, "rate"), self.numbers.law(force.expressions[0]))
                call = f"sliding({base!r}, {self.direction(how.axis.body(force), how.axis.of(force))!r}, {follower!r}, {law})"
            case Compliance() as how:
                axes = how.frame.of(force)
                ends = ", ".join(f"{self.arm_of(p, force)!r}, {self.axes(p.body(force), axes)!r}" for p in (how.base, how.follower))
                laws = ", ".join(function(("position", "rate"), self.numbers.law(law)) for law in force.expressions)
                call = f"bushing({ends}, [{laws}])"
            case Wrench():
                call = self.load(force)
            case RoadContact() as how:
                call = self.wheel(force, how)
        return self.element(force.bodies, call)

    def element(self, bodies: Sequence[str], call: str) -> str | None:
        """A force element, None for one on the ground alone."""
        names = [self.place(body).of for body in bodies]
        return None if names == [GROUND] else f"mechanism.element({names!r}, {call})"

    def place(self, body: str) -> Place:
        return self.mechanism.places[body]

    def arm(self, body: str, point: Vector) -> Triple:
        place = self.place(body)
        return arm(self.mechanism, place.of, place.point(self.numbers.triple(point)))

    def arm_of(self, point: Point, force: Force) -> Triple:
        return self.arm(point.body(force), point.of(force))

    def end(self, point: Point, force: Force) -> str:
        """A rigid body and the arm of a point on it."""
        return repr((self.place(point.body(force)).of, self.arm_of(point, force)))

    def direction(self, body: str, direction: Vector) -> Triple:
        return self.place(body).direction(self.numbers.triple(direction))

    def axes(self, body: str, axes: Sequence[Vector]) -> tuple[Triple, ...]:
        return tuple(self.direction(body, axis) for axis in axes)

    def spring(self, force: Force, how: LineForce) -> str:
        """A linear law is Exudyn's own, if it does not push the wrong way; another one is a function."""
        law = self.numbers.law(force.expressions[0])
        ends = f"{self.end(how.start, force)}, {self.end(how.end, force)}"
        derivatives = [sympy.diff(law, x) for x in (LENGTH, RATE)]
        stiffness, damping = (max(0.0, evaluate(derivative, self.stretch(force, how))) for derivative in derivatives)
        arguments = f"stiffness={stiffness!r}, damping={damping!r}"
        if all(derivative.is_Number and derivative >= 0 for derivative in derivatives) and not law.has(TIME):
            return f"mechanism.spring({ends}, {arguments}, force={evaluate(law, {LENGTH: 0.0, RATE: 0.0})!r})"
        return f"mechanism.spring_law({ends}, {arguments}, law={function(('length', 'rate'), law)})"

    def stretch(self, force: Force, how: LineForce) -> dict[Scalar, float]:
        """Length and rate of a spring at the start."""
        (start, start_rate), (end, end_rate) = (self.moving(p.body(force), p.of(force)) for p in (how.start, how.end))
        way = end - start
        length = float(np.linalg.norm(way))
        return {LENGTH: length, RATE: float(way @ (end_rate - start_rate)) / length, TIME: 0.0}

    def moving(self, body: str, point: Vector) -> tuple[Array, Array]:
        """Place and velocity of a point at the start."""
        place = np.array(self.place(body).point(self.numbers.triple(point)))
        rigid = next((b for b in self.mechanism.bodies if b.name == self.place(body).of), None)
        return place, np.zeros(3) if rigid is None else np.array(rigid.velocity) + np.cross(rigid.spin, place - np.array(rigid.centre))

    def load(self, load: Any) -> str:
        laws = [self.numbers.law(component) for component in load.components]
        axes = self.axes(load.body, _GLOBAL) if load.has_frame else None
        if load.point is None:
            return f"torque({axes!r}, {function(_SPIN, *laws)})"
        return f"load({self.arm(load.body, load.point)!r}, {axes!r}, {function(_PLACE, *laws)})"

    def wheel(self, tyre: Any, how: RoadContact) -> str:
        constants = {name: self.numbers.number(value) for name, value in tyre.constants.items()}
        arguments = ", ".join(f"{name}={value!r}" for name, value in sorted(constants.items()))
        centre, axis = self.arm_of(how.centre, tyre), self.direction(how.axis.body(tyre), how.axis.of(tyre))
        return f"wheel({centre!r}, {axis!r}, Tyre({arguments}), {self.roads[constants['radius']]})"

    def joint_force(self, force: Force) -> str | None:
        """A force or a torque between the bodies of a joint; on a guided or welded joint it moves nothing."""
        joint = next((j for j in self.mechanism.tree if j.name == force.joint_of and not j.guide), None)
        if joint is None:
            return None
        i = COORDINATES[joint.kind].index(force.coordinate_of)
        law, start = function(("position", "rate"), self.numbers.law(force.expressions[0])), joint.coordinates[i]
        if joint.element.units[force.coordinate_of] == "rad":
            axis, side, of_base = _turning(joint, i)
            call = f"turning({axis!r}, {side!r}, {law}, {start!r}, of_base={of_base!r})"
        else:
            axis = _slide_axis(joint, i)
            origin, point = (arm(self.mechanism, *end) for end in ((joint.base, joint.base_point), (joint.follower, joint.follower_point)))
            before = start - float(np.dot(axis, np.array(joint.follower_point) - np.array(joint.base_point)))
            call = f"sliding({origin!r}, {axis!r}, {point!r}, {law}, {before!r})"
        return f"mechanism.element({[joint.base, joint.follower]!r}, {call})"


def _turning(joint: PeerJoint, coordinate: int) -> tuple[Triple, Triple, bool]:
    """The axis of an angle, a direction across it, and whether the base carries the axis."""
    if joint.kind is JointKind.UNIVERSAL:
        axes = joint.base_axes[0], joint.follower_axes[1]
        return axes[coordinate], axes[1 - coordinate], coordinate == 0
    return joint.base_axes[0], frame(np.array(joint.base_axes[0]))[0], True


def _slide_axis(joint: PeerJoint, coordinate: int) -> Triple:
    direction = joint.element.slide_direction(joint.element.coordinates[coordinate])
    return joint.base_axes[AXIAL_FRAME.index(direction)]


def road_statements(mechanism: Mechanism, numbers: Numbers, scene: Scene) -> dict[float, tuple[str, str]]:
    """The name and the expression of each road, by the radius of the wheels on it."""
    radii = enumerate(radii_on_road(mechanism, numbers))
    return {radius: (f"ROAD_{i}", _road(scene, radius)) for i, radius in radii}


def _road(scene: Scene, radius: float) -> str:
    return f"Road({', '.join(_tracks(scene, radius))}, disc={scene.road.contact == 'disc'!r})"


def _tracks(scene: Scene, radius: float) -> Iterator[str]:
    for side, pieces in road_pieces(scene.road, radius).items():
        listed = (f"Piece({p.kind!r}, {float(p.start)!r}, {float(p.a)!r}, {float(p.b)!r}, {float(p.c)!r})" for p in pieces)
        yield f"{side}=[{', '.join(listed)}]"
