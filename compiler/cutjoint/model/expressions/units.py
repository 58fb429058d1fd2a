"""Physical dimensions, and numbers written with a unit. All becomes SI; pint knows the units' names. SI units with the usual prefixes,
which most files use, are known here too: importing pint takes 0.3 s, a sixth of the time for deriving a vehicle.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from cutjoint.model.text import UNSIGNED

_BASE = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[current]": "A", "[temperature]": "K", "[substance]": "mol", "[luminosity]": "cd"}
_ANGLES = re.compile(r"rad|deg|turn|rev|rpm")
#: Units of one dimension that measure different quantities.
_KINDS = (re.compile(r"rad|deg|turn|rev|rpm|arc|grad"), re.compile(r"J|Wh|cal"), re.compile(r"Hz"))
_NUMBER = rf"[-+]?{UNSIGNED}"
_FACTOR = r"[A-Za-z]+(?:(?:\^|\*\*)-?[0-9]{1,2})?"
_FACTORS = rf"{_FACTOR}(?:\s*[*/ ]\s*{_FACTOR})*"
_UNIT = rf"(?:1\s*/\s*)?{_FACTORS}"
_TERM = re.compile(r"(/?)\s*([A-Za-z]+)(?:(?:\^|\*\*)(-?[0-9]+))?")
_ZEROTH_POWER = re.compile(r"(?:\^|\*\*)-?0+(?![0-9])")
_MEASURE = re.compile(rf"\s*({_NUMBER})(?![eE](?![A-Za-z]))(?:\s*({_FACTORS})|\s+(1\s*/\s*{_FACTORS}))\s*")
MAX_UNIT_LENGTH = 40


@dataclass(frozen=True)
class Dimension:
    """Exponents of kg, m, s, A, K, mol and cd; ``text`` is the unit where these alone leave it open."""

    exponents: tuple[Fraction, ...]
    text: str = field(default="", compare=False)

    def __mul__(self, other: Dimension) -> Dimension:
        return Dimension(tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __truediv__(self, other: Dimension) -> Dimension:
        return self * other**-1

    def __pow__(self, power: Fraction | int) -> Dimension:
        return Dimension(tuple(a * power for a in self.exponents))

    def __str__(self) -> str:
        """The dimension's SI unit, such as "N/m"."""
        return self.text or _SI_TEXT.get(self) or _spell(self)


def described(dimension: Dimension | None) -> str:
    """A dimension as text for messages: its unit, or words if it has none."""
    return "an angle or a plain number" if dimension == NONE else str(dimension)


def _base(index: int) -> Dimension:
    return Dimension(tuple(Fraction(int(index == i)) for i in range(len(_BASE))))


MASS, LENGTH, TIME = _base(0), _base(1), _base(2)
NONE = MASS / MASS
SPEED = LENGTH / TIME
ACCELERATION = SPEED / TIME
FORCE = MASS * ACCELERATION
TORQUE = FORCE * LENGTH
INERTIA = MASS * LENGTH**2
ANGLE = NONE
ANGULAR_SPEED = Dimension((NONE / TIME).exponents, "rad/s")

_JOULE = FORCE * LENGTH
_WATT = _JOULE / TIME
_PASCAL = FORCE / LENGTH**2

#: Units that files have most often: their sizes in SI, exactly but for the degree, and their dimensions.
_COMMON: Mapping[str, tuple[Fraction, Dimension]] = {
    name: (Fraction(size), dimension)
    for name, size, dimension in (
        ("kg", 1, MASS), ("g", Fraction(1, 1000), MASS), ("t", 1000, MASS),
        ("m", 1, LENGTH), ("km", 1000, LENGTH), ("dm", Fraction(1, 10), LENGTH), ("cm", Fraction(1, 100), LENGTH),
        ("mm", Fraction(1, 1000), LENGTH),
        ("s", 1, TIME), ("ms", Fraction(1, 1000), TIME), ("min", 60, TIME), ("h", 3600, TIME), ("Hz", 1, NONE / TIME),
        ("N", 1, FORCE), ("kN", 1000, FORCE), ("MN", 10**6, FORCE),
        ("J", 1, _JOULE), ("kJ", 1000, _JOULE), ("W", 1, _WATT), ("kW", 1000, _WATT),
        ("Pa", 1, _PASCAL), ("kPa", 1000, _PASCAL), ("MPa", 10**6, _PASCAL), ("bar", 10**5, _PASCAL),
        ("rad", 1, NONE), ("mrad", Fraction(1, 1000), NONE), ("deg", Fraction(math.pi) / 180, NONE),
    )
}  # fmt: skip

#: Units of lengths and angles that files have most often, with their sizes in SI.
PLACES: Mapping[str, float] = {
    name: float(size) for name, (size, dimension) in _COMMON.items() if dimension == LENGTH or name in ("rad", "mrad", "deg")
}

_SI_TEXT: Mapping[Dimension, str] = {
    NONE: "1", FORCE: "N", TORQUE: "N*m", FORCE / LENGTH: "N/m", FORCE / SPEED: "N*s/m", TORQUE * TIME: "N*m*s",
    FORCE / LENGTH**2: "N/m^2",
}  # fmt: skip


def _spell(dimension: Dimension) -> str:
    factors = [(name, power) for name, power in zip(_BASE.values(), dimension.exponents, strict=True) if power]
    above = "*".join(_power(name, power) for name, power in factors if power > 0)
    below = "".join("/" + _power(name, -power) for name, power in factors if power < 0)
    return (above or "1") + below


def _power(name: str, power: Fraction) -> str:
    return name if power == 1 else f"{name}^{power}"


class UnitError(ValueError):
    """A unit that cannot be read."""


@dataclass(frozen=True)
class Measure:
    """A number in SI with its dimension and the text of its SI unit."""

    value: float
    dimension: Dimension
    unit: str


class Quantity(float):
    """A number in SI units that was written as ``text`` with a unit, of the ``dimension`` of that."""

    dimension: Dimension
    text: str

    @classmethod
    def of(cls, value: float, dimension: Dimension, text: str) -> Quantity:
        """A value with its original text."""
        made = cls(value)
        made.dimension, made.text = dimension, text
        return made


def fault_of_dimension(value: float, unit: str) -> str:
    """The fault in a number written with a unit in the place of one of ``unit``, "" for any; "" without a fault."""
    if not isinstance(value, Quantity) or not unit:
        return ""
    if value.dimension != (own := measure(1.0, unit).dimension):
        return f"needs {described(own)}, got {described(value.dimension)}: {value.text}"
    return f"is in {unit}: {fault}" if (fault := fault_of_hertz(value.text, unit)) else ""


def fault_of_hertz(written: str, unit: str = "rad/s") -> str:
    """The fault in Hz in the place of an angular speed, or the reverse; "" without one.  ``written`` is a rate or its unit."""
    if "Hz" in written and _ANGLES.search(unit):
        number = "".join(re.findall(rf"^{_NUMBER}", written))
        hint = " or ".join(f"'{number} {one}/s'".replace("' ", "'") for one in ("turn", "rad"))
        return f"Hz leaves open whether turns or radians per second are meant; write {hint}"
    return f"'{written}' counts angles; write Hz" if unit == "Hz" and _ANGLES.search(written) else ""


def read_measure(text: str) -> Measure | None:
    """A number with a unit, such as "30 deg"; None when ``text`` is not of that form. Raises UnitError when the unit is unknown."""
    match = _MEASURE.fullmatch(text)
    return measure(float(match[1]), match[2] or match[3]) if match else None


def unit_written(text: str) -> str:
    """The unit that a number is written with; "" where ``text`` is not of that form."""
    match = _MEASURE.fullmatch(text)
    return " ".join((match[2] or match[3]).split()) if match else ""


def measure(value: float, unit: str) -> Measure:
    """``value`` in ``unit``, converted to SI.  Raises UnitError when the unit cannot be read."""
    unit = " ".join(unit.split())
    if unit == "1":
        return Measure(value, NONE, "1")
    if len(unit) > MAX_UNIT_LENGTH or not re.fullmatch(_UNIT, unit):
        raise UnitError(f"'{unit[:MAX_UNIT_LENGTH]}' is not a unit")
    if _ZEROTH_POWER.search(unit):
        raise UnitError(f"'{unit}' is not a unit: a power of zero has none")
    common = _common(unit)
    si, size, dimension = (value * common[0], *common) if common else _by_pint(value, unit)
    if not math.isfinite(si):
        raise UnitError(f"'{value} {unit}' is out of range")
    return Measure(si, dimension, unit if size == 1.0 else "rad" if dimension == NONE else str(dimension))


def kind_of_unit(unit: str) -> tuple[bool, ...]:
    """What tells quantities of one dimension apart: angles and numbers, energies and torques, frequencies."""
    return tuple(bool(kind.search(unit)) for kind in _KINDS)


def display_units(wanted: Sequence[str]) -> Mapping[str, Measure]:
    """The size and dimension of units for display. Raises UnitError: one is unknown, has an offset, or is of an earlier one's quantity."""
    found: dict[str, Measure] = {}
    for unit in wanted:
        one = measure(1.0, unit)
        if measure(0.0, unit).value:
            raise UnitError(f"'{unit}' has an offset")
        if rivals := [u for u, other in found.items() if other.dimension == one.dimension and kind_of_unit(u) == kind_of_unit(unit)]:
            raise UnitError(f"'{rivals[0]}' and '{unit}' are units of one quantity; name one of them")
        found[unit] = one
    return found


def _common(unit: str) -> tuple[float, Dimension] | None:
    """The size of a unit in SI and its dimension, if all its factors are in _COMMON."""
    size, dimension = Fraction(1), NONE
    for over, name, power in _TERM.findall(unit.removeprefix("1")):
        if name not in _COMMON:
            return None
        exponent = int(power or 1) * (-1 if over else 1)
        size, dimension = size * _COMMON[name][0] ** exponent, dimension * _COMMON[name][1] ** exponent
    try:
        return float(size), dimension
    except OverflowError:
        return math.inf, dimension


def _by_pint(value: float, unit: str) -> tuple[float, float, Dimension]:
    """A value in SI, that of one unit, and the dimension.  Raises UnitError when the unit is unknown."""
    import pint

    try:
        with np.errstate(all="ignore"):  # units of logarithms are converted by NumPy
            quantity, one = (_registry().Quantity(x, unit).to_base_units() for x in (value, 1.0))
    except (pint.PintError, ArithmeticError, AttributeError, TypeError, ValueError):
        raise UnitError(f"unknown unit '{unit}'") from None
    return float(quantity.magnitude), float(one.magnitude), _dimension(quantity)


def _dimension(quantity: Any) -> Dimension:
    exponents = quantity.dimensionality
    unknown = set(exponents) - set(_BASE)
    if unknown:
        raise UnitError(f"units of {', '.join(sorted(unknown))} have no place in a model")
    return Dimension(tuple(Fraction(exponents.get(name, 0)).limit_denominator(100) for name in _BASE))


@cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry()
    registry.define("newton_metre = newton * metre = Nm")  # pint's Nm counts yarn, 1000 m/kg, and its Nms are several of these
    registry.define("newton_metre_second = newton * metre * second = Nms")
    return registry
