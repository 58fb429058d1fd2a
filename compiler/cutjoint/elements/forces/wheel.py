"""A rotating wheel on the road, with forces and moments by expressions."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from cutjoint.elements.force import ForceElement, ForceField, Law, Mirror, Reader, Shape
from cutjoint.elements.forces.on_road import TERRAIN_FIELDS, OnRoad, read_terrain
from cutjoint.elements.interaction import Axis, Carrier, Point
from cutjoint.elements.interactions.rolling_contact import RollingContact
from cutjoint.elements.terms import Scalar, Vector

#: The motion of the contact, with units.
_MOTION = {
    "deflection": "m", "deflection_rate": "m/s", "loaded_radius": "m", "vx": "m/s", "vy": "m/s", "spin": "rad/s", "camber": "rad",
    "turn": "rad/s", "road_friction": "1",
}  # fmt: skip
_FORCE, _MOMENT = Law(_MOTION, "N"), Law(_MOTION, "N*m")

_SIDEWAYS = ("vy", "camber", "turn")  #: the motion that changes its sign on the other side of a vehicle


@dataclass(frozen=True, kw_only=True)
class Wheel(OnRoad):
    """A wheel on the road that rotates with its body.

    ``force`` (N) and ``moment`` (N m) are three expressions each: along the rolling direction, to the left in the road's plane, and along
    the road's normal.  They act on the body where the wheel's plane meets the road, if the wheel touches it.  Their variables are the
    ``deflection`` (m) in the wheel's plane with its rate, ``loaded_radius`` (m), ``vx`` (m/s) of the centre along the rolling direction,
    ``vy`` (m/s) of the contact to the left, ``spin`` (rad/s) about the axis, ``camber`` (rad, the top leaning to the right), and ``turn``
    (rad/s) about the normal, and ``road_friction``, a factor that patches of the road and the ground have.  ``free_radius`` is in m.
    """

    element: ClassVar[ForceElement] = ForceElement(
        kind="wheel",
        text="A wheel that turns, on the road, with forces and moments by expressions.",
        fields=(
            ForceField("body", Shape.BODY), ForceField("centre", Shape.POINT),
            ForceField("axis", Shape.DIRECTION, words=" (to the left when rolling forward)"), ForceField("radius", Shape.NUMBER, unit="m"),
            ForceField("force", Shape.TRIPLE), ForceField("moment", Shape.TRIPLE, (0, 0, 0)), ForceField("let", Shape.NAMES, {}),
            *TERRAIN_FIELDS,
        ),
        interaction=RollingContact(centre=Point(Carrier.BODY, "centre"), axis=Axis(Carrier.BODY, "axis", is_rotation=True)),
        laws=("force", "moment"),
        forms=(_FORCE, _MOMENT),
        quantities={**dict.fromkeys(("Fx", "Fy", "Fz"), "N"), **dict.fromkeys(("Mx", "My", "Mz"), "N*m"), **_MOTION},
        odd=(*_SIDEWAYS, "Fy", "Mx", "Mz"),
    )  # fmt: skip

    free_radius: Scalar
    force: Vector
    moment: Vector

    @classmethod
    def read(cls, reader: Reader) -> Self:
        return cls(
            **reader.common(), body=reader.body("body"), centre=reader.point("centre"), axis=reader.direction("axis"),
            free_radius=reader.number("radius", unit="m"), force=reader.triple("force", _FORCE, let="let"),
            moment=reader.triple("moment", _MOMENT, let="let"), **read_terrain(reader),
        )  # fmt: skip

    @property
    def radius(self) -> Scalar:
        return self.free_radius

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the wheel, whose lateral motion and forces change their sign."""
        (fx, fy, fz), (mx, my, mz) = (tuple(mirror.opposite(part, _SIDEWAYS) for part in parts) for parts in (self.force, self.moment))
        return replace(super().mirrored(mirror, signs), force=(fx, -fy, fz), moment=(-mx, my, -mz))
