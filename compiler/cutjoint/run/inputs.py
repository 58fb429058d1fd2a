"""Inputs of a run that replace the scene's laws: constants, and tables over time."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.formulate.inputs import input_parameters
from cutjoint.model.expressions.units import fault_of_dimension
from cutjoint.model.ranges import fault_of
from cutjoint.model.records import Model, Parameter, Scene
from cutjoint.package.errors import RunError, plural

#: A constant, or a table: times ``t`` (s) and as many of ``value``, ``interpolation`` "cubic" (the default) or "linear", and for cubic ones
#: the ``rate`` at each time where it is known.
InputLike: TypeAlias = float | Mapping[str, Any]

_SERIES = ("t", "value", "rate")
INTERPOLATIONS = ("cubic", "linear")


def input_entries(model: Model, scene: Scene, values: Mapping[str, InputLike]) -> dict[str, Any]:
    """The entry "inputs" of a run file, by name; inputs that are not given follow the scene.  Values are in SI units.

    An input is a number, or a table with times "t" and as many of "value", between which it is "interpolation" "cubic" (the default;
    through the given "rate" if there is one) or "linear". Raises RunError: a name is no input, a value is not finite, or a table is
    inconsistent or shorter than the scene.
    """
    names = [p.name for p in input_parameters(model)]
    for name in values:
        if name not in names:
            raise RunError(f"model '{model.name}' has no input '{name}'; it has {', '.join(names) or 'none'}")
    found = {name: (f"input '{name}'", values[name]) for name in names if name in values}
    return {n: _as_read(w, read_table(w, x, 0.0, scene.end)) if isinstance(x, Mapping) else _number(w, x) for n, (w, x) in found.items()}


def _as_read(what: str, table: dict[str, Any]) -> dict[str, Any]:
    """The table with the rates that a simulator needs for cubics."""
    if table["interpolation"] == "linear" or "rate" in table:
        return table
    with np.errstate(over="ignore", invalid="ignore"):
        rate = rates_at(np.array(table["t"]), np.array(table["value"]))
    if not np.isfinite(rate).all():
        raise RunError(f"{what}: values change too fast for a number; leave out times that are nearly equal")
    return {**table, "rate": rate.tolist()}


def rates_at(t: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rates at the times of a table, from parabolas through neighbouring values; at the ends of the adjacent parabola."""
    length = np.diff(t)
    slope = np.diff(values) / length
    if len(slope) == 1:
        return np.repeat(slope, 2)
    inner = (length[1:] * slope[:-1] + length[:-1] * slope[1:]) / (length[:-1] + length[1:])
    return np.concatenate([2 * slope[:1] - inner[:1], inner, 2 * slope[-1:] - inner[-1:]])


def read_table(what: str, values: Mapping[str, Any], start: float, end: float) -> dict[str, Any]:
    """A table over time as a run file has it, of a run between two times (s).
    Raises RunError: it is inconsistent, or shorter than the run."""
    if unknown := [key for key in values if key not in (*_SERIES, "interpolation")]:
        raise RunError(f"{what}: unknown key '{unknown[0]}'; a table has t, value, and perhaps rate and interpolation")
    if missing := [key for key in ("t", "value") if key not in values]:
        raise RunError(f"{what}: the table has no '{missing[0]}'; give as many values as times")
    table = {key: _numbers(f"{what}: {key}", values[key]) for key in _SERIES if key in values}
    _require_table(what, table, start, end)
    kind = values.get("interpolation", INTERPOLATIONS[0])
    if kind not in INTERPOLATIONS:
        raise RunError(f"{what}: interpolation '{kind}' is not one of {', '.join(INTERPOLATIONS)}")
    if kind == "linear" and "rate" in table:
        raise RunError(f"{what}: a linear table has no rates of its own; leave out rate, or make it cubic")
    return {**table, "interpolation": kind}


def constant_inputs(model: Model, changes: Mapping[str, float]) -> dict[str, float]:
    """The inputs among ``changes``, by name, as constants. Raises RunError: one has a unit that is not that of the input."""
    held = {p.name: (p, changes[p.name]) for p in input_parameters(model) if p.name in changes}
    for parameter, value in held.values():
        require_unit(parameter, value)
    return {name: value for name, (_, value) in held.items()}


def require_unit(parameter: Parameter, value: float) -> None:
    """Check that a value that was written with a unit fits a parameter; RunError if not."""
    if fault := fault_of_dimension(value, parameter.unit):
        raise RunError(f"{parameter.span}: parameter '{parameter.name}' {fault}")


def with_constant_inputs(model: Model, scene: Scene, parameters: Mapping[str, float]) -> tuple[Scene, dict[str, float]]:
    """The scene with the inputs among ``parameters`` (SI units) as constant laws, and the remaining parameters."""
    held = constant_inputs(model, parameters)
    others = {name: value for name, value in parameters.items() if name not in held}
    return replace(scene, inputs={**scene.inputs, **{name: sympy.Float(value) for name, value in held.items()}}), others


def _require_table(what: str, table: Mapping[str, Sequence[float]], start: float, end: float) -> None:
    times = table["t"]
    if len(times) < 2:
        raise RunError(f"{what}: {plural(len(times), 'time')}; a table has two or more, a constant is a number")
    for key in table:
        if len(table[key]) != len(times):
            raise RunError(f"{what}: {plural(len(times), 'time')} and {len(table[key])} of '{key}'; give one for each time")
    for earlier, later in pairwise(times):
        if not earlier < later:
            raise RunError(f"{what}: t = {later:g} s stands after {earlier:g} s; put the times in ascending order, each once")
    if times[0] > start or times[-1] < end:
        has, needs = f"from {times[0]:g} s to {times[-1]:g} s", f"from {start:g} to {end:g} s"
        raise RunError(f"{what}: the table covers {has}, the run {needs}; extend the table")


def _numbers(what: str, values: Any) -> list[float]:
    if isinstance(values, str) or not hasattr(values, "__iter__"):
        raise RunError(f"{what}: not a list of numbers")
    if isinstance(values, np.ndarray) and values.ndim == 1 and values.dtype == np.float64 and np.isfinite(values).all():
        return list(values.tolist())  # as below, in a hundredth of the time
    return [_number(f"{what}[{i}]", value) for i, value in enumerate(values)]


def _number(what: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise RunError(f"{what}: '{value}' is not a number") from None
    if fault := fault_of(number):
        raise RunError(f"{what}: {fault}")
    return number
