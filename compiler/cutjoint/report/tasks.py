"""Reports of equilibria and of steps against the clock, as tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import floor, log10

import numpy as np
from rich.bar import Bar
from rich.table import Table

from cutjoint.model.quantities import POSE
from cutjoint.run.results import MechanismState
from cutjoint.tasks.realtime import StepTimes

# Equilibria

#: m and rad; smaller ones are rounding.
_NOTHING = 1e-12


def pose_table(state: MechanismState) -> Table:
    """The pose of each body, a row each."""
    table = Table(title="poses, m and rad", title_justify="left", box=None, pad_edge=False, collapse_padding=True)
    for heading in ("body", *POSE):
        table.add_column(heading, justify="left" if heading == "body" else "right")
    bodies = _posed(state)
    columns = [_decimals([state.values[f"{body}.{quantity}"] for body in bodies]) for quantity in POSE]
    for body, *numbers in zip(bodies, *columns, strict=True):
        table.add_row(body, *numbers)
    return table


def force_table(state: MechanismState) -> Table:
    """A table of all values except the poses of bodies, a row a quantity."""
    table = Table(title="forces", title_justify="left", box=None)
    for heading in ("element", "quantity", "value", "unit"):
        table.add_column(heading, justify="right" if heading == "value" else "left")
    bodies = _posed(state)
    for column, value in state.values.items():
        element, _, quantity = column.rpartition(".")
        if element not in bodies:
            table.add_row(element, quantity, f"{value + 0.0:.7g}", state.units[column])
    return table


def _decimals(values: Sequence[float]) -> list[str]:
    """Numbers with as many decimals as give the largest five digits, five at least."""
    largest = max(map(abs, values), default=0.0)
    decimals = max(5, 4 - floor(log10(largest))) if largest > _NOTHING else 5
    return [f"{round(value, decimals) + 0.0:.{decimals}f}" for value in values]


def _posed(state: MechanismState) -> list[str]:
    """The elements of which the whole pose is known."""
    elements = dict.fromkeys(column.rpartition(".")[0] for column in state.values)
    return [e for e in elements if all(f"{e}.{quantity}" in state.values for quantity in POSE)]


# Steps against the clock

_PERCENTILES = (50.0, 90.0, 99.0, 99.9)

#: Classes of the histogram that each power of ten has.
_CLASSES = 5


def time_tables(times: StepTimes) -> Iterator[Table]:
    """Percentiles and missed deadlines, and the histogram."""
    if times.took.size:
        yield _facts(times)
        yield _histogram(times)


def _facts(times: StepTimes) -> Table:
    table = Table(title="step times", title_justify="left", show_header=False, box=None)
    table.add_row("steps", f"{times.took.size}, {times.period * 1e3:g} ms apart")
    for share in _PERCENTILES:
        table.add_row(f"p{share:g}", _beside_the_period(times.percentile(share), times.period))
    table.add_row("largest", _beside_the_period(float(times.took.max()), times.period))
    latest = f", by {_short(float(times.late.max()))} at most" if times.missed else ""
    table.add_row("missed deadlines", f"{times.missed}{latest}")
    return table


def _beside_the_period(seconds: float, period: float) -> str:
    return f"{_short(seconds)}, {100 * seconds / period:.2g} % of the step"


def _short(seconds: float) -> str:
    return f"{seconds * 1e6:.3g} us" if seconds < 1e-3 else f"{seconds * 1e3:.3g} ms"


def _histogram(times: StepTimes) -> Table:
    """Classes of equal width on a logarithmic scale; bars by the number's logarithm, so that single late steps show."""
    classes = np.floor(_CLASSES * np.log10(np.maximum(times.took, 1e-9))).astype(int)
    counts = np.bincount(classes - classes.min())
    table = Table(title="histogram", title_justify="left", box=None)
    for heading in ("from", "to", "steps"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("(logarithmic)", width=40)
    for i, count in enumerate(counts):
        low, high = (_short(10 ** ((classes.min() + i + k) / _CLASSES)) for k in (0, 1))
        table.add_row(low, high, str(count), Bar(float(np.log(1 + counts.max())), 0, float(np.log(1 + count))))
    return table
