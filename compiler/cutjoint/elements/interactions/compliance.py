"""Six laws between two bodies, along the axes of a frame and about them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import (
    Arrow,
    Explanation,
    Frame,
    Interaction,
    Mechanics,
    Page,
    Point,
    Ring,
    Visual,
    VisualContext,
    gets,
    on_both,
    pair,
)

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
        """Three laws push the follower along the axes, three work on the rotations about them."""
        b, place, rotation = m.b, m.along(self.base, self.follower, self.frame), m.rotation(self.frame)
        places, rates, by_rotation = (place.x, rotation.x), (place.v, rotation.v), rotation.by_rotation
        laws = [
            m.scalar(law, {"position": b.element(places[i // 3], i % 3), "rate": b.element(rates[i // 3], i % 3)})
            for i, law in enumerate(force.expressions)
        ]
        applied, torque = b.column(laws[:3]), b.column(laws[3:])
        columns = {"F": applied, "M": b.mul(b.transpose(by_rotation), torque), "d": places[0], "r": places[1]}
        quantities = {f"{name}{axis}": b.element(block, i) for name, block in columns.items() for i, axis in enumerate("xyz")}
        m.apply_force_along(self.base, self.follower, self.frame, applied)
        m.apply_frame_torque(self.frame, torque)
        return quantities

    def values(self, force: Force, m: Mechanics) -> dict[str, Block]:
        """The displacements and the rotations."""
        columns = {"d": m.along(self.base, self.follower, self.frame).x, "r": m.rotation(self.frame).x}
        return {f"{name}{axis}": m.b.element(block, i) for name, block in columns.items() for i, axis in enumerate("xyz")}

    def explain(self, force: Force, page: Page) -> Explanation:
        """Displacements, rotations and their laws."""
        carried = "$E$ holds the axes $e_k$ carried by the base, $G$ the axes $g_k$ carried by the follower; "
        meaning = page.either(
            r"$d$ are the displacements along and $\theta$ the small rotations about the former, both velocities are of the bodies at the "
            "follower's point $p$.",
            r"$w$ leads from the base's point to the follower's, $d$ are the displacements along and $\theta$ the small rotations about "
            "the axes $e_k$.",
        )
        actions = page.either(
            (
                r"S = E^T G, \quad d = E^T (p - p_b), \quad \theta = E^T \sum\nolimits_{k} e_k \times g_k / 2, \quad"
                r" T = (\text{tr} S \cdot \mathbf{1} - S) / 2",
                r"\dot d = E^T (v_f - v_b), \quad \dot \theta = T E^T (\omega_f - \omega_b)",
                on_both("+", "E F", r"p \times E F + E T^T M"),
            ), (
                r"w = p_f - p_b, \quad d = E^T w, \quad S = E^T G, \quad \tilde \theta = (S - S^T) / 2",
                pair("p_f", "p_b", "+", "E F"),
                r", \quad ".join((gets("E", "+", r"w F^T - G \tilde M / 2"), gets("G", "+", r"E \tilde M / 2"))),
            ),
        )  # fmt: skip
        along, about = force.expressions[:3], force.expressions[3:]
        return Explanation(
            notes=(carried + meaning,), actions=actions, laws=(*page.laws("F", along, "d"), *page.laws("M", about, r"\theta"))
        )

    def visuals(self) -> tuple[Visual, ...]:
        """A ring."""
        return (Ring(self.base, self.frame),)

    def arrow(self, force: Force, context: VisualContext) -> Arrow:
        """The force on the follower."""
        return context.components(self.follower, self.frame)
