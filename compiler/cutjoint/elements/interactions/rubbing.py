"""Friction on the coordinate of a joint by the load of the joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import Explanation, Interaction, Mechanics, Page

if TYPE_CHECKING:
    from cutjoint.elements.forces.joint_friction import JointFriction
    from cutjoint.program.blocks import Block


@dataclass(frozen=True)
class Rubbing(Interaction):
    """A law over the ``rate`` of a joint's coordinate and a bristle, times a load that stays, or that of the joint by all forces."""

    by_load: ClassVar[bool] = True
    equation: ClassVar[str] = "tau = load law(rate, s) of one coordinate, with the share s of the bristle's deflection"

    def act(self, force: JointFriction, m: Mechanics) -> dict[str, Block]:
        """The law waits for a load that the joint carries."""
        law = m.scalar(force.law, {"rate": m.coordinate()["rate"]})
        if force.carried:
            m.rub_coordinate(law)
            return {}
        load = m.scalar(force.preload, {})
        found = {"force": m.b.mul(load, law), "load": load}
        m.push_coordinate(found["force"])
        return found

    def explain(self, force: JointFriction, page: Page) -> Explanation:
        """The force by the load."""
        carried = " and what the joint carries across its axis; it follows from the accelerations at the same instant, and they from it"
        note = (
            f"The load $N$ is the preload{carried if force.carried else ''}. $s$ is the bristle's share of the deflection at which it "
            "slides, a state; $F$ is the generalised force of the coordinate $z$."
        )
        return Explanation(notes=(note,), actions=(r"F = N f(\dot z, s)",), laws=page.law("f", force.law, "rate", r"\dot z"))
