"""Reductions beside closed forms and plain loops over single runs."""

from __future__ import annotations

from math import isnan, pi, sqrt

import numpy as np
import pytest

from cutjoint.sweeps.objectives import reduce_series
from cutjoint.sweeps.records import Objective

STEP = 1e-3
#: Two seconds and a row more.
TIMES = np.arange(2001) * STEP
#: A wave of 3 Hz with an amplitude of 2 about 5, and a line from -1 upwards.
WAVE, LINE = 5 + 2 * np.sin(2 * pi * 3 * TIMES), -1 + TIMES


def reduce_one(reduction: str, series: np.ndarray, **how: float | str) -> float:
    """The reduction of one run."""
    objective = Objective(name="x", reduction=reduction, series=0, **how)  # type: ignore[arg-type]
    return float(reduce_series(objective, series[np.newaxis], TIMES, STEP)[0])


@pytest.mark.parametrize(
    ("reduction", "series", "how", "expected", "error"),
    [
        ("end", LINE, {}, 1.0, 1e-12), ("end", LINE, {"end": 0.5}, -0.5, 1e-12),
        ("minimum", WAVE, {}, 3.0, 1e-4), ("maximum", WAVE, {}, 7.0, 1e-4), ("range", WAVE, {}, 4.0, 2e-4),
        ("range", WAVE, {"factor": 1e3}, 4000.0, 0.2), ("crossing", LINE, {"at": 0.25, "factor": 1e3}, 1250.0, 1e-9),
        ("maximum", LINE, {"begin": 0.2, "end": 0.7}, -0.3, 1e-12), ("minimum", LINE, {"begin": 0.2}, -0.8, 1e-12),
        ("mean", LINE, {}, 0.0, 1e-12), ("mean", LINE, {"begin": 1.0}, 0.5, 1e-12),
        ("rms", LINE, {}, sqrt(1 / 3), 1e-3), ("deviation", WAVE, {}, sqrt(2), 1e-3),  # means of rows: a row in 2000 counts too much
        ("integral", LINE, {"begin": 1.0}, 0.5, 1e-12), ("integral", WAVE, {}, 10.0, 1e-9),  # the trapezoidal rule is exact on a line
        ("percentile", LINE, {"at": 75.0}, 0.5, 1e-12), ("percentile", LINE, {"at": 50.0}, 0.0, 1e-12),
        ("crossing", LINE, {"at": 0.25}, 1.25, 1e-12),
        ("crossing", WAVE, {"at": 5.0, "direction": "down"}, 1 / 6, 4e-7),  # of a line for the wave: step^3 (2 pi 3)^2
        ("crossing", WAVE, {"at": 5.0, "direction": "up"}, 1 / 3, 4e-7),
        ("crossing", WAVE, {"at": 5.0, "begin": 0.2}, 1 / 3, 4e-7),
        ("frequency", WAVE, {}, 3.0, 2e-3), ("amplitude", WAVE, {}, 2.0, 2e-2),  # lines are 0.5 Hz apart, 3 Hz is the sixth but for a row
    ],
)  # fmt: skip
def test_closed_forms(reduction: str, series: np.ndarray, how: dict[str, float], expected: float, error: float) -> None:
    assert abs(reduce_one(reduction, series, **how) - expected) <= error


def test_what_has_no_value() -> None:
    assert isnan(reduce_one("crossing", LINE, at=3.0))
    assert isnan(reduce_one("crossing", LINE, at=0.0, direction="down"))
    assert isnan(reduce_one("end", LINE, begin=2.5))


@pytest.mark.parametrize("rows", [1, 2, 3, 7, 129, 1000, 9001])
def test_a_run_alone_has_the_same_bits(rows: int) -> None:
    random = np.random.default_rng(rows)
    series, times = random.standard_normal((23, rows)), np.arange(rows) * STEP
    for reduction in ("mean", "rms", "deviation", "integral", "percentile", "crossing", "frequency", "amplitude", "range"):
        objective = Objective(name="x", reduction=reduction, series=0, at=40.0 if reduction == "percentile" else 0.1)
        together = reduce_series(objective, series, times, STEP)
        for size in (1, 4):
            parts = [reduce_series(objective, series[i : i + size], times, STEP) for i in range(0, len(series), size)]
            assert np.concatenate(parts).tobytes() == together.tobytes(), reduction
