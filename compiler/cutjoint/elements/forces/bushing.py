"""Six springs between two bodies at a point."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from cutjoint.elements.force import Force, ForceElement, ForceField, Law, Mirror, Reader, Shape
from cutjoint.elements.interaction import Carrier, Frame, Point
from cutjoint.elements.interactions.compliance import Compliance
from cutjoint.elements.terms import Scalar, Vector

_ALONG = Law({"position": "m", "rate": "m/s"}, "N")
_ABOUT = Law({"position": "rad", "rate": "rad/s"}, "N*m")

#: The laws along and about the axes: the kind of displacement, and the units of stiffness and damping.
_LAWS = (*[(_ALONG, "N/m", "N*s/m")] * 3, *[(_ABOUT, "N*m", "N*m*s")] * 3)


def _problem(part: Any) -> tuple[str, ...]:
    is_wrong = (part.laws is None) == (part.stiffness is None and part.damping is None)
    return ("needs either laws, or stiffness and damping",) if is_wrong else ()


@dataclass(frozen=True, kw_only=True)
class Bushing(Force):
    """Six forces between two bodies at ``point``, common to both in the design position, along and about ``axes`` of ``base``.

    With E the axes carried by the base and G those carried by the follower, the three displacements are E^T times the vector from the
    base's to the follower's point, the three rotations half the sum of the vector products of e_k and g_k (in E): for a small angle the
    angle, for a large one its sine. ``laws`` are six expressions over ``position`` (m, rad), its ``rate``, ``t`` and parameters: forces on
    the follower at its point (N) and generalised forces on its rotations (N m). The base has the opposite wrench at the same point, so that
    the power of the pair is the sum of law times rate.
    """

    element: ClassVar[ForceElement] = ForceElement(
        kind="bushing",
        text="Six springs between two bodies at a point, along and about axes of the base: global in the design position or `x`, `y`, `z`.",
        fields=(
            ForceField("bodies", Shape.BODIES), ForceField("at", Shape.POINT),
            *(ForceField(name, Shape.DIRECTION, None) for name in "xyz"),
            ForceField("stiffness", Shape.SIX, None, words=" (three N/m, three N m)"),
            ForceField("damping", Shape.SIX, None, words=" (three N s/m, three N m s)"),
            ForceField("laws", Shape.LAWS, None, words=": six, in place of both"),
        ),
        problem=_problem,
        interaction=Compliance(
            base=Point(Carrier.BASE, "point"), follower=Point(Carrier.FOLLOWER, "point"), frame=Frame(Carrier.BASE, "axes")
        ),
        laws=("laws",),
        forms=(_ALONG, _ABOUT), components=True,
        quantities={
            **dict.fromkeys(("Fx", "Fy", "Fz"), "N"), **dict.fromkeys(("Mx", "My", "Mz"), "N*m"),
            **dict.fromkeys(("dx", "dy", "dz"), "m"), **dict.fromkeys(("rx", "ry", "rz"), "rad"),
        },
    )  # fmt: skip

    base: str
    follower: str
    point: Vector
    axes: tuple[Vector, Vector, Vector]
    laws: tuple[Scalar, ...]

    @classmethod
    def read(cls, reader: Reader) -> Self:
        axes = reader.frame()
        return cls(**reader.common(), point=reader.point("at"), axes=axes, laws=tuple(_read_law(reader, index) for index in range(6)))

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the bushing."""
        of_laws = (*mirror.signs, *(-sign for sign in mirror.signs))
        laws = tuple(mirror.reflected(law, sign) for sign, law in zip(of_laws, self.laws, strict=True))
        return replace(super().mirrored(mirror, signs), axes=mirror.frame(self.axes), laws=laws)


def _read_law(reader: Reader, index: int) -> Scalar:
    """The restoring force along an axis, or torque about one, on the follower."""
    law, per_position, per_rate = _LAWS[index]
    if reader.field("laws") is not None:
        return reader.law("laws", index, law=law)
    stiffness, damping = (reader.number(name, index, unit=unit) for name, unit in (("stiffness", per_position), ("damping", per_rate)))
    return -stiffness * reader.variable("position") - damping * reader.variable("rate")
