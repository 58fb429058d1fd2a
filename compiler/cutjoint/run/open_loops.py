"""The gap of a run's loops, beside the gap that its steps explain."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.run.results import Trajectory

#: A smaller gap, m or rad, is no reason for a warning.
_SMALL = 1e-6
#: Gaps of runs with other steps that differ by less than this factor do not come from the steps.
_SAME = 1.5

_COUNTED = "the errors count it"
_UNSEEN = "errors of the steps do not see what that changes"


def find_open_gap(run: Trajectory, others: Sequence[Trajectory]) -> float:
    """The largest gap (m or rad) of the loops of a run where runs of the same with other steps have it too; 0 where they do not.

    It is an error that all these runs share, as behind a guide whose rate jumps.
    """
    gap = run.effort.residuals.position
    return gap if gap > _SMALL and any(_is_same(gap, other.effort.residuals.position) for other in others) else 0.0


def open_loops(gap: float, *, is_known: bool) -> str:
    """The warning of such a gap; ``is_known`` tells that the errors of the run include its effect."""
    known = f"a run with error control, whose loops are closed, shows what that changes, and {_COUNTED}" if is_known else _UNSEEN
    return f"loops stand open by up to {gap:.2g} m or rad, with other steps too: {known}; the closure proximal closes them"


def _is_same(gap: float, other: float) -> bool:
    return gap / _SAME < other < gap * _SAME
