"""The cut joints' equations that follow from the others, in every pose or for a moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutjoint.analysis.closing import Array
from cutjoint.analysis.poses import Pose
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.topology.conditioning import TOLERANCE

#: An equation is as good as the best one left if what it adds is at least this share of it; the file's order decides among these.
_GOOD_ENOUGH = 0.01
#: An equation whose part in another's combination is below this share has none.
_PART = 1e-6
#: Damping of the combinations by the largest square of a row, for poses in which the kept equations are dependent.
_DAMPING = 1e-13


@dataclass(frozen=True, kw_only=True)
class RedundantEquation:
    """An equation that follows from those kept.

    ``joint`` is the cut joint or gear, ``equation`` its short name, ``place`` file and line.  ``instead`` names the kept equations any one
    of which is redundant in its stead in some pose.
    """

    joint: str
    equation: str
    place: str
    instead: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Redundancy:
    """``structural`` equations are redundant in every pose, ``momentary`` ones in the design position only."""

    structural: tuple[RedundantEquation, ...]
    momentary: tuple[RedundantEquation, ...]


def find_redundancy(equations: RecursiveEquations, poses: Sequence[Pose]) -> Redundancy:
    """The redundant equations over the poses of ``explore``; of those that might be kept, the first in the file are."""
    rank = max(p.rank for p in poses)
    regular = [p.jacobian for p in poses if p.rank == rank]
    kept = choose_independent(regular, rank)
    left = [i for i in range(len(equations.equation_names)) if i not in set(kept)]
    momentary: list[int] = []
    here = kept
    if poses[0].rank < rank:
        within = choose_independent([poses[0].jacobian[kept]], poses[0].rank)
        here = [kept[i] for i in within]
        momentary = [i for i in kept if i not in set(here)]
    return Redundancy(structural=_name(equations, left, kept, regular), momentary=_name(equations, momentary, here, [poses[0].jacobian]))


def choose_independent(jacobians: Sequence[Array], rank: int) -> list[int]:
    """Rows that are independent in all the matrices (m, n) of one rank, in their order: a QR factorisation of the transposes with
    common pivots.

    A pivot is the first row whose distance from the rows chosen is, in every matrix, good enough beside the largest such distance; if
    there is none, the row that is best in its worst matrix.
    """
    rest = [jacobian.copy() for jacobian in jacobians]
    norms = np.stack([np.linalg.norm(matrix, axis=1) for matrix in rest])
    floor = TOLERANCE * norms.max(axis=1, initial=0.0, keepdims=True) + np.finfo(float).tiny
    chosen: list[int] = []
    for _ in range(rank):
        shares = (norms / np.maximum(norms.max(axis=1, keepdims=True), floor)).min(axis=0)
        shares[chosen] = -1.0
        pivot = int(np.flatnonzero(shares >= min(_GOOD_ENOUGH, 0.9 * shares.max()))[0])
        chosen.append(pivot)
        for matrix, norm, least in zip(rest, norms, floor[:, 0], strict=True):
            _project_out(matrix, norm, matrix[pivot] / max(norm[pivot], least))
    return sorted(chosen)


def _project_out(matrix: Array, norms: Array, along: Array) -> None:
    """Take the direction out of the rows, and bring their norms up to date."""
    overlap = matrix @ along
    touched = np.flatnonzero(overlap)
    matrix[touched] -= np.outer(overlap[touched], along)
    norms[touched] = np.linalg.norm(matrix[touched], axis=1)


def _name(
    equations: RecursiveEquations, rows: Sequence[int], kept: Sequence[int], jacobians: Sequence[Array]
) -> tuple[RedundantEquation, ...]:
    names = [(c.joint, name) for c in equations.closures for name in c.names]
    places = {element.name: element.span.place for element in equations.topology.closing}
    taking_part = _combinations(rows, kept, jacobians)
    return tuple(
        RedundantEquation(
            joint=names[row][0], equation=names[row][1], place=places[names[row][0]],
            instead=tuple(".".join(names[i]) for i, takes_part in zip(kept, column, strict=True) if takes_part),
        )
        for row, column in zip(rows, taking_part.T, strict=True)
    )  # fmt: skip


def _combinations(rows: Sequence[int], kept: Sequence[int], jacobians: Sequence[Array]) -> NDArray[np.bool_]:
    """Return whether each kept row (first axis) takes part in the combination that gives a redundant row (second), in any matrix."""
    result = np.zeros((len(kept), len(rows)), dtype=bool)
    for jacobian in jacobians if result.size else ():
        base, others = jacobian[kept], jacobian[rows]
        gram = base @ base.T
        damping = _DAMPING * gram.diagonal().max()
        factors = np.linalg.solve(gram + damping * np.eye(len(kept)), base @ others.T)
        parts = np.abs(factors) * np.linalg.norm(base, axis=1)[:, np.newaxis]
        result |= parts > _PART * np.linalg.norm(jacobian, axis=1).max()
    return result
