"""Groups of elements explained together: counterparts in isomorphic parts, and elements of one and the same form."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeAlias

from cutjoint.topology.records import SubtreeClass

#: Names of elements that play the same part, one for each member of a class.
Counterparts: TypeAlias = tuple[str, ...]


def find_counterparts(subtree_class: SubtreeClass) -> tuple[Counterparts, ...]:
    """The elements of a class' members side by side: bodies, tree joints, cut joints, gears, forces.

    An element that belongs to two members of the class is named with the first only.
    """
    rows, known = [], set[str]()
    for row in zip(*subtree_class.members, strict=True):
        fresh = tuple(name for name in dict.fromkeys(row) if name not in known)
        known.update(fresh)
        if fresh:
            rows.append(fresh)
    return tuple(rows)


def group(
    names: Sequence[str], counterparts: Iterable[Counterparts], kind: Callable[[str], Hashable], form: Callable[[str], Hashable]
) -> tuple[tuple[str, ...], ...]:
    """The names in groups of one kind: counterparts together, and groups whose first elements have the same form."""
    first = {name: row[0] for row in counterparts for name in row}
    by_first: dict[Hashable, list[str]] = {}
    for name in names:
        by_first.setdefault((kind(name), first.get(name, name)), []).append(name)
    by_form: dict[Hashable, list[str]] = {}
    for members in by_first.values():
        by_form.setdefault((kind(members[0]), form(members[0])), []).extend(members)
    return tuple(tuple(members) for members in by_form.values())
