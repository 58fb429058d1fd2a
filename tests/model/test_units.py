"""Units that are known without pint are what pint says."""

import math
from random import Random
from typing import Any

import pint
import pytest

from cutjoint.model.expressions import units
from cutjoint.model.expressions.units import UnitError, measure

REGISTRY: Any = pint.UnitRegistry()
NAMES = (
    "kg", "g", "t", "m", "km", "dm", "cm", "mm", "s", "ms", "min", "h", "Hz", "N", "kN", "MN", "J", "kJ", "W", "kW", "Pa", "kPa", "MPa",
    "bar", "rad", "mrad", "deg",
)  # fmt: skip


COMPOSED = ("N/m", "kN/mm", "N*s/m", "N s/m", "kN*s/m", "N*m/deg", "deg/s", "rad/s^2", "kg*m^2", "kg*mm**2", "1/s")


@pytest.mark.parametrize("unit", NAMES + COMPOSED)
def test_common_units_have_the_bits_of_pint(unit: str) -> None:
    for value in (1.0, 30.0, -0.1, 1 / 3):
        expected = REGISTRY.Quantity(value, unit).to_base_units()
        assert measure(value, unit).value == float(expected.magnitude)


def test_products_and_powers_of_common_units_are_those_of_pint() -> None:
    random = Random(1)
    for _ in range(1000):
        first, *others = random.choices(NAMES, k=random.choice((1, 2, 3)))
        text = first + random.choice(("", "^2", "**3", "^-1"))
        text += "".join(random.choice(("*", "/", " ", " / ")) + x + random.choice(("", "^2", "^-1")) for x in others)
        value, expected = measure(2.5, text), REGISTRY.Quantity(2.5, text).to_base_units()
        assert math.isclose(value.value, expected.magnitude, rel_tol=2e-15)  # pint's powers of powers of ten are a little off
        assert value.dimension == units._dimension(expected)


@pytest.mark.parametrize("unit", ["MN^99*MN^99", "kN^99*kN^10"])
def test_a_size_without_a_float_is_out_of_range(unit: str) -> None:
    with pytest.raises(UnitError, match="out of range"):
        measure(1.0, unit)


@pytest.mark.parametrize(("written", "meant"), [("Nm", "N*m"), ("kNm", "kN*m"), ("mNm/deg", "N*mm/deg"), ("Nm/A", "N*m/A"),
                                                ("Nms", "N*m*s"), ("kNms/rad", "kN*m*s/rad")])  # fmt: skip
def test_a_newton_metre_may_be_written_in_one_word(written: str, meant: str) -> None:
    """Pint's own Nm is a unit of yarns: 1000 m/kg."""
    found, expected = measure(3.0, written), measure(3.0, meant)
    assert math.isclose(found.value, expected.value, rel_tol=1e-15)
    assert found.dimension == expected.dimension
