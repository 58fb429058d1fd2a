"""A force on the coordinate of a joint, by a law over the coordinate or by the load of the joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import Explanation, Interaction, Mechanics, Page, gets

if TYPE_CHECKING:
    from cutjoint.elements.force import LawForce
    from cutjoint.elements.forces.joint_friction import JointFriction
    from cutjoint.program.blocks import Block


@dataclass(frozen=True)
class OnCoordinate(Interaction):
    """A law over ``position`` and ``rate`` of a joint's coordinate, on which it works."""

    position: ClassVar[str] = "position"
    can_be_guarded: ClassVar[bool] = True
    equation: ClassVar[str] = "tau = law(position, rate) of one coordinate"
    equation_of_points: ClassVar[str] = "Q = law(position, rate) of one coordinate"

    def act(self, force: LawForce, m: Mechanics) -> dict[str, Block]:
        """The law works on the coordinate, which its joint reports."""
        law = m.law(force.law, m.coordinate(), self.position)
        m.apply_joint_force(law["force"])
        return law

    def values(self, force: LawForce, m: Mechanics) -> dict[str, Block]:
        """The coordinate, and its rate."""
        return m.coordinate()

    def explain(self, force: LawForce, page: Page) -> Explanation:
        """A force on the coordinate, or on the displacements that it is measured by."""
        notes, actions = map(page.either, _ON_BODIES, _on_points(page.kind_of_coordinate(force), page))
        return Explanation(notes=notes, actions=actions, laws=page.law("F", force.law, self.position, "z"))


@dataclass(frozen=True)
class Rubbing(Interaction):
    """A law over the ``rate`` of a joint's coordinate and a bristle, times a load that stays, or that of the joint by all forces."""

    by_load: ClassVar[bool] = True
    equation: ClassVar[str] = "tau = load law(rate, s) of one coordinate, with the share s of the bristle's deflection"

    def act(self, force: JointFriction, m: Mechanics) -> dict[str, Block]:
        """The law waits for a load that the joint carries."""
        law = m.scalar(force.law, {"rate": m.coordinate()["rate"]})
        if force.carried:
            m.apply_joint_friction(law)
            return {}
        load = m.scalar(force.preload, {})
        found = {"force": m.b.mul(load, law), "load": load}
        m.apply_joint_force(found["force"])
        return found

    def explain(self, force: JointFriction, page: Page) -> Explanation:
        """The force by the load."""
        carried = " and what the joint carries across its axis; it follows from the accelerations at the same instant, and they from it"
        note = (
            f"The load $N$ is the preload{carried if force.carried else ''}. $s$ is the bristle's share of the deflection at which it "
            "slides, a state; $F$ is the generalised force of the coordinate $z$."
        )
        return Explanation(notes=(note,), actions=(r"F = N f(\dot z, s)",), laws=page.law("f", force.law, "rate", r"\dot z"))


_ON_BODIES: tuple[tuple[str, ...], tuple[str, ...]] = (
    (
        "$F$ joins the generalised force of the coordinate $z$ where the joint is eliminated; a guided joint follows its "
        "guide. Where the joint is cut, $z$ is measured, and $F$ acts along its direction, or about its axis, on both bodies.",
    ),
    (r"D e = b^T (Q_i - M_i d) + F",),
)  # fmt: skip


def _on_points(kind: str, page: Page) -> tuple[tuple[str, ...], tuple[str, ...]]:
    if kind == "guided":
        return ("A guided joint follows its guide; $F$ is reported and does nothing.",), ()
    if kind == "angle":
        return ("The angle $z$ is a coordinate of its own, on which $F$ works.",), (gets("z", "+", "F"),)
    note = (
        "$F$ works on the displacement $z$ of the joint's point $p_f$ of the follower (of a free joint the outer body) from the "
        "base's point $p_b$, along the direction $a$ of the base."
    )
    travel = r"d = p_f - p_b, \quad z = a \cdot d, \quad \dot z = a \cdot \dot d + d \cdot \dot a"
    return (note,), (travel, page.apply_force_along("p_b", "p_f", "a", "d", "F"))
