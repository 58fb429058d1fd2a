"""A static factorisation as straight-line code: one block of statements for each block of the factors.

Left-looking: a block starts with the matrix's values, the updates of all earlier tiles are subtracted, and it is finished and stored.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cutjoint.sparse.pattern import positions
from cutjoint.sparse.plan import Plan
from cutjoint.sparse.tiles import WIDTH


@dataclass(frozen=True, kw_only=True)
class Block:
    """Statements in a scope of their own, and comments before it."""

    notes: tuple[str, ...]
    statements: tuple[str, ...]


def factor_blocks(plan: Plan, names: Sequence[str]) -> list[Block]:
    """The factorisation: of each tile its diagonal block, its blocks of U and, unless these give them, its blocks of L."""
    factors = _Factors(plan)
    blocks = []
    for tile in range(len(plan.tiling)):
        blocks.append(factors.diagonal(tile, names))
        blocks += [factors.upper(tile, other) for other in plan.tiling.upper[tile]]
        if not plan.pattern.symmetric:
            blocks += [factors.lower(tile, other) for other in plan.tiling.lower[tile]]
    return blocks


def solve_blocks(plan: Plan, names: Sequence[str]) -> list[Block]:
    """The solution: forward substitution over all tiles, then backward substitution."""
    solution = _Solution(plan)
    tiles = range(len(plan.tiling))
    return [solution.forward(tile, names) for tile in tiles] + [solution.backward(tile, names) for tile in reversed(tiles)]


def titles(plan: Plan, tile: int, names: Sequence[str]) -> tuple[str, ...]:
    """A line for each pivot of a tile."""
    return tuple(f"tile {tile}: {pivot_name(plan, pivot, names)}" for pivot in plan.tiling.pivots(tile))


def pivot_name(plan: Plan, pivot: int, names: Sequence[str]) -> str:
    """The name of a pivot's row and, if it is another, that of its column."""
    row, column = plan.tiling.elimination.rows[pivot], plan.tiling.elimination.columns[pivot]
    return names[row] if row == column else f"row {names[row]}, column {names[column]}"


def _turned(structure: Sequence[Sequence[int]]) -> list[list[int]]:
    """The structure transposed: for each tile the tiles that refer to it."""
    found: list[list[int]] = [[] for _ in structure]
    for k, others in enumerate(structure):
        for other in others:
            found[other].append(k)
    return found


class _Factors:
    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._tiling = plan.tiling
        self._storage = plan.storage
        self._positions = positions(plan.pattern)
        self._left = _turned(plan.tiling.lower)  # the tiles that have a block of L in the rows of a tile
        self._above = [set(tiles) for tiles in _turned(plan.tiling.upper)]  # those that have a block of U in its columns

    def diagonal(self, tile: int, names: Sequence[str]) -> Block:
        """The pivots of a tile."""
        pivots = self._tiling.pivots(tile)
        place = self._storage.diagonal[tile]
        return Block(
            notes=titles(self._plan, tile, names),
            statements=(
                *self._values(tile, [[(p, q) for p in pivots] for q in pivots]),
                *self._terms(tile, tile),
                f"find_pivots(t, factors + {place}, factors + {self._tiling.first[tile]});",
            ),
        )

    def upper(self, tile: int, other: int) -> Block:
        """U in the rows of a tile and the columns of a later one, and L if the matrix is symmetric."""
        symmetric = self._plan.pattern.symmetric
        diagonal, lower = self._storage.diagonal[tile], self._storage.lower
        return Block(
            notes=(f"{'U and L' if symmetric else 'U'} of tile {tile}, with tile {other}",),
            statements=(
                *self._values(tile, [[(p, q) for q in self._tiling.pivots(other)] for p in self._tiling.pivots(tile)]),
                *self._terms(tile, other),
                f"solve_lower(t, factors + {diagonal});",
                f"keep(t, factors + {self._storage.upper[tile, other]});",
                *((f"keep_scaled(t, factors + {diagonal}, factors + {lower[tile, other]});",) if symmetric else ()),
            ),
        )

    def lower(self, tile: int, other: int) -> Block:
        """L in the columns of a tile and the rows of a later one."""
        return Block(
            notes=(f"L of tile {tile}, with tile {other}",),
            statements=(
                *self._values(tile, [[(p, q) for p in self._tiling.pivots(other)] for q in self._tiling.pivots(tile)]),
                *self._terms(other, tile),
                f"solve_upper(t, factors + {self._storage.diagonal[tile]});",
                f"keep(t, factors + {self._storage.lower[tile, other]});",
            ),
        )

    def _values(self, tile: int, columns: Sequence[Sequence[tuple[int, int]]]) -> Iterator[str]:
        """The matrix's values in a block, given the pivots of row and column of each."""
        head = f"Tile<Real, {self._tiling.size(tile)}> t"
        found = [[self._value(p, q) for p, q in column] for column in columns]
        if not any(value for column in found for value in column):
            yield f"{head}{{}};"
            return
        yield f"{head}{{{{"
        yield from (f"    {{{', '.join(value or '0' for value in column)}}}," if any(column) else "    {}," for column in found)
        yield "}};"

    def _value(self, p: int, q: int) -> str:
        elimination = self._tiling.elimination
        position = self._positions.get((elimination.rows[p], elimination.columns[q]))
        return "" if position is None else f"tangent[{position}]"

    def _terms(self, row: int, column: int) -> Iterator[str]:
        lower, upper = self._storage.lower, self._storage.upper
        for k in self._left[row]:
            if k < min(row, column) and k in self._above[column]:
                left, right = (lower[k, row], upper[k, column]) if row >= column else (upper[k, column], lower[k, row])
                yield f"subtract<{self._tiling.size(k)}>(t, factors + {left}, factors + {right});  // tile {k}"


class _Solution:
    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._tiling = plan.tiling
        self._storage = plan.storage
        self._left = _turned(plan.tiling.lower)

    def forward(self, tile: int, names: Sequence[str]) -> Block:
        """The right-hand side of a tile, less the terms of earlier tiles."""
        rows = self._plan.tiling.elimination.rows
        size = self._tiling.size
        return Block(
            notes=titles(self._plan, tile, names),
            statements=(
                f"Tile<Real, 4> t{{{{{{{', '.join(f'x[{rows[pivot]}]' for pivot in self._tiling.pivots(tile))}}}}}}};",
                *(f"subtract_forward<{size(k)}>(t, factors + {self._storage.lower[k, tile]}, y + {WIDTH * k});" for k in self._left[tile]),
                f"finish_forward<{size(tile)}>(t, factors + {self._storage.diagonal[tile]}, y + {WIDTH * tile});",
            ),
        )

    def backward(self, tile: int, names: Sequence[str]) -> Block:
        """A tile's unknowns from the later ones."""
        columns = self._plan.tiling.elimination.columns
        others = self._tiling.upper[tile]
        return Block(
            notes=titles(self._plan, tile, names),
            statements=(
                f"Tile<Real, {self._tiling.size(tile)}> t{{}};",
                *(f"add_backward(t, factors + {self._storage.upper[tile, other]}, y + {WIDTH * other});" for other in others),
                f"finish_backward(t, factors + {self._storage.diagonal[tile]}, y + {WIDTH * tile});",
                *(f"x[{columns[pivot]}] = y[{WIDTH * tile + lane}];" for lane, pivot in enumerate(self._tiling.pivots(tile))),
            ),
        )
