"""Checks of a run: its balance of work and energy, and the gap of its loops, beside the differences that its steps explain."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.run.results import EnergyBalance, Trajectory

# Energy

#: A smaller share of the energy in a run is no reason for a warning.
_SMALL = 1e-3
#: A mechanism whose energy is that of a smaller speed (m/s, rad/s) rests: a start at rest may accelerate by as much in a second, and the
#: absolute tolerance of steps is this by default.
_REST = 1e-6
#: Steps explain so many times the change by one other run, whose defect may be the same by chance, and by more runs.
_EXPLAINED_BY_ONE, _EXPLAINED = 100.0, 10.0


def find_imbalance(run: Trajectory, others: Sequence[Trajectory]) -> str:
    """The fault in the balance of a run, beside runs of the same with other steps; "" without one.

    The defect of exact steps is zero, so that the change by other steps is an estimate of it.  The rest is no error of the steps.
    """
    balances = [other.energy for other in others if other.energy is not None and other.failure is None]
    if run.energy is None or not balances or not run.energy.share > _SMALL:
        return ""
    if run.energy.kinetic + run.energy.exchanged < run.energy.of_unit_speed * _REST**2:
        return ""
    change = max(abs(run.energy.defect - other.defect) for other in balances)
    explained = change * (_EXPLAINED_BY_ONE if len(balances) == 1 else _EXPLAINED)
    return _imbalance(run.energy, change) if run.energy.defect > explained else ""


def _imbalance(energy: EnergyBalance, change: float) -> str:
    return (
        f"work and energy differ by {energy.defect:.2g} J, of {energy.kinetic + energy.exchanged:.2g} J in all, and with other steps by "
        f"{change:.1g} J more or less: not the steps but what holds the loops, or a guide that jumps, does work that it should not; "
        "errors of the steps do not see it"
    )


# Loops

#: A smaller gap, m or rad, is no reason for a warning.
_SMALL_GAP = 1e-6
#: Gaps of runs with other steps that differ by less than this factor do not come from the steps.
_SAME = 1.5

_COUNTED = "the errors count it"
_UNSEEN = "errors of the steps do not see what that changes"


def find_open_gap(run: Trajectory, others: Sequence[Trajectory]) -> float:
    """The largest gap (m or rad) of the loops of a run where runs of the same with other steps have it too; 0 where they do not.

    It is an error that all these runs share, as behind a guide whose rate jumps.
    """
    gap = run.effort.residuals.position
    return gap if gap > _SMALL_GAP and any(_is_same(gap, other.effort.residuals.position) for other in others) else 0.0


def open_loops(gap: float, *, is_known: bool) -> str:
    """The warning of such a gap; ``is_known`` tells that the errors of the run include its effect."""
    known = f"a run with error control, whose loops are closed, shows what that changes, and {_COUNTED}" if is_known else _UNSEEN
    return f"loops stand open by up to {gap:.2g} m or rad, with other steps too: {known}; the closure proximal closes them"


def _is_same(gap: float, other: float) -> bool:
    return gap / _SAME < other < gap * _SAME
