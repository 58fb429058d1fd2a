"""The common part of wheels on the road: the ground that a wheel has under it beside the scene's road."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from cutjoint.elements.force import Force, ForceField, Mirror, Reader, Shape
from cutjoint.elements.terms import Scalar, Vector, reads_elements

#: Fields of the ground under a wheel, with their units.
GROUND = {"ground_height": "m", "ground_slope": "1", "ground_bank": "1", "friction": "1"}

GROUND_FIELDS = tuple(ForceField(name, Shape.NUMBER, None, unit=unit) for name, unit in GROUND.items())


def read_ground(reader: Reader) -> Mapping[str, Any]:
    """The expressions of those fields that are given."""
    return {name: reader.expression(name, unit=unit) for name, unit in GROUND.items() if reader.given(name) is not None}


@dataclass(frozen=True, kw_only=True)
class OnRoad(Force):
    """A wheel on the road: ``centre``, and ``axis``, which points left when the wheel rolls forward.

    ``ground_height`` (m), ``ground_slope`` and ``ground_bank`` (along x and y) under the wheel centre are added to the scene's road, and
    ``friction`` is a factor of the road's: expressions that may change, None where there are none.
    """

    body: str
    centre: Vector
    axis: Vector
    ground_height: Scalar | None = None
    ground_slope: Scalar | None = None
    ground_bank: Scalar | None = None
    friction: Scalar | None = None

    @property
    def ground(self) -> Mapping[str, Scalar]:
        """The expressions of the ground by the names of their fields."""
        return {name: value for name in GROUND if (value := getattr(self, name)) is not None}

    @property
    def ground_reads_elements(self) -> bool:
        """Return whether the ground under the wheel follows from other elements."""
        return any(map(reads_elements, self.ground.values()))

    def with_ground(self, added: Mapping[str, Scalar]) -> Self:
        """The wheel with ground that is ``added``, by the names of the fields: heights and slopes are summed, frictions multiplied."""
        own = self.ground
        both = {name: own[name] * x if name == "friction" else own[name] + x for name, x in added.items() if name in own}
        return replace(self, **{**added, **both})

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image: the ground falls the other way along the mirrored axis."""
        along, across, _ = mirror.signs
        slope, bank = (
            None if value is None else sign * value for value, sign in ((self.ground_slope, along), (self.ground_bank, across))
        )
        return replace(super().mirrored(mirror, signs), ground_slope=slope, ground_bank=bank)
