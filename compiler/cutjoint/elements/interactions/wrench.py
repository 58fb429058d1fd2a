"""A force or a torque on one body by its components."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import Arrow, Interaction, Mechanics, Point, VisualContext

if TYPE_CHECKING:
    from cutjoint.elements.forces.body_load import BodyLoad
    from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class Wrench(Interaction):
    """Three components of a force at ``point`` over its place and velocity, or of a torque over the body's angular velocity."""

    point: Point
    holds_bodies: ClassVar[bool] = False
    can_be_guarded: ClassVar[bool] = True
    equation: ClassVar[str] = "the force given by its components at its point"
    equation_of_points: ClassVar[str] = (
        "the force given by its components at its point, a torque as half the sum of T x e_i on the directions"
    )

    def act(self, force: BodyLoad, m: Mechanics) -> dict[str, Block]:
        """The components act at the point, or on the body."""
        b, values = m.b, self.values(force, m)
        components = b.column([m.scalar(c, values) for c in force.components])
        if force.moving_only:
            components = m.in_motion(components)
        vector = m.from_body(self.point.carrier, components) if force.has_frame else m.from_global(components)
        if force.point is None:
            m.apply_torque(self.point.carrier, vector)
        else:
            m.apply_force(self.point, vector)
        return {name: b.element(components, i) for i, name in enumerate(force.quantities)}

    def values(self, force: BodyLoad, m: Mechanics) -> dict[str, Block]:
        """Place and velocity of the point, or the body's angular velocity."""
        if force.point is None:
            vectors = {"w": m.spin(self.point.carrier)}
        else:
            at = m.point(self.point)
            vectors = {"": at.x, "v": at.v}
        for name in [name for name in vectors if name]:
            vectors[name] = m.in_body(self.point.carrier, vectors[name]) if force.has_frame else m.in_global(vectors[name])
        return {f"{name}{axis}": m.b.element(vector, i) for name, vector in vectors.items() for i, axis in enumerate("xyz")}

    def arrow(self, force: BodyLoad, context: VisualContext) -> Arrow:
        return None if force.point is None else context.components(self.point, self.point.carrier if force.has_frame else None)
