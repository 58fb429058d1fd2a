"""Two interactions of the tests alone, each with a force kind, which importing this registers: before models are read.

A beam force is over the bend of three points, a pointer force over the angle between two directions.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self, cast

from cutjoint.elements.force import Force, ForceElement, ForceField, Law, LawForce, Reader, Shape
from cutjoint.elements.forces import FORCES
from cutjoint.elements.interaction import Arrow, Axis, Carrier, Coil, Interaction, Mechanics, Point, Visual, VisualContext
from cutjoint.elements.terms import Scalar, Vector

if TYPE_CHECKING:
    from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class Bend(Interaction):
    """A law over each component of the bend p_1 + p_3 - 2 p_2 and its rate: -F on p_1 and p_3, 2 F on p_2."""

    first: Point
    middle: Point
    last: Point
    equation: ClassVar[str] = "F = law(p_1 + p_3 - 2 p_2)"

    def act(self, force: LawForce, m: Mechanics) -> dict[str, Block]:
        """Three forces that are in balance."""
        b, ways = m.b, [m.displacement(self.middle, end) for end in (self.first, self.last)]
        bend, rate = b.add(ways[0].x, ways[1].x), b.add(ways[0].v, ways[1].v)
        F = b.column([m.scalar(force.law, {"position": b.element(bend, i), "rate": b.element(rate, i)}) for i in range(3)])
        for at, push in ((self.first, b.neg(F)), (self.last, b.neg(F)), (self.middle, b.add(F, F))):
            m.apply_force(at, push)
        return {f"F{axis}": b.neg(b.element(m.in_global(F), i)) for i, axis in enumerate("xyz")}

    def visuals(self) -> tuple[Visual, ...]:
        """Two springs."""
        return (Coil(self.middle, self.first), Coil(self.middle, self.last))

    def arrow(self, force: LawForce, context: VisualContext) -> Arrow:
        """The force on the last point."""
        return context.components(self.last, None)


@dataclass(frozen=True, kw_only=True)
class Pointer(Interaction):
    """A torque that turns two directions towards each other, less a share of the relative angular velocity."""

    base: Axis
    follower: Axis
    needs_attitude: ClassVar[bool] = True
    equation: ClassVar[str] = "T = k g x e - c (w_f - w_b)"

    def act(self, force: PointerForce, m: Mechanics) -> dict[str, Block]:
        """Opposite torques."""
        b, e, g = m.b, m.direction(self.base).x, m.direction(self.follower).x
        spin = b.sub(m.spin(self.follower.carrier), m.spin(self.base.carrier))
        T = b.sub(b.scale(m.scalar(force.stiffness, {}), b.cross(g, e)), b.scale(m.scalar(force.damping, {}), spin))
        m.apply_torque(self.follower.carrier, T)
        m.apply_torque(self.base.carrier, b.neg(T))
        return {f"M{axis}": b.element(m.in_global(T), i) for i, axis in enumerate("xyz")}


_LAW = Law({"position": "m", "rate": "m/s"}, "N")


@dataclass(frozen=True, kw_only=True)
class BeamForce(LawForce):
    """A law over the bend of three points."""

    element: ClassVar[ForceElement] = ForceElement(
        kind="beam", text="a force over the bend of three points",
        fields=(
            ForceField("bodies", Shape.BODIES), ForceField("body", Shape.BODY), ForceField("from", Shape.POINT),
            ForceField("at", Shape.POINT), ForceField("to", Shape.POINT), ForceField("law", Shape.LAW),
        ),
        interaction=Bend(first=Point(Carrier.BASE, "start"), middle=Point(Carrier.BODY, "at"), last=Point(Carrier.FOLLOWER, "end")),
        laws=("law",), forms=(_LAW,), quantities=dict.fromkeys(("Fx", "Fy", "Fz"), "N"),
    )  # fmt: skip

    base: str
    follower: str
    body: str
    start: Vector
    at: Vector
    end: Vector

    @classmethod
    def read(cls, reader: Reader) -> Self:
        """The record of what a reader reads."""
        return cls(
            **reader.common(), body=reader.body("body"), start=reader.point("from"), at=reader.point("at"),
            end=reader.point("to"), law=reader.law("law", law=_LAW),
        )  # fmt: skip

    @property
    def quantities(self) -> dict[str, str]:
        """The force on the last point."""
        return dict(self.element.quantities)


@dataclass(frozen=True, kw_only=True)
class PointerForce(Force):
    """A torque between two directions."""

    element: ClassVar[ForceElement] = ForceElement(
        kind="pointer", text="a torque between two directions",
        fields=(
            ForceField("bodies", Shape.BODIES), ForceField("axis", Shape.DIRECTION), ForceField("towards", Shape.DIRECTION),
            ForceField("stiffness", Shape.NUMBER, unit="N*m"), ForceField("damping", Shape.NUMBER, unit="N*m*s"),
        ),
        interaction=Pointer(base=Axis(Carrier.BASE, "towards"), follower=Axis(Carrier.FOLLOWER, "axis")),
        laws=("stiffness", "damping"), quantities=dict.fromkeys(("Mx", "My", "Mz"), "N*m"),
    )  # fmt: skip

    base: str
    follower: str
    axis: Vector
    towards: Vector
    stiffness: Scalar
    damping: Scalar

    @classmethod
    def read(cls, reader: Reader) -> Self:
        """The record of what a reader reads."""
        return cls(
            **reader.common(), axis=reader.direction("axis"), towards=reader.direction("towards"),
            stiffness=reader.number("stiffness", unit="N*m"), damping=reader.number("damping", unit="N*m*s"),
        )  # fmt: skip


cast("MutableMapping[str, type[Force]]", FORCES).update({"beam": BeamForce, "pointer": PointerForce})
