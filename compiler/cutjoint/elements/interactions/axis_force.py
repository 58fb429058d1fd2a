"""A force along a body-fixed axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import Arrow, Axis, Coil, Interaction, Mechanics, Point, Visual, VisualContext

if TYPE_CHECKING:
    from cutjoint.elements.force import LawForce
    from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class AxisForce(Interaction):
    """A force on ``point`` along ``axis``, a law over ``travel`` (m) of the point from ``origin`` along the axis and its ``rate`` (m/s).
    The reaction acts on the same line."""

    origin: Point
    axis: Axis
    point: Point
    position: ClassVar[str] = "travel"
    can_be_guarded: ClassVar[bool] = True
    equation: ClassVar[str] = "travel = e . (p - p_origin),  follower gets law(travel, rate) e"
    equation_of_points: ClassVar[str] = "travel = e . (p - p_origin),  Q = law(travel, rate) d travel/d q"

    def act(self, force: LawForce, m: Mechanics) -> dict[str, Block]:
        """The law pushes the point along the axis."""
        values = self.values(force, m)
        law = m.law(force.law, values, self.position)
        m.apply_force_along(self.origin, self.point, self.axis, law["force"])
        return {**law, **values}

    def values(self, force: LawForce, m: Mechanics) -> dict[str, Block]:
        """The travel, and its rate."""
        travel = m.along(self.origin, self.point, self.axis)
        return {"travel": travel.x, "rate": travel.v}

    def visuals(self) -> tuple[Visual, ...]:
        """A spring along the line of the force, as long as its travel."""
        return (Coil(self.origin, self.point, self.axis),)

    def arrow(self, force: LawForce, context: VisualContext) -> Arrow:
        return context.apply_force_along(self.point, self.axis, "force")
