"""Patterns of sparse matrices: where entries stand, known when the compiler runs.  A tangent's follows from the lowered program."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cutjoint.program.records import Program

Array = NDArray[np.float64]
PREFIX = "tangent:"  #: the beginning of names of a tangent's entries: row and column follow


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Compressed columns, rows ascending; of a symmetric matrix the lower triangle. The same record as `cutjoint::Pattern`.
    ``first`` has size + 1 offsets: column j has the entries first[j] .. first[j + 1] - 1, in the rows ``row``."""

    size: int
    symmetric: bool
    first: tuple[int, ...]
    row: tuple[int, ...]

    def entries(self) -> Iterator[tuple[int, int]]:
        """Row and column of each entry, in the order of the values."""
        for column in range(self.size):
            for k in range(self.first[column], self.first[column + 1]):
                yield self.row[k], column


def make_pattern(size: int, entries: Iterable[tuple[int, int]], *, symmetric: bool) -> Pattern:
    """The pattern of a set of entries (row, column), given in any order and any number of times.
    Of a symmetric matrix either half may be given; the lower triangle is stored. Raises ValueError: an entry is outside the matrix."""
    columns: list[set[int]] = [set() for _ in range(size)]
    for i, j in entries:
        if not (0 <= i < size and 0 <= j < size):
            raise ValueError(f"entry ({i}, {j}) is outside of a matrix of size {size}")
        row, column = (max(i, j), min(i, j)) if symmetric else (i, j)
        columns[column].add(row)
    first = [0]
    for rows in columns:
        first.append(first[-1] + len(rows))
    return Pattern(size=size, symmetric=symmetric, first=tuple(first), row=tuple(i for rows in columns for i in sorted(rows)))


def positions(pattern: Pattern) -> Mapping[tuple[int, int], int]:
    """The position of each entry (row, column) among the values; of a symmetric matrix both halves."""
    found = {entry: k for k, entry in enumerate(pattern.entries())}
    return found | {(j, i): k for (i, j), k in found.items()} if pattern.symmetric else found


def dense(pattern: Pattern, values: Sequence[float] | Array) -> Array:
    """The matrix, size x size, with the values of the pattern's entries."""
    matrix = np.zeros((pattern.size, pattern.size))
    for (i, j), value in zip(pattern.entries(), values, strict=True):
        matrix[i, j] = value
        if pattern.symmetric:
            matrix[j, i] = value
    return matrix


def settle_entries(program: Program, size: int, *, symmetric: bool) -> tuple[Program, Pattern]:
    """The pattern of the entries ``tangent:row,column``, and the program without those that are always zero."""
    found = {r for f in program.functions for r in f.results if r.target.startswith(PREFIX)}
    absent = {r for r in found if program.graph.value(r.scalar) == 0.0}
    functions = tuple(replace(f, results=tuple(r for r in f.results if r not in absent)) for f in program.functions)
    entries = (_entry(r.target) for f in functions for r in f.results if r.target.startswith(PREFIX))
    pattern = make_pattern(size, entries, symmetric=symmetric)
    return replace(program, functions=functions), pattern


def _entry(target: str) -> tuple[int, int]:
    row, column = target.removeprefix(PREFIX).split(",")
    return int(row), int(column)


def places(pattern: Pattern) -> dict[str, int]:
    """The places of the results that are entries, by their names."""
    return {f"{PREFIX}{i},{j}": k for k, (i, j) in enumerate(pattern.entries())}
