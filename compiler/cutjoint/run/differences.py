"""Differences of two runs of the same, and whether they fall from steps to finer ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import copysign

import numpy as np

from cutjoint.run.results import Array, NearJump, Trajectory

#: Differences of runs fall at least by this factor, from steps to finer ones, where the steps are what is wrong with them.
_FALLING = 1.5
#: Differences that are this share of what an output reaches are small even where they fall no further.
_SMALL = 1e-5
#: Differences below this share of what outputs of the unit reach are rounding, as of what is zero by symmetry.
_ROUNDING = 1e-8
#: The error of a jump's time is at most so many times what two runs differ by.
_LATE = 1.5


def differences(jumps: Sequence[float], one: Trajectory, other: Trajectory) -> dict[str, float]:
    """The largest difference of each column over the times that both runs have rows of, but for those at which something jumps."""
    tick = 1e-6 * float(one.t[-1] - one.t[0]) / one.t.size or 1.0
    times, here, there = np.intersect1d(np.rint(one.t / tick), np.rint(other.t / tick), return_indices=True)
    smooth = ~np.isin(times, np.rint(np.asarray(jumps, dtype=float) / tick))
    gaps = {name: np.abs(one[name][here] - other[name][there])[smooth] for name in one.columns}
    return {name: float(np.max(gap, initial=0.0)) for name, gap in gaps.items()}


def all_fall(run: Trajectory, before: Mapping[str, float], after: Mapping[str, float]) -> bool:
    """True where all differences fall from steps to finer ones, or are rounding beside what outputs of their unit reach."""
    reach: dict[str, float] = {}
    for name, values in run.columns.items():
        reach[run.units[name]] = max(reach.get(run.units[name], 0.0), float(np.max(np.abs(values), initial=0.0)))
    return all(after[c] <= _ROUNDING * reach[run.units[c]] or falls(run.columns[c], before[c], after[c]) for c in after)


def falls(values: Array, before: float, after: float) -> bool:
    size = float(np.max(np.abs(values)))
    return after <= max(before / _FALLING, _SMALL * size)


def defect_left(before: Trajectory, after: Trajectory) -> float:
    """The share of the defect of work and energy that finer steps leave, by two runs of the same; 1 where nothing shows it."""
    if before.energy is None or after.energy is None or not before.energy.defect > 0:
        return 1.0
    share = after.energy.defect / before.energy.defect
    return share if share < 1.0 else 1.0


def uncertain_jumps(run: Trajectory, other: Trajectory, within: float) -> dict[str, float]:
    """The largest jump of each column beside a row of a run that may stand on its other side, by another run of the same with other steps.

    Jumps are looked for ``within`` a time (s) of rows; one that the other run has not there is at least as far away.
    """
    found: dict[str, float] = {}
    for jump in run.near_jumps:
        late = _LATE * abs(jump.after - _after(other, jump, within))
        if abs(jump.after) <= late:
            found[jump.column] = max(found.get(jump.column, 0.0), jump.size)
    return found


def _after(run: Trajectory, sought: NearJump, within: float) -> float:
    """The time (s) after the same row a run has the jump."""
    same = (jump for jump in run.near_jumps if jump.column == sought.column and abs(jump.time - sought.time) < within)
    found = next(same, None)
    return copysign(within, sought.after) if found is None else found.after
