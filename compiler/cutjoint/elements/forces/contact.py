"""A ball or a point of a body on a plane or a cylinder of another body, with a force by expressions."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from cutjoint.elements.force import Force, ForceElement, ForceField, Law, Mirror, Reader, Shape
from cutjoint.elements.interaction import Axis, Carrier, Point
from cutjoint.elements.interactions.touch import Touch
from cutjoint.elements.terms import Scalar, Vector

#: The motion of the contact, with units.
_MOTION = {"deflection": "m", "deflection_rate": "m/s", "vx": "m/s", "vy": "m/s", "turn": "rad/s"}
_FORCE = Law(_MOTION, "N")

_SIDEWAYS = ("vy", "turn")  #: the motion that changes its sign in the image


def _problem(part: Any) -> tuple[str, ...]:
    if (part.normal is None) == (part.axis is None):
        return "needs either 'normal' of a plane or 'axis' of a cylinder", "write normal: z, or axis: z and cylinder: its radius"
    if (part.axis is None) != (part.cylinder is None):
        return "'axis' and 'cylinder' go together", "write axis: z and cylinder: its radius, or normal: z of a plane"
    return ("a plane has no inside",) if part.inside and part.axis is None else ()


@dataclass(frozen=True, kw_only=True)
class Contact(Force):
    """A ball of radius ``ball`` (m) about ``centre`` of ``follower``, a point where that is 0, on a surface of ``base``.

    The surface is the plane through ``start`` with ``normal``, or the cylinder of radius ``cylinder`` (m) about the axis ``along`` through
    ``start``, met from outside or ``inside``. ``force`` (N) are three expressions: along ``along``, along n x along, and along the normal n
    towards the centre. Their variables are the ``deflection`` (m) with its rate, ``vx`` and ``vy`` (m/s), the sliding velocity of the
    follower, and ``turn`` (rad/s), the relative angular velocity about the normal. It acts on the follower, and its reaction on the base at
    the same place, where the deflection is positive.
    """

    element: ClassVar[ForceElement] = ForceElement(
        kind="contact",
        text="A ball or a point of the follower on a plane or a cylinder of the base, with a force by expressions.",
        fields=(
            ForceField("bodies", Shape.BODIES), ForceField("at", Shape.POINT, words=" of the plane or the axis"),
            ForceField("normal", Shape.DIRECTION, None, words=" of a plane, towards the ball"),
            ForceField("along", Shape.DIRECTION, None, words=": x axis on a plane, any if left out"),
            ForceField("axis", Shape.DIRECTION, None, words=" of a cylinder"),
            ForceField("cylinder", Shape.NUMBER, None, words=" (its radius)", unit="m"), ForceField("inside", Shape.SWITCH, False),
            ForceField("centre", Shape.POINT, words=" of the ball"), ForceField("radius", Shape.NUMBER, 0, words=" of the ball", unit="m"),
            ForceField("force", Shape.TRIPLE), ForceField("let", Shape.NAMES, {}),
        ),
        problem=_problem,
        interaction=Touch(
            start=Point(Carrier.BASE, "start"), centre=Point(Carrier.FOLLOWER, "centre"), along=Axis(Carrier.BASE, "along"),
            normal=Axis(Carrier.BASE, "normal"),
        ),
        laws=("force",), forms=(_FORCE,), quantities={**dict.fromkeys(("Fx", "Fy", "Fz"), "N"), **_MOTION}, odd=(*_SIDEWAYS, "Fy"),
    )  # fmt: skip

    base: str
    follower: str
    start: Vector
    centre: Vector
    along: Vector
    normal: Vector | None
    ball: Scalar
    cylinder: Scalar
    inside: bool
    force: Vector

    @classmethod
    def read(cls, reader: Reader) -> Self:
        is_plane = reader.field("normal") is not None
        normal = reader.direction("normal") if is_plane else None
        return cls(
            **reader.common(), start=reader.point("at"), centre=reader.point("centre"), normal=normal,
            along=reader.direction("axis") if normal is None else reader.across(normal, "along"), inside=reader.field("inside"),
            ball=reader.number("radius", unit="m"), cylinder=None if is_plane else reader.number("cylinder", unit="m"),
            force=reader.triple("force", _FORCE, let="let"),
        )  # fmt: skip

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the contact, whose second direction is reversed."""
        x, y, z = (mirror.opposite(part, _SIDEWAYS) for part in self.force)
        return replace(super().mirrored(mirror, signs), force=(x, -y, z))
