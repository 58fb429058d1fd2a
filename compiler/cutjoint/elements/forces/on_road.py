"""The common part of wheels on the road: the ground that a wheel has under it beside the scene's road."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from cutjoint.elements.force import Force, ForceField, Mirror, Reader, Shape
from cutjoint.elements.terms import Scalar, Vector

#: Fields of the ground under a wheel, with their units.
_GROUND = {"ground_height": "m", "ground_slope": "1", "ground_bank": "1"}


def ground_fields(**more: str) -> tuple[ForceField, ...]:
    """The fields of the ground under a wheel, and ``more`` with their units."""
    return tuple(ForceField(name, Shape.NUMBER, None, unit=unit) for name, unit in {**_GROUND, **more}.items())


def read_ground(reader: Reader, **more: str) -> Mapping[str, Any]:
    """The expressions of those fields that are given."""
    return {name: reader.expression(name, unit=unit) for name, unit in {**_GROUND, **more}.items() if reader.given(name) is not None}


@dataclass(frozen=True, kw_only=True)
class OnRoad(Force):
    """A wheel on the road: ``centre``, and ``axis``, which points left when the wheel rolls forward.

    ``ground_height`` (m), ``ground_slope`` and ``ground_bank`` (along x and y) under the wheel centre are added to the scene's road:
    expressions that may change, None where there are none.
    """

    body: str
    centre: Vector
    axis: Vector
    ground_height: Scalar | None = None
    ground_slope: Scalar | None = None
    ground_bank: Scalar | None = None

    @property
    def ground(self) -> Mapping[str, Scalar]:
        """The expressions of the ground by the names of their fields."""
        return {name: value for name in _GROUND if (value := getattr(self, name)) is not None}

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image: the ground falls the other way along the mirrored axis."""
        along, across, _ = mirror.signs
        slope, bank = (
            None if value is None else sign * value for value, sign in ((self.ground_slope, along), (self.ground_bank, across))
        )
        return replace(super().mirrored(mirror, signs), ground_slope=slope, ground_bank=bank)
