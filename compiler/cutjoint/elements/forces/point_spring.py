"""A spring, damper or actuator between two points."""

from dataclasses import dataclass
from typing import ClassVar, Self

from cutjoint.elements.force import ForceElement, ForceField, Law, LawForce, Reader, Shape
from cutjoint.elements.interaction import Carrier, Point
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.elements.terms import Vector

_LAW = Law({"length": "m", "rate": "m/s"}, "N")


@dataclass(frozen=True, kw_only=True)
class PointSpring(LawForce):
    """Force along the line from ``start`` on ``base`` to ``end`` on ``follower``.
    ``law`` is the tension in N over the symbols ``length`` (m) and ``rate`` (m/s), ``t`` and parameters."""

    element: ClassVar[ForceElement] = ForceElement(
        kind="point_spring",
        text="A force between two points, along the line through them.",
        fields=(
            ForceField("bodies", Shape.BODIES), ForceField("from", Shape.POINT, words=" of the base"),
            ForceField("to", Shape.POINT, words=" of the follower"), ForceField("law", Shape.LAW, words=" (a tension)"),
        ),
        interaction=LineForce(start=Point(Carrier.BASE, "start"), end=Point(Carrier.FOLLOWER, "end")),
        laws=("law",), forms=(_LAW,),
    )  # fmt: skip

    base: str
    follower: str
    start: Vector
    end: Vector

    @classmethod
    def read(cls, reader: Reader) -> Self:
        start, end = reader.point("from"), reader.point("to")
        reader.distinct(start, end, names=("from", "to"), hint="the line between them gives the direction")
        law = reader.law("law", law=_LAW, drawn=reader.distance(start, end))
        return cls(**reader.common(), start=start, end=end, law=law)
