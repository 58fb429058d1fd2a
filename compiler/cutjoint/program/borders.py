"""Systems of equations that fall apart but for a border of some unknowns."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence


def part(size: int, entries: Iterable[tuple[int, int]], together: Sequence[Collection[int]]) -> list[int]:
    """The part of each of so many unknowns, by the rows and columns of a matrix that are not always zero; those of the last part are in the
    border.

    Unknowns of a group of ``together`` stay in one part.  Groups come into the border one after the other, each time the one with which a
    decomposition takes fewest operations.
    """
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


def _components(neighbours: Sequence[Collection[int]], border: Collection[int]) -> list[list[int]]:
    """The unknowns beside a border, by what they reach one another through, the largest lists first."""
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


#: Operations that a row of a part takes besides those of its elimination, times three.
_ROW = 40


def _cost(parts: Sequence[Sequence[int]], border: int) -> int:
    """Three times the operations of a decomposition."""
    inside = sum(n**3 + 3 * n * n * border + 3 * n * border * border + _ROW * (n + border) for n in map(len, parts))
    return inside + border**3
