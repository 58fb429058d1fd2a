"""The partition of systems of equations into independent parts and a border of some unknowns."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

_ROW = 40  #: operations that a row of a part takes besides those of its elimination, times three


def part(size: int, entries: Iterable[tuple[int, int]], together: Sequence[Collection[int]]) -> list[int]:
    """The part of each of ``size`` unknowns, by the non-zero entries (row, column) of a matrix; the last part is the border.
    Unknowns of a group of ``together`` stay in one part. Groups are moved to the border one by one, each time the one that minimises the
    operations of a decomposition."""
    neighbours = [{i} for i in range(size)]
    for row, column in entries:
        neighbours[row].add(column)
        neighbours[column].add(row)
    border: set[int] = set()
    best = _components(neighbours, border)
    while tries := [border.union(group) for group in together if border.isdisjoint(group)]:
        found = [(_cost(parts := _components(neighbours, each), len(each)), i, parts) for i, each in enumerate(tries)]
        least, i, parts = min(found)
        if least >= _cost(best, len(border)):
            break
        border, best = tries[i], parts
    place = dict.fromkeys(border, len(best)) | {i: number for number, component in enumerate(best) for i in component}
    return [place[i] for i in range(size)]


@dataclass(frozen=True)
class AlignedParts:
    """Parts with equal patterns of entries, side by side.
    ``parts`` are those of unknowns, numbered such that four, two or one that are computed together are consecutive, the border last;
    ``numbers`` are these widths. For each width, ``groups`` has the entries (row, column) at the same place in all its parts."""

    parts: Sequence[int]
    numbers: Sequence[int]
    groups: Sequence[Sequence[tuple[tuple[int, int], ...]]]


def align_parts(parts: Sequence[int], entries: Sequence[tuple[int, int]], unknown: Mapping[int, int]) -> AlignedParts:
    """The parts of `part` side by side; columns that belong to an ``unknown`` are in the matrix."""
    border = max(parts, default=0)
    places = _ranks(enumerate(parts))
    ranks = _ranks((column, parts[i]) for column, i in sorted(unknown.items()))
    found: list[dict[tuple[bool, int, bool, int], tuple[int, int]]] = [{} for _ in range(border)]
    for row, column in entries:
        of_row, of_column = parts[row], parts[unknown[column]] if column in unknown else border
        if (p := min(of_row, of_column)) < border:
            key = of_row == p, places[row] if of_row == p else row, of_column == p, ranks[column] if of_column == p else column
            found[p][key] = row, column
    alike: defaultdict[object, list[int]] = defaultdict(list)
    for p, of_part in enumerate(found):
        shape = frozenset(key for key, (_, column) in of_part.items() if column in unknown)
        alike[parts.count(p), shape].append(p)
    rows = [list(same[i : i + width]) for same in alike.values() for i, width in _widths(len(same))]
    number = {p: i for i, p in enumerate(p for row in rows for p in row)} | {border: border}
    groups = [
        [tuple(found[p][key] for p in row) for key in sorted(found[row[0]]) if all(key in found[p] for p in row)] if len(row) > 1 else []
        for row in rows
    ]
    return AlignedParts([number[p] for p in parts], [*map(len, rows), 1], [*groups, []])


def _ranks(of_parts: Iterable[tuple[int, int]]) -> dict[int, int]:
    """The place of each number among those of its part."""
    counts: defaultdict[int, int] = defaultdict(int)
    found = {}
    for i, p in of_parts:
        found[i] = counts[p]
        counts[p] += 1
    return found


def _widths(number: int) -> Iterable[tuple[int, int]]:
    """The fours, twos and ones that make up a number: where each begins, and how many it is."""
    at = 0
    for width in (4, 2, 1):
        while number - at >= width:
            yield at, width
            at += width


def _components(neighbours: Sequence[Collection[int]], border: Collection[int]) -> list[list[int]]:
    """The connected components of the unknowns without a border, largest first."""
    seen, found = set(border), []
    for first in range(len(neighbours)):
        if first in seen:
            continue
        seen.add(first)
        component = [first]
        for i in component:
            fresh = [j for j in neighbours[i] if j not in seen]
            seen.update(fresh)
            component += fresh
        found.append(sorted(component))
    return sorted(found, key=len, reverse=True)


def _cost(parts: Sequence[Sequence[int]], border: int) -> int:
    """Three times the operations of a decomposition."""
    inside = sum(n**3 + 3 * n * n * border + 3 * n * border * border + _ROW * (n + border) for n in map(len, parts))
    return inside + border**3
