"""The order of what uses each other, and circles in it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter


def in_order(uses: Mapping[str, Iterable[str]]) -> tuple[list[str], list[list[str]]]:
    """The names, each behind those that it uses, and the circles: in each a name uses the next one, and the last one the first.

    A circle begins with the one of its names that stands first in ``uses``; the names of circles are left out of the order.
    """
    place = {name: i for i, name in enumerate(uses)}
    graph = {name: sorted(others, key=place.__getitem__) for name, others in uses.items()}
    circles: list[list[str]] = []
    while True:
        try:
            return list(TopologicalSorter(graph).static_order()), circles
        except CycleError as error:
            circle = error.args[1][:0:-1]
            first = min(range(len(circle)), key=lambda i: place[circle[i]])
            circles.append(circle[first:] + circle[:first])
            found = {name for each in circles for name in each}
            graph = {name: [x for x in others if x not in found] for name, others in graph.items() if name not in found}
