"""Timing: a run to warm up, repetitions, the largest step that converges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import median, quantiles

import numpy as np

from cutjoint.package.errors import RunError
from cutjoint.run.simulator import SimulatorError
from cutjoint_bench.errors import measure_errors
from cutjoint_bench.records import Case, Point, Runner
from cutjoint_bench.reference import Reference
from cutjoint_bench.steps import common_step, exact


def measure_point(
    case: Case, name: str, runner: Runner, dt: float, reference: Reference | None, repetitions: int, *, patience: float = 10.0
) -> Point:
    """A contender at one step.  The first run warms up and is measured against the reference; only others are timed, of slow ones fewer.

    ``patience`` (s) is how long all repetitions together may take.
    """
    try:
        first = runner(dt, measured=True)
    except (SimulatorError, RunError) as error:
        return Point(contender=name, dt=dt, failure=str(error), reached=0.0)
    point = Point(contender=name, dt=dt, steps=first.steps, iterations=first.statistics.iterations)
    if reference is not None:
        point = replace(point, errors=measure_errors(case, first, reference))
    if first.failure is not None:
        return replace(point, failure=str(first.failure), reached=first.failure.time)
    seconds: list[float] = []
    while len(seconds) < repetitions and sum(seconds) < patience:
        seconds.append(runner(dt).seconds)
    return replace(point, seconds=tuple(seconds), reached=case.scene.end)


#: A run is wrong whose error of position is above this share of the extent of the motion.
WRONG = 0.1


def largest_step(case: Case, runner: Runner, reference: Reference | None, *, low: float, high: float) -> float:
    """The largest step (s) up to which a contender converges, by bisection among `shared_steps` between two limits.

    It converges when every step of a run does and the error of position stays below ``WRONG`` of the motion's extent.  Returns 0 where
    not even the smallest does.
    """
    steps = shared_steps(case, low, high)
    good, bad = -1, len(steps)
    while bad - good > 1:
        middle = (good + bad) // 2 if good >= 0 else 0
        if _converges(case, runner, reference, steps[middle]):
            good = middle
        elif middle == 0:
            return 0.0
        else:
            bad = middle
    return steps[good] if good >= 0 else 0.0


def shared_steps(case: Case, low: float, high: float) -> list[float]:
    """Steps of which a run has at least four rows in common with the case: tenths of its rows' distance, and whole fractions of that."""
    row, end = exact(case.scene.output_step), case.scene.end
    steps = [float(row / n) for n in range(2000, 10, -1)] + [float(row * n / 10) for n in range(1, 2000)]
    return [s for s in steps if low <= s <= high and common_step(s, float(row)) <= end / 4]


def _converges(case: Case, runner: Runner, reference: Reference | None, dt: float) -> bool:
    try:
        run = runner(dt)
    except SimulatorError:
        return False
    if run.failure is not None or reference is None:
        return run.failure is None
    return bool(measure_errors(case, run, reference).position <= WRONG * extent(reference))


def extent(reference: Reference) -> float:
    """The largest distance in m of any body from where it starts."""
    names = {c.rpartition(".")[0] for c in reference.columns}
    bodies = [name for name in names if all(f"{name}.{x}" in reference.columns for x in "xyz")]
    ways = (sum((reference.columns[f"{b}.{x}"] - reference.columns[f"{b}.{x}"][0]) ** 2 for x in "xyz") for b in sorted(bodies))
    return float(max(np.sqrt(way).max() for way in ways))


def spread(seconds: Sequence[float]) -> tuple[float, float]:
    """The median and half the distance between the quartiles."""
    if len(seconds) < 2:
        return median(seconds), 0.0
    low, _, high = quantiles(seconds, n=4)
    return median(seconds), (high - low) / 2
