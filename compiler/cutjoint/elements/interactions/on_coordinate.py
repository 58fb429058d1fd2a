"""A force on the coordinate of a joint, by a law over the coordinate or by the load of the joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import Interaction, Mechanics

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
        """The law gives a force on the coordinate, which its joint reports."""
        law = m.law(force.law, m.coordinate(), self.position)
        m.apply_joint_force(law["force"])
        return law

    def values(self, force: LawForce, m: Mechanics) -> dict[str, Block]:
        """The coordinate, and its rate."""
        return m.coordinate()


@dataclass(frozen=True)
class CoordinateFriction(Interaction):
    """A law over the ``rate`` of a joint's coordinate and a bristle, times a constant load or the joint's load by all forces."""

    by_load: ClassVar[bool] = True
    equation: ClassVar[str] = "tau = load law(rate, s) of one coordinate, with the share s of the bristle's deflection"

    def act(self, force: JointFriction, m: Mechanics) -> dict[str, Block]:
        """The law is applied when the joint's load is known."""
        law = m.scalar(force.law, {"rate": m.coordinate()["rate"]})
        if force.carried:
            m.apply_joint_friction(law)
            return {}
        load = m.scalar(force.preload, {})
        found = {"force": m.b.mul(load, law), "load": load}
        m.apply_joint_force(found["force"])
        return found
