"""Reported quantities in natural coordinates: motion of bodies and markers, joint coordinates, forces, reactions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.formulate.attitude import ATTITUDE, attitude
from cutjoint.formulate.inputs import guide_rates
from cutjoint.formulate.natural.constraints import Constraint, multipliers
from cutjoint.formulate.natural.forces import Element
from cutjoint.formulate.natural.motion import Motion, NodeMotions
from cutjoint.formulate.natural.nodes import Form, difference
from cutjoint.formulate.natural.reactions import ReactionMaker
from cutjoint.kernels.directions import slide_axis
from cutjoint.model.geometry import GLOBAL_AXES
from cutjoint.model.quantities import reaction_component
from cutjoint.model.records import Joint, Model, Output, Reaction, RodForce, Vector
from cutjoint.program.blocks import BindingTime, Block


@dataclass(frozen=True, kw_only=True)
class NaturalReporter:
    """Knows every quantity of a system in natural coordinates."""

    model: Model
    motions: NodeMotions
    elements: Mapping[str, Element]
    constraints: tuple[Constraint, ...]

    def quantity(self, output: Output) -> Block:
        """The block of one output; zero for a force that the scene has switched off or that a guard stands for.

        Raises:
            ModelError: a reaction that points and vectors alone do not determine.
        """
        name = output.element
        for body in self.model.bodies:
            if body.name == name:
                return self._motion(name, body.centre_of_mass, output.quantity)
        for marker in self.model.markers:
            if marker.name == name:
                return self._motion(marker.body, marker.point, output.quantity)
        for reaction in self.model.reactions:
            if reaction.name == name:
                return self._rods(reaction) if isinstance(reaction, RodForce) else self._reaction(reaction, output.quantity)
        if any(force.name == name for force in self.model.force_elements):
            quantities = self.elements[name].quantities if name in self.elements else {}
            return quantities.get(output.quantity, self.motions.builder.zero(1))
        if any(gear.name == name for gear in self.model.gears):
            return self.motions.builder.neg(multipliers(self.motions.builder, next(c for c in self.constraints if c.element == name)))
        return self._joint(next(j for j in self.model.joints if j.name == name), output.quantity)

    def _axes(self, body: str) -> tuple[Form, Form, Form]:
        x, y, z = (self.motions.layout.direction(body, axis) for axis in GLOBAL_AXES)
        return x, y, z

    def _rotation(self, body: str) -> Block:
        return self.motions.builder.stack([[self.motions.of(axis).x for axis in self._axes(body)]])

    def _motion(self, body: str, point: Vector, quantity: str) -> Block:
        b = self.motions.builder
        if quantity in ATTITUDE:
            return attitude(b, self._rotation(body), quantity)
        axis, kind = "xyz".index(quantity[-1]), quantity[:-1]
        if kind == "w":
            return b.element(self.motions.spin(body, self._axes(body)), axis)
        motion = self.motions.point(body, point)
        return b.element({"": motion.x, "v": motion.v, "a": motion.a}[kind], axis)

    def _reaction(self, reaction: Reaction, quantity: str) -> Block:
        maker = ReactionMaker(motions=self.motions, model=self.model, constraints=self.constraints, elements=self.elements)
        pull, (_, direction) = maker.pull(reaction, quantity), reaction_component(reaction, quantity)
        return self.motions.builder.dot(self.motions.direction(reaction.body, direction).x, pull)

    def _rods(self, sensor: RodForce) -> Block:
        """The residual of a distance is in m: its multiplier pulls."""
        b, of = self.motions.builder, {c.element: c for c in self.constraints}
        pulls = [b.scale(self.motions.translator.scalar(weight), multipliers(b, of[rod])) for rod, weight in sensor.pushes]
        return b.neg(b.total(pulls))

    def _joint(self, joint: Joint, quantity: str) -> Block:
        """A joint's coordinate or speed."""
        if quantity in ("wx", "wy", "wz"):
            return self._relative_spin(joint, "xyz".index(quantity[-1]))
        is_rate = quantity not in joint.element.coordinates
        names = joint.element.speeds if is_rate else joint.element.coordinates
        coordinate = joint.element.coordinates[names.index(quantity)]
        if joint.guide is not None:
            return self._guided(joint, coordinate, is_rate)
        if (joint.name, coordinate) in self.motions.layout.angles:
            motion = self.motions.node(self.motions.layout.angles[joint.name, coordinate])
        else:
            motion = self._slide(joint, coordinate)
        return motion.v if is_rate else motion.x

    def _guided(self, joint: Joint, coordinate: str, is_rate: bool) -> Block:
        assert joint.guide is not None
        guide = joint.guide[joint.element.coordinates.index(coordinate)]
        place, rate, _ = (self.motions.translator.scalar(e) for e in guide_rates(guide, self.model))
        return self.motions.builder.mul(self.motions.builder.symbol("motion", 1, BindingTime.STEP), rate) if is_rate else place

    def _slide(self, joint: Joint, coordinate: str) -> Motion:
        b, layout = self.motions.builder, self.motions.layout
        base, follower = layout.slide_ends(joint)
        way = self.motions.of(difference(layout.point(follower, joint.at), layout.point(base, joint.at)))
        axis = self.motions.direction(base, slide_axis(joint, coordinate))
        rate = b.add(b.dot(way.x, axis.v), b.dot(way.v, axis.x))
        return Motion(x=b.dot(way.x, axis.x), v=rate, a=b.zero(1))

    def _relative_spin(self, joint: Joint, axis: int) -> Block:
        """An element of the outer body's angular velocity against the inner one, in the latter's axes."""
        b, (inner, outer) = self.motions.builder, self.motions.layout.outwards[joint.name]
        spin = b.sub(self.motions.spin(outer, self._axes(outer)), self.motions.spin(inner, self._axes(inner)))
        return b.dot(self.motions.direction(inner, GLOBAL_AXES[axis]).x, spin)
