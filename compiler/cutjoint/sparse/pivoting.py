"""Static pivots of indefinite or unsymmetric matrices, chosen from numeric samples when the compiler runs.

A pivot has to be at least `THRESHOLD` of its column in all samples: threshold pivoting after Duff, Erisman, Reid, "Direct Methods for
Sparse Matrices" (2nd ed. 2017), chapter 7, with Markowitz's count as cost.  Nothing is checked but the pivots when the factorisation runs,
so the samples should span the states and step sizes to come.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutjoint.sparse.pattern import Array, Pattern, dense

THRESHOLD = 0.1  #: the share of its column's largest candidate that a pivot has at least
LAST_RESORT = 1e-4  #: the least size of a pivot below the threshold in a sample, if no candidate is above it in all
ZERO = 1e-10  #: an entry of the scaled matrix, of which the largest entry of each column is about 1, is zero below this

#: Weights of likeness, see `pivot_by_likeness`: no rule says which suits a matrix, so all are tried.
LIKENESSES = ((1.5, 6, 3), (1.5, 6, 6), (2, 10, 3))

_TINY = -30  #: logarithms to base 2 below this count as rounding
_DAMPING = 1e-9

_ROUNDING = 2.0**-44  #: beside the largest of both its row and its column an entry below this is rounding, whatever its unit


_ALIKE = 1 - 1e-6  #: of pivots this much alike the first is taken, so that rounding, other on another processor, decides nothing


class SingularError(ValueError):
    """A sample is singular: ``rows`` are those, in the matrix's numbering, that depend on the others."""

    def __init__(self, sample: int, rows: tuple[int, ...]) -> None:
        super().__init__(f"sample {sample} is singular: rows {', '.join(map(str, rows))} depend on the others")
        self.sample = sample
        self.rows = rows


class NoPivotError(ValueError):
    """No sample is singular, but a column has no pivot that holds in all of them."""

    def __init__(self) -> None:
        super().__init__("no sequence of pivots holds in all samples, although none is singular; take samples that are less far apart")


@dataclass(frozen=True, kw_only=True)
class PivotSequence:
    """Pivot k is entry (rows[k], columns[k]); ``threshold`` is the least share of its column that a pivot has in any sample."""

    name: str
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    threshold: float


def pivot_by_markowitz(pattern: Pattern, scaled: Array) -> PivotSequence:
    """The pivot with the least product of other entries in its row and column, among those that hold in all samples.

    Args:
        pattern: an unsymmetric pattern.
        scaled: the samples as `scale_samples` gives them.

    Raises:
        SingularError: a sample is numerically singular.
        NoPivotError: no pivot holds in all samples.
    """
    return _choose("markowitz", pattern, scaled, _Remainder.least_fill)


def pivot_by_likeness(pattern: Pattern, scaled: Array, number: int) -> PivotSequence:
    """Choose, of pivots with nearly the least product, the one with a structure most like the last one's: this makes larger tiles.

    ``LIKENESSES[number]`` is how many times the least product counts as nearly that, and what may come on top; and how many entries of fill
    outweigh an entry that the pivot's row or column has more or less than the last one's.

    Raises:
        SingularError: a sample is numerically singular.
        NoPivotError: no pivot holds in all samples.
    """
    return _choose(f"likeness {number}", pattern, scaled, lambda remainder: remainder.most_alike(*LIKENESSES[number]))


def pivot_by_columns(name: str, order: Sequence[int], pattern: Pattern, scaled: Array) -> PivotSequence:
    """The columns in a given order, each with the row of the fewest entries among those that hold in all samples.
    Raises SingularError: a sample is numerically singular; NoPivotError: no pivot holds in all samples."""
    columns = iter(order)
    return _choose(name, pattern, scaled, lambda remainder: remainder.shortest_row(next(columns)))


def scale_samples(pattern: Pattern, samples: Sequence[Sequence[float] | Array]) -> Array:
    """Samples, vectors of the pattern's values, as matrices (samples x n x n) with rows and columns scaled so that units do not matter.

    The logarithms of the magnitudes are as small as they can be in the mean square: Curtis, Reid, "On the automatic scaling of matrices for
    Gaussian elimination" (1972).  Entries that are tiny even then, rounding instead of zeros, are left out of the mean.  The largest
    entries of rows and columns are about 1.  One scaling counts for all samples.
    """
    matrices = np.array([dense(pattern, values) for values in samples])
    magnitude = np.abs(matrices).max(axis=0)
    exponents = np.log2(_positive(magnitude))
    counted = magnitude > _ROUNDING * np.minimum(magnitude.max(axis=1, keepdims=True), magnitude.max(axis=0))
    for _ in range(2):
        left, right = _fit(exponents, counted)
        scaled = exponents + left[:, np.newaxis] + right
        counted &= scaled > _TINY
    left -= _largest(scaled, counted)
    right -= _largest((exponents + left[:, np.newaxis] + right).T, counted.T)
    result: Array = matrices * np.exp2(left)[:, np.newaxis] * np.exp2(right)
    return result


def _largest(exponents: Array, counted: NDArray[np.bool_]) -> Array:
    """The largest exponent of each row, zero where nothing counts."""
    return np.where(counted.any(axis=1), np.where(counted, exponents, -np.inf).max(axis=1), 0)


def _fit(exponents: Array, counted: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Logarithms of factors of rows and columns with the least squares of what they leave of the exponents."""
    weights = counted.astype(np.float64)
    size = len(weights)
    normal = np.block([[np.diag(weights.sum(axis=1)), weights], [weights.T, np.diag(weights.sum(axis=0))]])
    sums = np.concatenate([(weights * exponents).sum(axis=1), (weights * exponents).sum(axis=0)])
    found = np.linalg.solve(normal + _DAMPING * np.eye(2 * size), -sums)  # a row's factor may go up where its column's goes down
    return found[:size], found[size:]


def dependent_rows(matrix: Array) -> tuple[int, ...]:
    """The rows of a scaled matrix that depend on the others: what complete pivoting leaves, late ones rather than early."""
    remains, rows = matrix.copy(), list(range(len(matrix)))
    while rows:
        magnitudes = np.abs(remains)
        at, column = np.unravel_index(np.argmax(magnitudes > _ALIKE * magnitudes.max()), remains.shape)
        if magnitudes[at, column] <= ZERO:
            break
        pivot = remains[at]
        remains = np.delete(remains - np.outer(remains[:, column] / pivot[column], pivot), at, axis=0)
        remains[:, column] = 0
        del rows[at]
    return tuple(rows)


def _choose(name: str, pattern: Pattern, scaled: Array, choose: "Callable[[_Remainder], tuple[int, int]]") -> PivotSequence:
    if pattern.symmetric or not len(scaled):
        raise ValueError("pivots are chosen for unsymmetric patterns and from samples")
    remainder = _Remainder(scaled.copy(), dense(pattern, np.ones(len(pattern.row))) != 0)
    for _ in range(pattern.size):
        row, column = choose(remainder)
        if remainder.share(row, column) < LAST_RESORT:
            raise _explain(scaled)
        remainder.remove(row, column)
    return PivotSequence(name=name, rows=tuple(remainder.pivot_rows), columns=tuple(remainder.pivot_columns), threshold=remainder.threshold)


class _Remainder:
    """The remainder of the scaled samples after some eliminations.  Rows and columns of its arrays are those not yet eliminated."""

    def __init__(self, values: Array, entries: NDArray[np.bool_]) -> None:
        self._values = values  # samples x rows x columns
        self._entries = entries  # rows x columns
        self._rows = np.arange(len(entries))
        self._columns = np.arange(len(entries))
        self._shares = self._find_shares(slice(None))
        self._changed_rows = np.zeros(len(entries), dtype=bool)  # by the last pivot
        self._changed_columns = self._changed_rows
        self.pivot_rows: list[int] = []
        self.pivot_columns: list[int] = []
        self.threshold = 1.0

    def share(self, row: int, column: int) -> float:
        """The least share of its column that an entry has in any sample."""
        return float(self._shares[row, column])

    def least_fill(self) -> tuple[int, int]:
        return self._best(self._counts())

    def most_alike(self, nearly: float, more: float, unlike: float) -> tuple[int, int]:
        counts = self._counts()
        least = counts[self._shares >= THRESHOLD].min(initial=np.inf)
        by_row = (self._entries != self._changed_columns).sum(axis=1)
        by_column = (self._entries != self._changed_rows[:, np.newaxis]).sum(axis=0)
        differences = by_row[:, np.newaxis] + by_column if self.pivot_rows else np.zeros(counts.shape)
        return self._best(np.where(counts <= nearly * least + more, counts + unlike * differences, np.inf))

    def shortest_row(self, column: int) -> tuple[int, int]:
        cost = np.full(self._entries.shape, np.inf)
        at = np.flatnonzero(self._columns == column)
        cost[:, at] = self._entries.sum(axis=1)[:, np.newaxis]
        return self._best(cost)

    def remove(self, row: int, column: int) -> None:
        """Eliminate with the pivot in a row and column of the arrays."""
        self.threshold = min(self.threshold, self.share(row, column))
        self.pivot_rows.append(int(self._rows[row]))
        self.pivot_columns.append(int(self._columns[column]))
        below, right = np.flatnonzero(self._entries[:, column]), np.flatnonzero(self._entries[row])
        factors = self._values[:, below, column] / self._values[:, row, column][:, np.newaxis]
        products = factors[:, :, np.newaxis] * self._values[:, row, right][:, np.newaxis, :]
        self._values[:, below[:, np.newaxis], right] -= products
        self._entries[below[:, np.newaxis], right] = True
        self._changed_rows = np.delete(self._entries[:, column], row)
        self._changed_columns = np.delete(self._entries[row], column)
        self._values = np.delete(np.delete(self._values, row, axis=1), column, axis=2)
        self._entries = np.delete(np.delete(self._entries, row, axis=0), column, axis=1)
        self._shares = np.delete(np.delete(self._shares, row, axis=0), column, axis=1)
        self._rows, self._columns = np.delete(self._rows, row), np.delete(self._columns, column)
        self._shares[:, self._changed_columns] = self._find_shares(self._changed_columns)

    def _find_shares(self, columns: slice | NDArray[np.bool_]) -> Array:
        """Zero where an entry counts as none; rows x columns."""
        magnitude = np.abs(self._values[:, :, columns])
        largest = magnitude.max(axis=1, keepdims=True, initial=0)
        shares = (magnitude / _positive(largest)).min(axis=0)
        return np.where(self._entries[:, columns] & (magnitude > ZERO).all(axis=0), shares, 0)

    def _counts(self) -> Array:
        """Markowitz's products."""
        return np.outer(self._entries.sum(axis=1) - 1, self._entries.sum(axis=0) - 1).astype(np.float64)

    def _best(self, cost: Array) -> tuple[int, int]:
        """The candidate of the least cost, the first at equal cost; where no pivot holds, the entry of the largest share."""
        candidates = np.isfinite(cost)
        holds = candidates & (self._shares >= THRESHOLD)
        best = np.argmin(np.where(holds, cost, np.inf)) if holds.any() else np.argmax(np.where(candidates, self._shares, -1))
        row, column = np.unravel_index(best, cost.shape)
        return int(row), int(column)


def _explain(scaled: Array) -> SingularError | NoPivotError:
    """The error that no pivot is left: dependent rows if there are any."""
    for number, matrix in enumerate(scaled):
        if rows := dependent_rows(matrix):
            return SingularError(number, rows)
    return NoPivotError()


def _positive(values: Array) -> Array:
    """The values, with 1 instead of 0."""
    return np.where(values > 0, values, 1)
