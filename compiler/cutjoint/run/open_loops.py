"""Whether the loops of a run stand open by more than its steps explain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite

from cutjoint.run.results import Trajectory

#: A smaller gap, m or rad, is no reason for a warning.
_SMALL = 1e-6
#: Gaps of runs with other steps that differ by less than this factor do not come from the steps.
_SAME = 1.5


def find_open_loops(run: Trajectory, others: Sequence[Trajectory], errors: Mapping[str, float]) -> str:
    """What is wrong with the loops of a run, beside runs of the same with other steps and its ``errors`` by these; "" where nothing is.

    A gap that stays with other steps, as behind a guide whose rate jumps, is an error that all these runs share.
    """
    gap = run.effort.residuals.position
    told = max((error for name, error in errors.items() if run.units[name] == "m" and isfinite(error)), default=0.0)
    if not gap > max(_SMALL, told) or not any(_is_same(gap, other.effort.residuals.position) for other in others):
        return ""
    return (
        f"loops stand open by up to {gap:.2g} m or rad, with other steps too: errors of the steps do not see what that changes; "
        "the closure proximal closes them, as the integrators rk4 and dormand-prince do"
    )


def _is_same(gap: float, other: float) -> bool:
    return gap / _SAME < other < gap * _SAME
