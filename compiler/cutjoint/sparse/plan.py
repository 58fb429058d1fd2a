"""From a pattern to the plan of its factorisation: the cheapest of several orders, in tiles.

Orders that fill in little are those of SuiteSparse and METIS; the compiler calls their shared libraries, what it makes does not.  Wheels
for a platform have the libraries; elsewhere they are the system's.
"""

from __future__ import annotations

import ctypes
import ctypes.util
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from cutjoint.package.errors import CutjointError
from cutjoint.package.locations import binaries_folder
from cutjoint.package.system import IS_WINDOWS, library_file
from cutjoint.sparse.pattern import Array, Pattern
from cutjoint.sparse.pivoting import LIKENESSES, NoPivotError, pivot_by_columns, pivot_by_likeness, pivot_by_markowitz, scale_samples
from cutjoint.sparse.symbolic import Elimination, eliminate, multiply_adds
from cutjoint.sparse.tiles import Storage, Tiling, make_tiles, operations, store

ORDERING_PACKAGES = "libsuitesparse-dev libmetis5"  #: debian's packages with the libraries
LIBRARIES = ("amd", "colamd", "metis")  #: the libraries, by their names without "lib"

_Int = ctypes.c_int32
_KNOBS = 20  # COLAMD_KNOBS, COLAMD_STATS
_OPTIONS = 40  # METIS_NOPTIONS
_SEED = 8  # METIS_OPTION_SEED


class MissingLibraryError(CutjointError, RuntimeError):
    """A library that orders sparse matrices (AMD, METIS or COLAMD) is not installed."""


@dataclass(frozen=True, kw_only=True)
class Ordering:
    """An order of elimination: order[k] is the row and column, or the column alone, that comes as number k."""

    name: str
    order: tuple[int, ...]


def order_symmetric(pattern: Pattern) -> tuple[Ordering, ...]:
    """Orders for a symmetric matrix, always by the same methods in the same order.
    Raises MissingLibraryError: a library is not installed."""
    return tuple(Ordering(name=name, order=method(pattern)) for name, method in (("amd", amd), ("symamd", symamd), ("metis", metis)))


def order_columns(pattern: Pattern) -> tuple[Ordering, ...]:
    """Orders for the columns of an unsymmetric matrix, the same way. Raises MissingLibraryError: a library is not installed."""
    return tuple(Ordering(name=name, order=method(pattern)) for name, method in (("colamd", colamd), ("amd", amd), ("metis", metis)))


def amd(pattern: Pattern) -> tuple[int, ...]:
    """Approximate minimum degree on the pattern of A + A^T (Amestoy, Davis, Duff 1996)."""
    library, (first, row), order = _library("amd"), _compressed(_neighbours(pattern)), (_Int * pattern.size)()
    status = library.amd_order(_Int(pattern.size), first, row, order, None, None)
    return _permutation("amd_order", order[:], succeeded=status == 0)


def symamd(pattern: Pattern) -> tuple[int, ...]:
    """Approximate minimum degree by columns on a symmetric pattern (Davis, Gilbert, Larimore, Ng 2004)."""
    library, (first, row) = _library("colamd"), _compressed(_neighbours(pattern))
    order, statistics = (_Int * (pattern.size + 1))(), (_Int * _KNOBS)()
    standard = ctypes.CDLL("msvcrt" if IS_WINDOWS else None)
    succeeded = library.symamd(_Int(pattern.size), row, first, order, None, statistics, standard.calloc, standard.free)
    return _permutation("symamd", order[: pattern.size], succeeded=bool(succeeded))


def colamd(pattern: Pattern) -> tuple[int, ...]:
    """Approximate minimum degree of the columns, for any choice of rows (Davis, Gilbert, Larimore, Ng 2004)."""
    library, n, entries = _library("colamd"), pattern.size, len(pattern.row)
    library.colamd_recommended.restype = ctypes.c_size_t
    length = library.colamd_recommended(_Int(entries), _Int(n), _Int(n))
    row, first, statistics = (_Int * length)(*pattern.row), (_Int * (n + 1))(*pattern.first), (_Int * _KNOBS)()
    succeeded = library.colamd(_Int(n), _Int(n), _Int(length), row, first, None, statistics)
    return _permutation("colamd", first[:n], succeeded=bool(succeeded))


def metis(pattern: Pattern) -> tuple[int, ...]:
    """Nested dissection on the pattern of A + A^T (Karypis, Kumar 1998)."""
    library, neighbours = _library("metis"), _neighbours(pattern)
    if not any(neighbours):
        return tuple(range(pattern.size))  # METIS takes no graph without edges
    first, row = _compressed(neighbours)
    options, order, inverse = (_Int * _OPTIONS)(), (_Int * (2 * pattern.size))(), (_Int * (2 * pattern.size))()
    library.METIS_SetDefaultOptions(options)
    options[_SEED] = 1
    status = library.METIS_NodeND(ctypes.byref(_Int(pattern.size)), first, row, None, options, order, inverse)
    return _permutation("METIS_NodeND", order[: pattern.size], succeeded=status == 1)


def _library(name: str) -> ctypes.CDLL:
    shipped = binaries_folder() / library_file(name)
    found = str(shipped) if shipped.is_file() else ctypes.util.find_library(name)
    if found is None:
        raise MissingLibraryError(f"missing: lib{name}, which orders sparse matrices; apt-get install {ORDERING_PACKAGES}")
    return ctypes.CDLL(found)


def _neighbours(pattern: Pattern) -> list[list[int]]:
    """The graph of A + A^T without loops."""
    sets: list[set[int]] = [set() for _ in range(pattern.size)]
    for i, j in pattern.entries():
        if i != j:
            sets[i].add(j)
            sets[j].add(i)
    return [sorted(s) for s in sets]


def _compressed(lists: Sequence[Sequence[int]]) -> tuple[ctypes.Array[_Int], ctypes.Array[_Int]]:
    first = [0]
    for one in lists:
        first.append(first[-1] + len(one))
    return (_Int * len(first))(*first), (_Int * max(first[-1], 1))(*(k for one in lists for k in one))


def _permutation(function: str, order: Sequence[int], *, succeeded: bool) -> tuple[int, ...]:
    """The order, if it is one: a library with integers of another width gives none."""
    if not succeeded or sorted(order) != list(range(len(order))):
        raise RuntimeError(f"{function} gives no order; its integers may not have 32 bits, as those of Debian's package have")
    return tuple(order)


@dataclass(frozen=True, kw_only=True)
class Trial:
    """An order that was tried: the multiply-adds that it needs for a factorisation and a solution, and the predicted operations by tiles.
    ``threshold`` is the least share of its column that a pivot has in any sample; 1 where no pivots were chosen."""

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
    Raises MissingLibraryError: a library that orders matrices is not installed; ValueError: an entry of the diagonal is always zero."""
    entries = set(pattern.entries())
    if any((i, i) not in entries for i in range(pattern.size)):
        raise ValueError("a definite matrix has no zeros on its diagonal")
    return _cheapest(pattern, [(o.name, eliminate(pattern, o.order, o.order), 1.0) for o in order_symmetric(pattern)])


def plan_unsymmetric(pattern: Pattern, samples: Sequence[Sequence[float] | Array]) -> Plan:
    """The plan for matrices of an unsymmetric pattern, with pivots that hold in all samples, vectors of the pattern's values.
    Raises MissingLibraryError: a library that orders matrices is not installed; SingularError: a sample is numerically singular;
    NoPivotError: no sequence of pivots holds in all samples."""
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
