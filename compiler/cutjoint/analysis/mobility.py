"""Degrees of freedom: the rank of the cut joints' equations, in the design position and around it; models without a solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cutjoint.analysis.guides import require_guides
from cutjoint.analysis.inertia import require_inertia
from cutjoint.analysis.poses import Pose, explore
from cutjoint.formulate.records import RecursiveEquations


@dataclass(frozen=True, kw_only=True)
class Mobility:
    """Unknown speeds, cut-joint equations and how many of them are independent.

    ``rank`` is the largest over ``poses`` poses that close the loops, ``design_rank`` that of the design position; where it is smaller,
    that position is singular for a moment.  ``condition`` is the largest singular value there by the smallest that is not zero.
    ``closed`` is False where guides hold the mechanism so that its loops cannot close.
    """

    speeds: int
    equations: int
    rank: int
    design_rank: int
    poses: int
    condition: float
    closed: bool

    @property
    def degrees_of_freedom(self) -> int:
        """Speeds that the equations leave free."""
        return self.speeds - self.rank

    @property
    def redundant(self) -> int:
        """Equations that follow from the others in every pose."""
        return self.equations - self.rank


def find_mobility(equations: RecursiveEquations, poses: Sequence[Pose] | None = None) -> Mobility:
    """The mobility with default parameters, guides standing still; ``poses`` are those of ``explore``."""
    poses = explore(equations) if poses is None else poses
    return Mobility(
        speeds=equations.speeds, equations=len(equations.equation_names), rank=max(p.rank for p in poses),
        design_rank=poses[0].rank, poses=len(poses), condition=poses[0].condition,
        closed=poses[0].closed,
    )  # fmt: skip


def require_soundness(equations: RecursiveEquations) -> RecursiveEquations:
    """The equations, unless a motion moves no mass or guides tear a loop open.

    Raises:
        NoInertiaError, GuideError: as of `require_inertia` and `require_guides`.
    """
    require_inertia(equations)
    require_guides(equations)
    return equations
