"""Whether the work and energy of a run balance as well as its steps explain."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.run.results import EnergyBalance, Trajectory

#: A defect that is a smaller share of the energy in a run is none: iterations and penalties leave as much.
_SMALL = 1e-3
#: What steps explain is at most so many times the change by finer or coarser ones.
_EXPLAINED = 10.0


def find_imbalance(run: Trajectory, others: Sequence[Trajectory]) -> str:
    """What is wrong with the balance of a run, beside runs of the same with other steps; "" where nothing is.

    The defect of exact steps is zero, so that the change by other steps is an estimate of it.  What stays is no error of the steps.
    """
    balances = [other.energy for other in others if other.energy is not None]
    if run.energy is None or not balances or not run.energy.share > _SMALL:
        return ""
    change = max(abs(run.energy.defect - other.defect) for other in balances)
    return _imbalance(run.energy, change) if run.energy.defect > _EXPLAINED * change else ""


def _imbalance(energy: EnergyBalance, change: float) -> str:
    return (
        f"work and energy differ by {energy.defect:.2g} J, of {energy.kinetic + energy.exchanged:.2g} J in all, and with other steps by "
        f"{change:.1g} J more or less: not the steps but what holds the loops, or a guide that jumps, does work that it should not; "
        "errors of the steps do not see it"
    )
