"""A force on a joint's coordinate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from cutjoint.elements.force import ForceElement, ForceField, Law, LawForce, Mirror, OnJoint, Reader, Shape
from cutjoint.elements.interactions import OnCoordinate

_SLIDE = Law({"position": "m", "rate": "m/s"}, "N")
_TURN = Law({"position": "rad", "rate": "rad/s"}, "N*m")


def law_on(unit: str) -> Law:
    """The variables and units of a law on a coordinate in a unit: on angles it gives torques, and on one that is wrong."""
    return _SLIDE if unit == "m" else _TURN


@dataclass(frozen=True, kw_only=True)
class JointForce(OnJoint, LawForce):
    """A generalised force on one scalar coordinate of a joint, named as in the joint's kind, in ``unit`` "m" or "rad".

    ``law`` is in N (N m on an angle) over ``position``, ``rate`` of the coordinate, ``t`` and parameters.
    """

    element: ClassVar[ForceElement] = ForceElement(
        kind="joint_force",
        text="A force on one of a joint's coordinates, on its only one if none is named.",
        fields=(ForceField("joint", Shape.JOINT), ForceField("coordinate", Shape.COORDINATE, None), ForceField("law", Shape.LAW)),
        interaction=OnCoordinate(),
        laws=("law",),
        forms=(_SLIDE, _TURN),
    )

    @classmethod
    def read(cls, reader: Reader) -> Self:
        """The record of what a reader reads."""
        joint, coordinate, unit = reader.coordinate("joint", "coordinate")
        return cls(**reader.common(), joint=joint, coordinate=coordinate, unit=unit, law=reader.law("law", law=law_on(unit)))

    @property
    def variables(self) -> Law:
        """The variables and units of the law."""
        return law_on(self.unit)

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the force: its law counts the other way where its coordinate does."""
        return replace(self, law=mirror.reflected(self.law, signs.get(self.joint, {}).get(self.coordinate, 1)))
