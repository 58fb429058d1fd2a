"""A force along the line between two points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from cutjoint.elements.interaction import Arrow, Coil, Interaction, Mechanics, Point, Visual, VisualContext

if TYPE_CHECKING:
    from cutjoint.elements.force import LawForce
    from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class LineForce(Interaction):
    """A tension, a law over ``length`` (m) of the displacement from start to end and its ``rate`` (m/s)."""

    start: Point
    end: Point
    position: ClassVar[str] = "length"
    can_be_guarded: ClassVar[bool] = True
    equation: ClassVar[str] = "n = (p_end - p_start)/length,  follower gets -law(length, rate) n"
    equation_of_points: ClassVar[str] = "n = (p_end - p_start)/length,  Q = -law(length, rate) n on the way between the points"

    def act(self, force: LawForce, m: Mechanics) -> dict[str, Block]:
        """The tension pulls both points together."""
        n, values = self._stretch(m)
        law = m.law(force.law, values, self.position)
        m.apply_force_pair(self.start, self.end, m.b.neg(m.b.scale(law["force"], n)))
        return {**law, **values}

    def values(self, force: LawForce, m: Mechanics) -> dict[str, Block]:
        """The length of the displacement, and its rate."""
        return self._stretch(m)[1]

    def _stretch(self, m: Mechanics) -> tuple[Block, dict[str, Block]]:
        b, displacement = m.b, m.displacement(self.start, self.end)
        length = b.call("sqrt", b.dot(displacement.x, displacement.x))
        n = b.letter(b.scale(b.call("div", b.number(1.0), length), displacement.x), "n")
        return n, {"length": length, "rate": b.dot(n, displacement.v)}

    def swapped(self, force: LawForce) -> Mapping[str, Any]:
        return {self.start.field: self.end.of(force), self.end.field: self.start.of(force)}

    def visuals(self) -> tuple[Visual, ...]:
        return (Coil(self.start, self.end),)

    def arrow(self, force: LawForce, context: VisualContext) -> Arrow:
        return context.apply_force_pair(self.start, self.end, "force")
