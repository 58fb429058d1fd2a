"""Reductions of series: from rows over time to one number for each run.

Each run's numbers depend on its own rows only, whichever runs share its chunk: sums are along the last axis, which is contiguous.
"""

from collections.abc import Callable, Mapping

import numpy as np

from cutjoint.sweeps.records import Array, Objective


def reduce_series(objective: Objective, series: Array, times: Array, row_step: float) -> Array:
    """An objective (runs,) of a series (runs, rows) at equally spaced times (rows,), s, in its unit; NaN where it has no value."""
    rounding = 1e-9 * row_step
    inside = np.flatnonzero((times >= objective.begin - rounding) & (times <= objective.end + rounding))
    if not inside.size:
        return np.full(len(series), np.nan)
    first, last = inside[0], inside[-1] + 1
    window = np.ascontiguousarray(series[:, first:last])
    return objective.factor * _REDUCTIONS[objective.reduction](objective, window, float(times[first]), row_step)


def _rms(window: Array) -> Array:
    return np.asarray(np.sqrt((window * window).mean(axis=-1)))


def _without_mean(window: Array) -> Array:
    return np.asarray(window - window.mean(axis=-1, keepdims=True))


def _crossing(objective: Objective, window: Array, begin: float, step: float) -> Array:
    """The first time at which a series crosses a level from below or above, by linear interpolation between rows."""
    before, after, level = window[:, :-1], window[:, 1:], objective.at
    up, down = (before < level) & (after >= level), (before > level) & (after <= level)
    crosses = {"up": up, "down": down, "any": up | down}[objective.direction]
    if not crosses.shape[1]:
        return np.full(len(window), np.nan)
    place, run = crosses.argmax(axis=1), np.arange(len(window))
    low, high = before[run, place], after[run, place]
    with np.errstate(all="ignore"):
        time = begin + (place + (level - low) / (high - low)) * step
    return np.where(crosses[run, place], time, np.nan)


def _spectrum(window: Array) -> tuple[Array, Array]:
    """The largest line of a spectrum without the mean, by a Hann window: its index and amplitude."""
    if window.shape[1] < 4:
        return np.full(len(window), np.nan), np.full(len(window), np.nan)
    weights = np.hanning(window.shape[1])
    lines = np.abs(np.fft.rfft(_without_mean(window) * weights, axis=-1))[:, 1:]
    place, run = lines.argmax(axis=1), np.arange(len(window))
    return place + 1.0, 2 * lines[run, place] / weights.sum()


_REDUCTIONS: Mapping[str, Callable[[Objective, Array, float, float], Array]] = {
    "end": lambda o, w, t, h: w[:, -1],
    "minimum": lambda o, w, t, h: w.min(axis=-1),
    "maximum": lambda o, w, t, h: w.max(axis=-1),
    "range": lambda o, w, t, h: w.max(axis=-1) - w.min(axis=-1),
    "mean": lambda o, w, t, h: w.mean(axis=-1),
    "rms": lambda o, w, t, h: _rms(w),
    "deviation": lambda o, w, t, h: _rms(_without_mean(w)),
    "integral": lambda o, w, t, h: (w.sum(axis=-1) - (w[:, 0] + w[:, -1]) / 2) * h,
    "percentile": lambda o, w, t, h: np.asarray(np.percentile(w, o.at, axis=-1)),
    "crossing": _crossing,
    "frequency": lambda o, w, t, h: _spectrum(w)[0] / (w.shape[1] * h),
    "amplitude": lambda o, w, t, h: _spectrum(w)[1],
}
