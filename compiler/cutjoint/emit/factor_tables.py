"""A static factorisation as index data for the loop of `cutjoint/core/newton/static_factor.hpp`.

Right-looking: when a tile is finished, sweeps subtract its updates from all later blocks.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import TypeAlias

from cutjoint.emit.factor_blocks import pivot_name
from cutjoint.sparse.pattern import positions
from cutjoint.sparse.plan import Plan
from cutjoint.sparse.tiles import WIDTH

#: A tile and another.
Pair = tuple[int, int]

#: An entry of a table.
Item: TypeAlias = int | tuple[int, ...]

_LINE = 110  #: characters of a line


@dataclass(frozen=True, kw_only=True)
class Table:
    """A C++ array: its description and its lines."""

    name: str
    type: str
    about: str
    rows: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class _Sweep:
    """The update of ``targets``, places of blocks of another tile, by a tile."""

    columns: int
    source: int
    multipliers: int
    targets: tuple[int, ...]


def make_tables(plan: Plan, names: Sequence[str]) -> list[Table]:
    """The members of `cutjoint::static_factor::Tables` as C++."""
    tiling, items = plan.tiling, table_items(plan)
    tiles = range(len(tiling))
    by_tile = [f"tile {tile}: {'; '.join(pivot_name(plan, pivot, names) for pivot in tiling.pivots(tile))}" for tile in tiles]
    return [
        _table("steps", "static_factor::Step", "pivots, diagonal, reciprocals, uppers, lowers, sweeps", by_tile, items["steps"]),
        _table("sweeps", "static_factor::Sweep", "columns, source, multipliers, blocks", by_tile, items["sweeps"]),
        _table("targets", "int", "the places that sweeps change", by_tile, items["targets"]),
        _table("others", "int", "the tiles right of each, then those below it", by_tile, items["others"]),
        _table("entries", "static_factor::Entry", "value and place, by columns of the matrix", names, items["entries"]),
        Table(name="pivots", type="static_factor::Pivot", about="row, column, place", rows=pivot_rows(plan, names)),
    ]


def table_items(plan: Plan) -> dict[str, list[list[Item]]]:
    """The items of each table, together by tile, entries together by column."""
    tiling = plan.tiling
    tiles = range(len(tiling))
    if plan.pattern.symmetric:  # of blocks of U alone, which are the blocks of L before scaling
        sweeps = [_sweep_below(plan, tile, plan.storage.upper, plan.storage.lower) for tile in tiles]
    else:
        sweeps = [_sweep_below(plan, tile, plan.storage.lower, plan.storage.upper) + _sweep_right(plan, tile) for tile in tiles]
    return {
        "steps": [[_step(plan, tile, len(sweep))] for tile, sweep in zip(tiles, sweeps, strict=True)],
        "sweeps": [[(s.columns, s.source, s.multipliers, len(s.targets)) for s in sweep] for sweep in sweeps],
        "targets": [[place for s in sweep for place in s.targets] for sweep in sweeps],
        "others": [[WIDTH * other for other in (*tiling.upper[tile], *tiling.lower[tile])] for tile in tiles],
        "entries": [list(column) for column in _entries(plan)],
        "pivots": [list(_pivots(plan))],
    }


def _pivots(plan: Plan) -> list[tuple[int, ...]]:
    """Row, column, and place in a vector with four numbers a tile."""
    elimination, tiling = plan.tiling.elimination, plan.tiling
    places = [WIDTH * tile + lane for tile in range(len(tiling)) for lane in range(tiling.size(tile))]
    return [(elimination.rows[k], elimination.columns[k], place) for k, place in enumerate(places)]


def pivot_rows(plan: Plan, names: Sequence[str]) -> tuple[str, ...]:
    """The table of pivots."""
    return tuple(f"{{{', '.join(map(str, pivot))}}},  // {pivot_name(plan, k, names)}" for k, pivot in enumerate(_pivots(plan)))


def _step(plan: Plan, tile: int, sweeps: int) -> tuple[int, ...]:
    tiling = plan.tiling
    return tiling.size(tile), plan.storage.diagonal[tile], tiling.first[tile], len(tiling.upper[tile]), len(tiling.lower[tile]), sweeps


def _sweep_below(plan: Plan, tile: int, sources: Mapping[Pair, int], multipliers: Mapping[Pair, int]) -> list[_Sweep]:
    """The diagonal block of each later tile and the blocks below it."""
    tiling, sweeps = plan.tiling, []
    for other in tiling.upper[tile]:
        if below := [i for i in tiling.lower[tile] if i >= other]:
            targets = tuple(plan.storage.diagonal[i] if i == other else sources[other, i] for i in below)
            sweeps.append(
                _Sweep(columns=tiling.size(other), source=sources[tile, below[0]], multipliers=multipliers[tile, other], targets=targets)
            )
    return sweeps


def _sweep_right(plan: Plan, tile: int) -> list[_Sweep]:
    """The blocks right of the diagonal block of each later tile."""
    tiling, upper, sweeps = plan.tiling, plan.storage.upper, []
    for other in tiling.lower[tile]:
        if right := [j for j in tiling.upper[tile] if j > other]:
            targets = tuple(upper[other, j] for j in right)
            multipliers = plan.storage.lower[tile, other]
            sweeps.append(_Sweep(columns=tiling.size(other), source=upper[tile, right[0]], multipliers=multipliers, targets=targets))
    return sweeps


def _entries(plan: Plan) -> list[list[tuple[int, int]]]:
    """The places of each value, by columns of the matrix; of a symmetric one both halves of a diagonal block, else those in U."""
    elimination, pattern = plan.tiling.elimination, plan.pattern
    row_pivot = {row: k for k, row in enumerate(elimination.rows)}
    column_pivot = {column: k for k, column in enumerate(elimination.columns)}
    tile_of = [tile for tile in range(len(plan.tiling)) for _ in plan.tiling.pivots(tile)]
    found: list[list[tuple[int, int]]] = [[] for _ in range(pattern.size)]
    for (i, j), value in positions(pattern).items():
        p, q = row_pivot[i], column_pivot[j]
        if not pattern.symmetric or tile_of[p] <= tile_of[q]:
            found[j].append((value, _place(plan, p, q, tile_of[p], tile_of[q])))
    return [sorted(column) for column in found]


def _place(plan: Plan, p: int, q: int, row: int, column: int) -> int:
    """The place of the entry of two pivots, in the tiles ``row`` and ``column``."""
    storage, first = plan.storage, plan.tiling.first
    lane_p, lane_q = p - first[row], q - first[column]
    if row < column:
        return storage.upper[row, column] + WIDTH * lane_p + lane_q
    block = storage.diagonal[row] if row == column else storage.lower[column, row]
    return block + WIDTH * lane_q + lane_p


def _table(name: str, kind: str, about: str, titles: Sequence[str], groups: Sequence[Sequence[Item]]) -> Table:
    """A table in groups with a title each; one that is empty gets a zero, since C++ has no empty arrays."""
    rows = [row for title, group in zip(titles, groups, strict=True) if group for row in (f"// {title}", *_lines(group))]
    return Table(name=name, type=kind, about=about, rows=tuple(rows) or ("{},",))


def _lines(group: Iterable[Item]) -> list[str]:
    """The items of a group, with none broken over two lines."""
    items = (str(item) if isinstance(item, int) else f"{{{','.join(map(str, item))}}}" for item in group)
    lines = wrap(" ".join(f"{item}," for item in items), width=_LINE)
    return [line.replace(",", ", ").replace(",  ", ", ").rstrip() for line in lines]
