"""Six laws between two bodies, along the axes of a frame and about them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import Arrow, Frame, Interaction, Mechanics, Point, Ring, Visual, VisualContext

if TYPE_CHECKING:
    from cutjoint.elements.force import Force
    from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class Compliance(Interaction):
    """Six laws over the small displacements along and rotations about ``frame`` between a point of two bodies."""

    base: Point
    follower: Point
    frame: Frame
    needs_attitude: ClassVar[bool] = True
    equation: ClassVar[str] = (
        "x = E^T (p_f - p_b),  theta = half the sum of e_k x g_k in E;  follower gets E law(x), E (d theta/d turn)^T law(theta)"
    )
    equation_of_points: ClassVar[str] = "x = E^T (p_f - p_b),  theta = half the sum of e_k x g_k in E,  Q = law d(x, theta)/d q"

    def act(self, force: Force, m: Mechanics) -> dict[str, Block]:
        """Three laws give forces on the follower along the axes, three give torques on the rotations about them."""
        b, place, rotation = m.b, m.along(self.base, self.follower, self.frame), m.rotation(self.frame)
        places, rates, by_rotation = (place.x, rotation.x), (place.v, rotation.v), rotation.by_rotation
        laws = [
            m.scalar(law, {"position": b.element(places[i // 3], i % 3), "rate": b.element(rates[i // 3], i % 3)})
            for i, law in enumerate(force.expressions)
        ]
        applied, torque = b.letter(b.column(laws[:3]), "F"), b.letter(b.column(laws[3:]), "M")
        columns = {"F": applied, "M": b.mul(b.transpose(by_rotation), torque), "d": places[0], "r": places[1]}
        quantities = {f"{name}{axis}": b.element(block, i) for name, block in columns.items() for i, axis in enumerate("xyz")}
        m.apply_force_along(self.base, self.follower, self.frame, applied)
        m.apply_frame_torque(self.frame, torque)
        return quantities

    def values(self, force: Force, m: Mechanics) -> dict[str, Block]:
        """The displacements and the rotations."""
        columns = {"d": m.along(self.base, self.follower, self.frame).x, "r": m.rotation(self.frame).x}
        return {f"{name}{axis}": m.b.element(block, i) for name, block in columns.items() for i, axis in enumerate("xyz")}

    def visuals(self) -> tuple[Visual, ...]:
        return (Ring(self.base, self.frame),)

    def arrow(self, force: Force, context: VisualContext) -> Arrow:
        return context.components(self.follower, self.frame)
