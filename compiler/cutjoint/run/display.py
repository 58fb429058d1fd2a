"""Results in units for display, in plots and pages; result files keep the units of the model."""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from cutjoint.model.expressions.units import Measure, UnitError, measure
from cutjoint.package.errors import RunError
from cutjoint.run.results import Array

#: Units of one dimension that measure different quantities: angles and numbers, energies and torques, frequencies.
_KINDS = (re.compile(r"rad|deg|turn|rev|rpm|arc|grad"), re.compile(r"J|Wh|cal"), re.compile(r"Hz"))
#: Euler angles of bodies, which jump by a turn.
_WRAPPED = (".yaw", ".roll")


def _kind(unit: str) -> tuple[bool, ...]:
    return tuple(bool(kind.search(unit)) for kind in _KINDS)


def read_units(wanted: Sequence[str]) -> Mapping[str, Measure]:
    """The size and dimension of units for display.
    Raises RunError: a unit is unknown, has an offset, or measures what an earlier one does.
    """
    found: dict[str, Measure] = {}
    for unit in wanted:
        try:
            one = measure(1.0, unit)
            if measure(0.0, unit).value:
                raise UnitError(f"'{unit}' has an offset")
        except UnitError as error:
            raise RunError(f"--display: {error}") from None
        if rivals := [u for u, other in found.items() if other.dimension == one.dimension and _kind(u) == _kind(unit)]:
            raise RunError(f"--display: '{rivals[0]}' and '{unit}' are units of one quantity; name one of them")
        found[unit] = one
    return found


def in_units(columns: Mapping[str, Array], units: Mapping[str, str], wanted: Sequence[str]) -> tuple[dict[str, Array], dict[str, str]]:
    """Columns (samples,) and their units, converted to the ``wanted`` units of their quantities; attitudes of bodies are continuous.
    Raises RunError: as for `read_units`.
    """
    found, converted, names = read_units(wanted), dict(columns), dict(units)
    for name, unit in units.items():
        if unit == "rad" and name.endswith(_WRAPPED):
            converted[name] = np.unwrap(converted[name])
        for other, one in found.items():
            if _fits(one, other, unit):
                converted[name], names[name] = converted[name] * (measure(1.0, unit or "1").value / one.value), other
    return converted, names


def unused_units(units: Iterable[str], wanted: Sequence[str]) -> list[str]:
    """The ``wanted`` units whose quantity none of ``units`` has. Raises RunError: as for `read_units`."""
    return [other for other, one in read_units(wanted).items() if not any(_fits(one, other, unit) for unit in units)]


def _fits(one: Measure, other: str, unit: str) -> bool:
    return one.dimension == measure(1.0, unit or "1").dimension and _kind(other) == _kind(unit)
