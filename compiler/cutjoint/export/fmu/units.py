"""Units of variables as FMI has them: exponents of the base units, the radian among these, and degrees to display."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from cutjoint.model.units import measure

#: As FMI names and orders them; the radian comes last.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")

_FACTOR = re.compile(r"(?P<sign>/?)\s*(?P<name>[A-Za-z]+|1)(?:(?:\^|\*\*)(?P<power>-?[0-9]+))?")


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit of SI: whole exponents of the base units that it has, none where one is no whole number; the unit to display with its
    factor, if it has angles."""

    name: str
    exponents: Mapping[str, int]
    display: tuple[str, float] | None


def describe_unit(name: str) -> Unit | None:
    """The unit of that name; None for plain numbers."""
    if name in ("", "1"):
        return None
    dimension, turns = measure(1.0, name).dimension, _power_of_radian(name)
    powers = dict(zip(BASE_UNITS, (*dimension.exponents, Fraction(turns)), strict=True))
    whole = all(power.denominator == 1 for power in powers.values())
    display = (re.sub(r"\brad\b", "deg", name), math.degrees(1.0) ** turns) if turns else None
    return Unit(name=name, exponents={base: int(power) for base, power in powers.items() if power} if whole else {}, display=display)


def _power_of_radian(name: str) -> int:
    found = (m for m in _FACTOR.finditer(name) if m["name"] in ("rad", "radian", "radians"))
    return sum(int(m["power"] or 1) * (-1 if m["sign"] else 1) for m in found)
