"""Physical dimensions, and numbers written with a unit.  All becomes SI; pint knows the units' names."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pint

from cutjoint.model.numbers import UNSIGNED


@dataclass(frozen=True)
class Dimension:
    """Exponents of kg, m, s, A, K, mol and cd."""

    exponents: tuple[Fraction, ...]

    def __mul__(self, other: Dimension) -> Dimension:
        return Dimension(tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __truediv__(self, other: Dimension) -> Dimension:
        return self * other**-1

    def __pow__(self, power: Fraction | int) -> Dimension:
        return Dimension(tuple(a * power for a in self.exponents))

    def __str__(self) -> str:
        """The dimension's SI unit, such as "N/m"."""
        return _SI_TEXT.get(self) or _spell(self)


def described(dimension: Dimension | None) -> str:
    """A dimension in words for messages: its unit, or what has none."""
    return "an angle or a plain number" if dimension == NONE else str(dimension)


_BASE = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[current]": "A", "[temperature]": "K",
         "[substance]": "mol", "[luminosity]": "cd"}  # fmt: skip


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
ANGULAR_SPEED = NONE / TIME

_SI_TEXT: Mapping[Dimension, str] = {
    NONE: "1",
    FORCE: "N",
    TORQUE: "N*m",
    FORCE / LENGTH: "N/m",
    FORCE / SPEED: "N*s/m",
    TORQUE * TIME: "N*m*s",
    FORCE / LENGTH**2: "N/m^2",
}


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
        """A value with what it was written as."""
        made = cls(value)
        made.dimension, made.text = dimension, text
        return made


def fault_of_dimension(value: float, unit: str) -> str:
    """What is wrong where a number that was written with a unit stands for one of ``unit``, "" for any; "" where nothing is."""
    if not isinstance(value, Quantity) or not unit or value.dimension == (own := measure(1.0, unit).dimension):
        return ""
    return f"needs {described(own)}, got {described(value.dimension)}: {value.text}"


_NUMBER = rf"[-+]?{UNSIGNED}"
_FACTOR = r"[A-Za-z]+(?:(?:\^|\*\*)-?[0-9]{1,2})?"
_FACTORS = rf"{_FACTOR}(?:\s*[*/ ]\s*{_FACTOR})*"
_UNIT = rf"(?:1\s*/\s*)?{_FACTORS}"
_ZEROTH_POWER = re.compile(r"(?:\^|\*\*)-?0+(?![0-9])")
_MEASURE = re.compile(rf"\s*({_NUMBER})(?![eE](?![A-Za-z]))(?:\s*({_FACTORS})|\s+(1\s*/\s*{_FACTORS}))\s*")
MAX_UNIT_LENGTH = 40


def read_measure(text: str) -> Measure | None:
    """A number with a unit, such as "30 deg"; None when ``text`` is not of that form.

    Raises UnitError when the unit is unknown.
    """
    match = _MEASURE.fullmatch(text)
    return measure(float(match[1]), match[2] or match[3]) if match else None


def measure(value: float, unit: str) -> Measure:
    """``value`` in ``unit``, converted to SI.  Raises UnitError when the unit cannot be read."""
    unit = " ".join(unit.split())
    if unit == "1":
        return Measure(value, NONE, "1")
    if len(unit) > MAX_UNIT_LENGTH or not re.fullmatch(_UNIT, unit):
        raise UnitError(f"'{unit[:MAX_UNIT_LENGTH]}' is not a unit")
    if _ZEROTH_POWER.search(unit):
        raise UnitError(f"'{unit}' is not a unit: a power of zero has none")
    try:
        with np.errstate(all="ignore"):  # units of logarithms are converted by NumPy
            quantity = _registry().Quantity(value, unit).to_base_units()
    except (pint.PintError, ArithmeticError, AttributeError, TypeError, ValueError):
        raise UnitError(f"unknown unit '{unit}'") from None
    if not math.isfinite(quantity.magnitude):
        raise UnitError(f"'{value} {unit}' is out of range")
    dimension = _dimension(quantity)
    return Measure(float(quantity.magnitude), dimension, _si_text(unit, dimension))


def _dimension(quantity: Any) -> Dimension:
    exponents = quantity.dimensionality
    unknown = set(exponents) - set(_BASE)
    if unknown:
        raise UnitError(f"units of {', '.join(sorted(unknown))} have no place in a model")
    return Dimension(tuple(Fraction(exponents.get(name, 0)).limit_denominator(100) for name in _BASE))


def _si_text(unit: str, dimension: Dimension) -> str:
    """The user's own text when it is a unit of SI already, else the dimension's SI unit."""
    if _registry().Quantity(1.0, unit).to_base_units().magnitude == 1.0:
        return unit
    return "rad" if dimension == NONE else str(dimension)


@cache
def _registry() -> Any:
    return pint.UnitRegistry()
