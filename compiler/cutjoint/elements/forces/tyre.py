"""A wheel on the road."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

from cutjoint.elements.force import Constants, ForceElement, ForceField, Reader, Shape
from cutjoint.elements.forces.on_road import TERRAIN_FIELDS, OnRoad, read_terrain
from cutjoint.elements.interaction import Axis, Carrier, Point
from cutjoint.elements.interactions.road_contact import RoadContact
from cutjoint.elements.terms import Scalar

CALSPAN = ("A0", "A1", "A2", "A3", "A4", "B1", "B3", "B4", "SN", "AF1", "AF2")  #: the constants of the Calspan model
_UNITS = {"stiffness": "N/m", "radius": "m", "spin_inertia": "kg*m^2"}  #: numbers that are fields of their own, with units


@dataclass(frozen=True, kw_only=True)
class Tyre(OnRoad):
    """A wheel on the road: vertical spring, Calspan lateral and aligning force.

    ``constants`` maps ``stiffness``, ``radius``, ``spin_inertia`` (kg m2, of the wheel about its axis, whose rotation has no coordinate;
    its gyroscopic moment acts on the body) and the Calspan names ``A0 .. A4, B1, B3, B4, SN, AF1, AF2`` to values. Without ``lateral``, in
    a reduced model, it has no lateral force and no aligning moment.
    """

    element: ClassVar[ForceElement] = ForceElement(
        kind="tyre",
        text="A wheel on the road.",
        fields=(
            ForceField("body", Shape.BODY), ForceField("centre", Shape.POINT),
            ForceField("axis", Shape.DIRECTION, words=" (to the left when rolling forward)"),
            ForceField("radius", Shape.NUMBER, unit=_UNITS["radius"]), ForceField("stiffness", Shape.NUMBER, unit=_UNITS["stiffness"]),
            ForceField("spin_inertia", Shape.NUMBER, 0, unit=_UNITS["spin_inertia"]),
            ForceField("calspan", Constants("Calspan", "Constants of the Calspan tyre.", CALSPAN)),
            *TERRAIN_FIELDS,
        ),
        interaction=RoadContact(centre=Point(Carrier.BODY, "centre"), axis=Axis(Carrier.BODY, "axis", is_rotation=True)),
        laws=(),
        quantities={"Fz": "N", "Fy": "N", "Mz": "N*m", "slip": "rad", "camber": "rad", "deflection": "m"},
        odd=("Fy", "Mz", "slip", "camber"),
    )  # fmt: skip

    constants: Mapping[str, Scalar]
    lateral: bool = True

    @classmethod
    def read(cls, reader: Reader) -> Self:
        constants = {name: reader.number(name, unit=unit) for name, unit in _UNITS.items()}
        constants |= {name: reader.number("calspan", name, unit="") for name in CALSPAN}
        return cls(
            **reader.common(), body=reader.body("body"), centre=reader.point("centre"), axis=reader.direction("axis"),
            constants=constants, **read_terrain(reader),
        )  # fmt: skip

    @property
    def radius(self) -> Scalar:
        return self.constants["radius"]
