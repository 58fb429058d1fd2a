"""Results in units for display, in plots, pages and printed tables; result files keep the units of the model."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cutjoint.model.expressions.units import Measure, UnitError, display_units, kind_of_unit, measure
from cutjoint.package.errors import RunError
from cutjoint.run.results import WRAPPED


def read_units(wanted: Sequence[str]) -> Mapping[str, Measure]:
    """The size and dimension of units for display.
    Raises RunError: a unit is unknown, has an offset, or measures what an earlier one does."""
    try:
        return display_units(wanted)
    except UnitError as error:
        raise RunError(f"--display: {error}") from None


def in_units(columns: Mapping[str, Any], units: Mapping[str, str], wanted: Sequence[str]) -> tuple[dict[str, Any], dict[str, str]]:
    """Columns (samples,) or numbers and their units, converted to ``wanted`` units of their quantities; attitudes of bodies are continuous.
    Raises RunError: as for `read_units`."""
    found, converted, names = read_units(wanted), dict(columns), dict(units)
    for name, unit in units.items():
        if unit == "rad" and name.endswith(WRAPPED) and np.ndim(converted[name]):
            converted[name] = np.unwrap(converted[name])
        for other, one in found.items():
            if _fits(one, other, unit):
                converted[name], names[name] = converted[name] * (measure(1.0, unit or "1").value / one.value), other
    return converted, names


def unused_units(units: Iterable[str], wanted: Sequence[str]) -> list[str]:
    """The ``wanted`` units whose quantity none of ``units`` has. Raises RunError: as for `read_units`."""
    return [other for other, one in read_units(wanted).items() if not any(_fits(one, other, unit) for unit in units)]


def _fits(one: Measure, other: str, unit: str) -> bool:
    return one.dimension == measure(1.0, unit or "1").dimension and kind_of_unit(other) == kind_of_unit(unit)
