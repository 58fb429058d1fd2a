"""Checks that the equations of a model can be solved at all."""

from __future__ import annotations

from cutjoint.analysis.guides import require_guides
from cutjoint.analysis.inertia import require_inertia
from cutjoint.formulate.records import RecursiveEquations


def require_soundness(equations: RecursiveEquations) -> RecursiveEquations:
    """The equations, unless a motion moves no mass or guides tear a loop open.

    Raises:
        NoInertiaError, GuideError: as of `require_inertia` and `require_guides`.
    """
    require_inertia(equations)
    require_guides(equations)
    return equations
