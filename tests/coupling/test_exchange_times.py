"""Times of exchanges are found as a run needs them, and steps that are hardly meant are questioned before it begins."""

from __future__ import annotations

import tracemalloc
from fractions import Fraction
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from cutjoint.coupling.run import Plan, _exchange_times, _times, co_simulate
from cutjoint.package.errors import RunError


def _plan(end: float, output_step: float, *steps: float) -> Plan:
    fmu = cast(Any, SimpleNamespace(path=Path("a.fmu")))
    parties = [SimpleNamespace(step=step, fmu=fmu) for step in steps]
    return cast(Plan, SimpleNamespace(end=end, output_step=output_step, parties=parties, step=min(steps)))


@pytest.mark.parametrize(
    ("end", "row", "steps"), [("1", "0.1", ("0.01",)), ("0.35", "0.1", ("0.02", "0.03")), ("0.3", "0.7", ("0.1", "0.25"))]
)
def test_the_times_are_those_of_exact_fractions(end: str, row: str, steps: tuple[str, ...]) -> None:
    """Whole multiples of decimal numbers, which doubles have to a rounding."""
    last = Fraction(end)
    rows = {i * Fraction(row) for i in range(int(last / Fraction(row)) + 1)} | {last}
    exchanges = {i * Fraction(step) for step in steps for i in range(1, int(last / Fraction(step)) + 1)}
    plan = _plan(float(end), float(row), *map(float, steps))
    expected = sorted(rows | exchanges)
    found = list(_times(plan))
    assert [time for time, _ in found] == pytest.approx([float(time) for time in expected], abs=1e-12)
    assert [is_row for _, is_row in found] == [time in rows for time in expected]
    assert len(list(_exchange_times(plan))) == len(exchanges)


def test_memory_does_not_grow_with_the_number_of_exchanges() -> None:
    plan = _plan(1.0, 0.01, 1e-9, 3e-7)
    tracemalloc.start()
    try:
        assert len(list(islice(_times(plan), 1000))) == 1000
        assert tracemalloc.get_traced_memory()[1] < 1e6
    finally:
        tracemalloc.stop()


def test_a_step_that_is_hardly_meant_is_questioned() -> None:
    with pytest.raises(RunError, match=r"a\.fmu: steps of communication of 1e-12 s are 1\.0e\+12 exchanges to 1 s; say"):
        co_simulate(_plan(1.0, 0.01, 0.1, 1e-12))
