"""A wheel on the road."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from cutjoint.elements.force import Constants, Force, ForceElement, ForceField, Mirror, Reader, Shape
from cutjoint.elements.interaction import Axis, Carrier, Point
from cutjoint.elements.interactions import RoadContact
from cutjoint.elements.terms import Scalar, Vector

#: The constants of the Calspan model.
CALSPAN = ("A0", "A1", "A2", "A3", "A4", "B1", "B3", "B4", "SN", "AF1", "AF2")

#: Numbers that are fields of their own, with units.
_UNITS = {"stiffness": "N/m", "radius": "m", "spin_inertia": "kg*m^2"}

#: Constants that count half where nothing pushes the wheel sideways and half of it is meant.
_HALVED = ("stiffness", "spin_inertia")

#: Fields of the ground under a wheel, with their units.
_GROUND = {"ground_height": "m", "ground_slope": "1", "ground_bank": "1", "friction": "1"}

#: Quantities that count the same way on the other side.
_EVEN = ("Fz", "deflection")


@dataclass(frozen=True, kw_only=True)
class Tyre(Force):
    """A wheel on the road: vertical spring, Calspan lateral and aligning force.

    ``centre`` is the wheel centre, ``axis`` the wheel axis (pointing left when the wheel rolls forward).
    ``constants`` maps ``stiffness``, ``radius``, ``spin_inertia`` (kg m2, of the wheel's turning about its axis, which
    no coordinate stands for: its gyroscopic moment acts on the body) and the Calspan names ``A0 .. A4, B1, B3, B4, SN, AF1, AF2``
    to values.  Without ``lateral``, in a reduced model, nothing pushes it sideways and it does not align.

    ``ground_height`` (m), ``ground_slope`` and ``ground_bank`` (along x and y) under the wheel centre are added to the scene's road,
    ``friction`` is a factor of SN: expressions that may change, None where there are none.
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
            *(ForceField(name, Shape.NUMBER, None, unit=unit) for name, unit in _GROUND.items()),
        ),
        interaction=RoadContact(centre=Point(Carrier.BODY, "centre"), axis=Axis(Carrier.BODY, "axis", is_rotation=True)),
        laws=(),
        quantities={"Fz": "N", "Fy": "N", "Mz": "N*m", "slip": "rad", "camber": "rad", "deflection": "m"},
    )  # fmt: skip

    body: str
    centre: Vector
    axis: Vector
    constants: Mapping[str, Scalar]
    lateral: bool = True
    ground_height: Scalar | None = None
    ground_slope: Scalar | None = None
    ground_bank: Scalar | None = None
    friction: Scalar | None = None

    @classmethod
    def read(cls, reader: Reader) -> Self:
        """The record of what a reader reads."""
        constants = {name: reader.number(name, unit=unit) for name, unit in _UNITS.items()}
        constants |= {name: reader.number("calspan", name, unit="") for name in CALSPAN}
        ground = {name: reader.expression(name, unit=unit) for name, unit in _GROUND.items() if reader.given(name) is not None}
        return cls(
            **reader.common(), body=reader.body("body"), centre=reader.point("centre"), axis=reader.direction("axis"),
            constants=constants, **ground,
        )  # fmt: skip

    @property
    def radius(self) -> Scalar:
        """The radius of the wheel, m."""
        return self.constants["radius"]

    @property
    def expressions(self) -> tuple[Scalar, ...]:
        """The ground under the wheel."""
        return tuple(value for value in (getattr(self, name) for name in _GROUND) if value is not None)

    @property
    def measured(self) -> frozenset[str]:
        """No quantity of a wheel on a ground of its own: that may read other elements."""
        return frozenset() if self.expressions else super().measured

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the tyre: the ground falls the other way along the mirrored axis."""
        along, across, _ = mirror.signs
        slope, bank = (
            None if value is None else sign * value for value, sign in ((self.ground_slope, along), (self.ground_bank, across))
        )
        return replace(super().mirrored(mirror, signs), ground_slope=slope, ground_bank=bank)

    def image_sign(self, quantity: str, sign: Callable[[str], int], of_coordinate: int) -> int:
        """The sign of a quantity in the tyre's image: -1 of sideways quantities."""
        return 1 if quantity in _EVEN else -1

    def halved(self) -> Self:
        """The tyre with half its load and spin, since nothing pushes it sideways."""
        return replace(self, constants={name: value / 2 if name in _HALVED else value for name, value in self.constants.items()})
