"""Branches that close on themselves: their joints are eliminated at once, in joint space.

A loop whose ends lie in a few subtrees of one body couples joints of these subtrees alone: not even the body that carries them is in its
equation, since only motion relative to it counts.  A gear couples two joints' speeds alone, so that every gear is in a branch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from cutjoint.model.records import GROUND
from cutjoint.topology.body_graph import BodyGraph
from cutjoint.topology.elimination import degrees
from cutjoint.topology.records import Branch

#: The most unknowns of a branch: the cost of a dense matrix grows with their cube, that of the recursion with their number.
MOST_UNKNOWNS = 12


def find_branches(graph: BodyGraph) -> tuple[Branch, ...]:
    """The largest branches of at most MOST_UNKNOWNS unknowns, and the smallest of more that a gear needs, in the order of their first
    bodies."""
    order = {t.child: i for i, t in enumerate(graph.tree)}
    return tuple(sorted(_Search(graph).branches(), key=lambda branch: order[branch.bodies[0]]))


class _Search:
    """Looks for branches from the ground outwards."""

    def __init__(self, graph: BodyGraph) -> None:
        self._graph = graph
        self._unknowns = self._summed({t.child: degrees(t.joint) for t in graph.tree})
        self._closed = self._summed(graph.meets)
        self._needed = {root for first, last in graph.geared.values() for root in self._closed_roots(graph.path(first), graph.path(last))}

    def _summed(self, counts: Mapping[str, int]) -> dict[str, int]:
        """The sum of counts over each body and all that it carries."""
        carrier = self._graph.carrier
        total = {body: counts.get(body, 0) for body in carrier}
        for body in reversed(carrier):
            if carrier[body] != GROUND:
                total[carrier[body]] += total[body]
        return total

    def _closed_roots(self, first: list[str], last: list[str]) -> list[str]:
        """The bodies of the innermost group with all of a gear that no joint opens: next to where the paths meet, or further in."""
        meet = next(body for body in first[1:] if body in last[1:])
        while True:
            group = next(roots for roots in self._graph.groups(meet) if set(roots) & set(first))
            if not self._graph.open & set(group):
                return group
            meet = self._graph.carrier[meet]

    def branches(self) -> Iterator[Branch]:
        """The branches from the ground outwards; within a branch none is looked for."""
        carriers = [GROUND]
        for carrier in carriers:
            for roots in self._graph.groups(carrier):
                closed = sum(self._closed[root] for root in roots) + sum(a in roots for a, _ in self._graph.linked[carrier])
                small = sum(self._unknowns[root] for root in roots) <= MOST_UNKNOWNS
                if closed and (small or self._needed & set(roots)) and not self._graph.open & set(roots):
                    yield self._branch(carrier, roots)
                else:
                    carriers += roots

    def _branch(self, carrier: str, roots: Sequence[str]) -> Branch:
        top, inside = self._graph.top, self._graph.inside(roots)
        bodies = tuple(t.child for t in self._graph.tree if top[t.child] in inside)
        cuts = tuple(c.name for c in self._graph.cuts if inside & {top[c.base], top[c.follower]})
        gears = tuple(name for name, (first, _) in self._graph.geared.items() if first in inside)
        return Branch(carrier=carrier, bodies=bodies, cuts=cuts, gears=gears)
