"""Symbolic elimination: fill-in and operations, without numbers.

Davis, "Direct Methods for Sparse Linear Systems" (2006), chapters 4 and 6.  Structures are sets of pivots held as the bits of integers, so
that the union of two is one operation; L D L^T and L U differ in nothing but that the former's halves are alike.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cutjoint.sparse.pattern import Pattern


@dataclass(frozen=True, kw_only=True)
class Elimination:
    """The factors' structure for one sequence of pivots, numbered 0 .. size - 1 in this order.
    Pivot k is the matrix's entry (rows[k], columns[k]). ``lower[k]`` are the pivots with rows that have an entry in column k of L below
    the diagonal, ``upper[k]`` those with columns that have one in row k of U; the same tuples in L D L^T. Both ascend."""

    symmetric: bool
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    lower: tuple[tuple[int, ...], ...]
    upper: tuple[tuple[int, ...], ...]

    def operations(self) -> Iterator[tuple[int, int, int]]:
        """Pivots i, j, k of each term l_ik u_kj that is subtracted from entry (i, j): of L D L^T the lower triangle only."""
        for k, (below, right) in enumerate(zip(self.lower, self.upper, strict=True)):
            for i in below:
                for j in right:
                    if not self.symmetric or i >= j:
                        yield i, j, k


def eliminate(pattern: Pattern, rows: Sequence[int], columns: Sequence[int]) -> Elimination:
    """Eliminate with the static pivots (rows[k], columns[k]). Of a symmetric matrix rows and columns are one order.
    Raises ValueError: rows or columns are no permutation, or differ although the matrix is symmetric."""
    if sorted(rows) != list(range(pattern.size)) or sorted(columns) != list(range(pattern.size)):
        raise ValueError("the pivots' rows and columns have to be permutations")
    if pattern.symmetric and tuple(rows) != tuple(columns):
        raise ValueError("a symmetric matrix has one order of rows and columns")
    lower, upper = fill(*_structure(pattern, rows, columns))
    return Elimination(symmetric=pattern.symmetric, rows=tuple(rows), columns=tuple(columns), lower=lower, upper=upper)


def fill(below: list[int], right: list[int]) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]:
    """The factors' structure from the matrix's: bit i of below[k] is entry (i, k), bit j of right[k] entry (k, j). Takes the lists over."""
    lower, upper = [], []
    for k in range(len(below)):
        lower.append(bits(below[k] >> (k + 1), k + 1))
        upper.append(bits(right[k] >> (k + 1), k + 1))
        for i in lower[k]:
            right[i] |= right[k]
        for j in upper[k]:
            below[j] |= below[k]
    return tuple(lower), tuple(upper)


def bits(mask: int, offset: int = 0) -> tuple[int, ...]:
    """The numbers of the bits that are set, plus the offset, ascending."""
    found = []
    while mask:
        lowest = mask & -mask
        found.append(lowest.bit_length() - 1 + offset)
        mask ^= lowest
    return tuple(found)


def multiply_adds(elimination: Elimination) -> int:
    """Multiply-adds of one factorisation and one solution; scaling by a pivot counts as one."""
    work = 0
    for below, right in zip(elimination.lower, elimination.upper, strict=True):
        b, r = len(below), len(right)
        work += (b * (b + 1) // 2 if elimination.symmetric else b * r) + b + (b + r + 1)
    return work


def postorder(elimination: Elimination) -> tuple[int, ...]:
    """The pivots in an order that fills in alike and has those of like structure side by side.
    A pivot's parent is the first that it changes. Children come before their parent, that of the largest structure last; in an
    unsymmetric matrix pivots can change others than their ancestors, and come before these as well."""
    changed = [sorted({*below, *right}) for below, right in zip(elimination.lower, elimination.upper, strict=True)]
    before: list[list[int]] = [[] for _ in changed]
    for k, later in enumerate(changed):
        for i in later[1:]:
            before[i].append(k)
    children: list[list[int]] = [[] for _ in changed]
    for k, later in enumerate(changed):
        if later:
            children[later[0]].append(k)
    for i, child_list in enumerate(children):
        before[i] += sorted(child_list, key=lambda k: (-len(changed[k]), -k))  # the last is visited first
    return _depth_first(before, [k for k, later in enumerate(changed) if not later])


def _depth_first(before: Sequence[Sequence[int]], roots: Sequence[int]) -> tuple[int, ...]:
    """All nodes, each after those that have to come before it."""
    order: list[int] = []
    seen, left = set[int](), [(root, False) for root in reversed(roots)]
    while left:
        node, expanded = left.pop()
        if expanded:
            order.append(node)
        elif node not in seen:
            seen.add(node)
            left += [(node, True), *((k, False) for k in before[node])]
    return tuple(order)


def renumber(elimination: Elimination, order: Sequence[int]) -> Elimination:
    """Renumber an elimination so that pivot order[k] is number k.  Every pivot has to stay before those that it changes."""
    place = {pivot: k for k, pivot in enumerate(order)}

    def moved(structure: Sequence[Sequence[int]]) -> tuple[tuple[int, ...], ...]:
        return tuple(tuple(sorted(place[i] for i in structure[pivot])) for pivot in order)

    return Elimination(
        symmetric=elimination.symmetric, rows=tuple(elimination.rows[k] for k in order),
        columns=tuple(elimination.columns[k] for k in order), lower=moved(elimination.lower), upper=moved(elimination.upper),
    )  # fmt: skip


def _structure(pattern: Pattern, rows: Sequence[int], columns: Sequence[int]) -> tuple[list[int], list[int]]:
    """The permuted matrix's columns and rows as bits."""
    row_place = {row: k for k, row in enumerate(rows)}
    column_place = {column: k for k, column in enumerate(columns)}
    below, right = [0] * pattern.size, [0] * pattern.size
    for i, j in pattern.entries():
        for a, b in {(i, j), (j, i)} if pattern.symmetric else {(i, j)}:
            below[column_place[b]] |= 1 << row_place[a]
            right[row_place[a]] |= 1 << column_place[b]
    return below, right
