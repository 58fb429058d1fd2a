"""Times of steps for people."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.bar import Bar
from rich.table import Table

from cutjoint.realtime import StepTimes

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
