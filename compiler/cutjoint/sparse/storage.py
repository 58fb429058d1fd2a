"""The storage of a tiled factorisation's blocks in one array of numbers.

First the reciprocals of all pivots, in the order of elimination, then for each tile its diagonal block, its blocks of U and its blocks of
L, the other tile ascending.  A block of a tile with w pivots has w columns of four numbers, of which the last are zero when the other tile
is smaller than four:

- the diagonal block holds the unit lower triangle L, the upper triangle U, and the reciprocals of the pivots, by columns,
- a block of L is stored by columns, the rows of the tile below in a column,
- a block of U is stored by rows, the columns of the tile on the right in such a row.

L D L^T is stored as L U with U = D L^T, so that both kinds are factored and solved alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.sparse.tiles import WIDTH, Tiling


@dataclass(frozen=True, kw_only=True)
class Storage:
    """The places of the blocks in an array of ``length`` numbers; ``upper`` and ``lower`` by (tile, other tile)."""

    length: int
    diagonal: tuple[int, ...]
    upper: Mapping[tuple[int, int], int]
    lower: Mapping[tuple[int, int], int]


def store(tiling: Tiling) -> Storage:
    """The places of a tiling's blocks."""
    place = -(-tiling.first[-1] // WIDTH) * WIDTH
    diagonal: list[int] = []
    upper: dict[tuple[int, int], int] = {}
    lower: dict[tuple[int, int], int] = {}
    for tile in range(len(tiling)):
        block = WIDTH * tiling.size(tile)
        diagonal.append(place)
        place += block
        for blocks, others in ((upper, tiling.upper[tile]), (lower, tiling.lower[tile])):
            for other in others:
                blocks[tile, other] = place
                place += block
    return Storage(length=place, diagonal=tuple(diagonal), upper=upper, lower=lower)
