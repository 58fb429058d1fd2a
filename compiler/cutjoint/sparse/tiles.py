"""Pivots gathered in tiles of up to four, so that the factors become small dense blocks that fit a vector register."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cutjoint.sparse.symbolic import Elimination, fill, postorder, renumber

WIDTH = 4  #: pivots of a tile: the lanes of a register
_RELAXATIONS = range(7)  #: zeros that a pivot may get in its structure when it joins a tile, on average: all are tried
_TERM, _BLOCK = 1, 2  #: the cost of a term and a block beside their multiply-adds, in four-lane multiply-adds; measured


@dataclass(frozen=True, kw_only=True)
class Tiling:
    """An elimination by tiles. Tile t has the pivots first[t] .. first[t + 1] - 1 of the elimination. ``lower[t]`` are the tiles below it
    that have a block of L in its columns, ``upper[t]`` those right of it that have a block of U in its rows; blocks are dense. A tile
    changes only later ones, and those that change nothing of each other stand side by side: what the processor can do at a time."""

    elimination: Elimination
    first: tuple[int, ...]
    lower: tuple[tuple[int, ...], ...]
    upper: tuple[tuple[int, ...], ...]

    def __len__(self) -> int:
        return len(self.lower)

    def size(self, tile: int) -> int:
        """The number of the tile's pivots."""
        return self.first[tile + 1] - self.first[tile]

    def pivots(self, tile: int) -> range:
        """The pivots of a tile."""
        return range(self.first[tile], self.first[tile + 1])


def make_tiles(elimination: Elimination) -> Tiling:
    """The tiling with the fewest predicted operations."""
    ordered = renumber(elimination, postorder(elimination))
    tilings = {first: _tile(ordered, first) for first in dict.fromkeys(_gather(ordered, zeros) for zeros in _RELAXATIONS)}
    return _by_level(min(tilings.values(), key=operations))


def operations(tiling: Tiling) -> int:
    """Predicted four-lane multiply-adds of a factorisation and a solution, what surrounds them counted in."""
    work, halves = 0, 1 if tiling.elimination.symmetric else 2
    for k, (below, right) in enumerate(zip(tiling.lower, tiling.upper, strict=True)):
        width = tiling.size(k)
        for i in below:
            for j in right:
                if i >= j or halves == 2:
                    work += width * tiling.size(min(i, j)) + _TERM
        work += (halves * len(below) + 1) * (_BLOCK + width * width // 2) + (len(below) + len(right)) * (width + _TERM)
    return work


def _gather(elimination: Elimination, zeros: int) -> tuple[int, ...]:
    """The first pivots of tiles of neighbours, as long as each has at most that many zeros on average; no tile of an empty matrix."""
    size, first = len(elimination.rows), [0]
    if not size:
        return (0,)
    for pivot in range(1, size):
        candidate = range(first[-1], pivot + 1)
        if len(candidate) > WIDTH or _zeros(elimination, candidate) > zeros * len(candidate):
            first.append(pivot)
    return (*first, size)


def _zeros(elimination: Elimination, pivots: range) -> int:
    """The zeros in the structure of the pivots when they share one."""
    count = 0
    for structure in (elimination.lower, elimination.upper):
        shared = set().union(*(structure[k] for k in pivots))
        count += sum(sum(i > k for i in shared) - len(structure[k]) for k in pivots)
    return count


def _tile(elimination: Elimination, first: tuple[int, ...]) -> Tiling:
    count = len(first) - 1
    tile_of = [t for t in range(count) for _ in range(first[t], first[t + 1])]
    below, right = [0] * count, [0] * count
    for k, t in enumerate(tile_of):
        for i in {tile_of[i] for i in elimination.lower[k]}:
            below[t] |= 1 << i
            right[i] |= 1 << t
        for j in {tile_of[j] for j in elimination.upper[k]}:
            right[t] |= 1 << j
            below[j] |= 1 << t
    lower, upper = fill(below, right)
    return Tiling(elimination=elimination, first=first, lower=lower, upper=upper)


def _by_level(tiling: Tiling) -> Tiling:
    """Sort the tiles by level: first all that nothing changes, then all that only these change, and so on."""
    level = [0] * len(tiling)
    for k in range(len(tiling)):
        for i in (*tiling.lower[k], *tiling.upper[k]):
            level[i] = max(level[i], level[k] + 1)
    order = sorted(range(len(tiling)), key=lambda k: (level[k], k))
    place = {tile: k for k, tile in enumerate(order)}
    first = [0]
    for tile in order:
        first.append(first[-1] + tiling.size(tile))

    def moved(structure: Sequence[Sequence[int]]) -> tuple[tuple[int, ...], ...]:
        return tuple(tuple(sorted(place[i] for i in structure[tile])) for tile in order)

    elimination = renumber(tiling.elimination, [k for tile in order for k in tiling.pivots(tile)])
    return Tiling(elimination=elimination, first=tuple(first), lower=moved(tiling.lower), upper=moved(tiling.upper))


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
