"""The common part of wheels on the road: terrain under a wheel in addition to the scene's road."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from cutjoint.elements.force import Force, ForceField, Mirror, Reader, Shape
from cutjoint.elements.terms import Scalar, Vector

#: Fields of the ground under a wheel, with their units.
TERRAIN = {"terrain_height": "m", "terrain_slope": "1", "terrain_bank": "1", "friction": "1"}

TERRAIN_FIELDS = tuple(ForceField(name, Shape.NUMBER, None, unit=unit) for name, unit in TERRAIN.items())


def read_terrain(reader: Reader) -> Mapping[str, Any]:
    """The expressions of those fields that are given."""
    return {name: reader.expression(name, unit=unit) for name, unit in TERRAIN.items() if reader.field(name) is not None}


@dataclass(frozen=True, kw_only=True)
class OnRoad(Force):
    """A wheel on the road: ``centre``, and ``axis``, which points left when the wheel rolls forward.
    ``terrain_height`` (m), ``terrain_slope`` and ``terrain_bank`` (along x and y) under the wheel centre are added to the scene's road,
    and ``friction`` is a factor of the road's: expressions that may vary with time, None if not given."""

    body: str
    centre: Vector
    axis: Vector
    terrain_height: Scalar | None = None
    terrain_slope: Scalar | None = None
    terrain_bank: Scalar | None = None
    friction: Scalar | None = None

    @property
    def terrain(self) -> Mapping[str, Scalar]:
        """The expressions of the ground by the names of their fields."""
        return {name: value for name in TERRAIN if (value := getattr(self, name)) is not None}

    @property
    def expressions(self) -> tuple[Scalar, ...]:
        """The components, and the ground under the wheel."""
        return (*super().expressions, *self.terrain.values())

    @property
    def measured(self) -> frozenset[str]:
        """No quantity of a wheel whose ground reads other elements, or controllers' discrete states: symbols of `model.expressions`."""
        symbols = (symbol for value in self.terrain.values() for symbol in getattr(value, "free_symbols", ()))
        return frozenset() if any(str(symbol).startswith(("@", "$")) for symbol in symbols) else super().measured

    def with_added_terrain(self, added: Mapping[str, Scalar]) -> Self:
        """The wheel with ``added`` terrain, by the names of the fields: heights and slopes are summed, frictions multiplied."""
        own = self.terrain
        both = {name: own[name] * x if name == "friction" else own[name] + x for name, x in added.items() if name in own}
        return replace(self, **{**added, **both})

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image: the slope along the mirrored axis changes its sign."""
        along, across, _ = mirror.signs
        slope, bank = (
            None if value is None else sign * value for value, sign in ((self.terrain_slope, along), (self.terrain_bank, across))
        )
        return replace(super().mirrored(mirror, signs), terrain_slope=slope, terrain_bank=bank)
