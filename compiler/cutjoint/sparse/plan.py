"""From a pattern to the plan of its factorisation: the cheapest of several orders, in tiles."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from cutjoint.sparse.ordering import order_columns, order_symmetric
from cutjoint.sparse.pattern import Array, Pattern
from cutjoint.sparse.pivoting import LIKENESSES, NoPivotError, pivot_by_columns, pivot_by_likeness, pivot_by_markowitz, scale_samples
from cutjoint.sparse.symbolic import Elimination, eliminate, multiply_adds
from cutjoint.sparse.tiles import Storage, Tiling, make_tiles, operations, store


@dataclass(frozen=True, kw_only=True)
class Trial:
    """An order that was tried: the multiply-adds that it needs for a factorisation and a solution, and the predicted operations by tiles.

    ``threshold`` is the least share of its column that a pivot has in any sample; 1 where no pivots were chosen.
    """

    name: str
    multiply_adds: int
    operations: int
    threshold: float


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A static factorisation: L D L^T of a symmetric pattern, L U of another.  ``trials`` has the order in use first."""

    pattern: Pattern
    tiling: Tiling
    storage: Storage
    trials: tuple[Trial, ...]

    @property
    def multiply_adds(self) -> int:
        """The multiply-adds of a factorisation and a solution, without the zeros in blocks."""
        return self.trials[0].multiply_adds


def plan_definite(pattern: Pattern) -> Plan:
    """The plan for positive definite matrices, symmetric or not, with pivots on the diagonal: no pivoting.

    Raises:
        MissingLibraryError: a library that orders matrices is not installed.
        ValueError: an entry of the diagonal is always zero.
    """
    entries = set(pattern.entries())
    if any((i, i) not in entries for i in range(pattern.size)):
        raise ValueError("a definite matrix has no zeros on its diagonal")
    return _cheapest(pattern, [(o.name, eliminate(pattern, o.order, o.order), 1.0) for o in order_symmetric(pattern)])


def plan_unsymmetric(pattern: Pattern, samples: Sequence[Sequence[float] | Array]) -> Plan:
    """The plan for matrices of an unsymmetric pattern, with pivots that hold in all samples, vectors of the pattern's values.

    Raises:
        MissingLibraryError: a library that orders matrices is not installed.
        SingularError: a sample is numerically singular.
        NoPivotError: no sequence of pivots holds in all samples.
    """
    scaled = scale_samples(pattern, samples)
    sequences = [pivot_by_markowitz(pattern, scaled)]
    sequences += [pivot_by_likeness(pattern, scaled, number) for number in range(len(LIKENESSES))]
    for ordering in order_columns(pattern):
        with suppress(NoPivotError):
            sequences.append(pivot_by_columns(ordering.name, ordering.order, pattern, scaled))
    return _cheapest(pattern, [(s.name, eliminate(pattern, s.rows, s.columns), s.threshold) for s in sequences])


def _cheapest(pattern: Pattern, candidates: Sequence[tuple[str, Elimination, float]]) -> Plan:
    """The plan of the fewest operations, the first at equal ones."""
    tried = []
    for name, elimination, threshold in candidates:
        tiling = make_tiles(elimination)
        trial = Trial(name=name, multiply_adds=multiply_adds(elimination), operations=operations(tiling), threshold=threshold)
        tried.append((trial, tiling))
    tried.sort(key=lambda one: one[0].operations)
    tiling = tried[0][1]
    return Plan(pattern=pattern, tiling=tiling, storage=store(tiling), trials=tuple(trial for trial, _ in tried))
