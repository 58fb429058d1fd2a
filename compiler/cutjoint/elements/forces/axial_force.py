"""A force along an axis of a body."""

from dataclasses import dataclass
from typing import ClassVar, Self

from cutjoint.elements.force import ForceElement, ForceField, Law, LawForce, Reader, Shape
from cutjoint.elements.interaction import Axis, Carrier, Point
from cutjoint.elements.interactions.axis_force import AxisForce
from cutjoint.elements.terms import Vector

_LAW = Law({"travel": "m", "rate": "m/s"}, "N")


@dataclass(frozen=True, kw_only=True)
class AxialForce(LawForce):
    """Force along ``axis``, fixed in ``base``, applied to ``point`` of ``follower`` in the axis' direction.
    ``law`` is this force in N over ``travel`` (m), the component along the axis of the vector from ``origin`` on ``base`` to ``point``,
    its ``rate`` (m/s), ``t`` and parameters. The reaction acts on ``base`` on the same line."""

    element: ClassVar[ForceElement] = ForceElement(
        kind="axial_force",
        text="A force along an axis of the base.",
        fields=(
            ForceField("bodies", Shape.BODIES), ForceField("origin", Shape.POINT, words=" of the base"),
            ForceField("point", Shape.POINT, words=" of the follower"), ForceField("axis", Shape.DIRECTION, words=" of the base"),
            ForceField("law", Shape.LAW, words=" (the push on the point along the axis)"),
        ),
        interaction=AxisForce(
            origin=Point(Carrier.BASE, "origin"), axis=Axis(Carrier.BASE, "axis"), point=Point(Carrier.FOLLOWER, "point")
        ),
        laws=("law",), forms=(_LAW,),
    )  # fmt: skip

    base: str
    follower: str
    origin: Vector
    point: Vector
    axis: Vector

    @classmethod
    def read(cls, reader: Reader) -> Self:
        return cls(
            **reader.common(), origin=reader.point("origin"), point=reader.point("point"),
            axis=reader.direction("axis"), law=reader.law("law", law=_LAW),
        )  # fmt: skip
