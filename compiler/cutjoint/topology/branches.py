"""Branches that close on themselves: their joints are eliminated at once, in joint space.

A loop whose ends lie in a few subtrees of one body couples joints of these subtrees alone: not even the body that carries them is in its
equation, since only motion relative to it counts.  A gear couples two joints' speeds alone, so that every gear is in a branch.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from cutjoint.model.records import GROUND, Gear, Joint
from cutjoint.topology.elimination import degrees
from cutjoint.topology.records import Branch, TreeJoint

#: The most unknowns of a branch: the cost of a dense matrix grows with their cube, that of the recursion with their number.
MOST_UNKNOWNS = 12


def find_branches(tree: Sequence[TreeJoint], cuts: Sequence[Joint], gears: Sequence[Gear]) -> tuple[Branch, ...]:
    """The largest branches of at most MOST_UNKNOWNS unknowns, and the smallest of more that a gear needs, in the order of their first
    bodies."""
    graph = _Graph(tree, cuts, gears)
    order = {t.child: i for i, t in enumerate(tree)}
    return tuple(sorted(graph.branches(), key=lambda branch: order[branch.bodies[0]]))


class _Graph:
    """Who carries whom.  A body of known motion counts as the one that carries it."""

    def __init__(self, tree: Sequence[TreeJoint], cuts: Sequence[Joint], gears: Sequence[Gear]) -> None:
        self._tree, self._cuts = tree, cuts
        self._geared = {gear.name: self._turned(gear) for gear in gears}
        self._top = {GROUND: GROUND}
        self._carrier: dict[str, str] = {}
        self._carried: dict[str, list[str]] = defaultdict(list)
        for t in tree:
            self._top[t.child] = t.child if degrees(t.joint) else self._top[t.parent]
            if degrees(t.joint):
                self._carrier[t.child] = self._top[t.parent]
                self._carried[self._top[t.parent]].append(t.child)
        self._unknowns = self._summed({t.child: degrees(t.joint) for t in tree if degrees(t.joint)})
        self._linked: dict[str, list[tuple[str, str]]] = defaultdict(list)
        self._open: set[str] = set()
        meets: dict[str, int] = defaultdict(int)
        for cut in cuts:
            meets[self._link(self._path(self._top[cut.base]), self._path(self._top[cut.follower]))] += 1
        geared = [(self._path(first), self._path(last)) for first, last in self._geared.values()]
        for first, last in geared:
            meets[self._link(first, last, below=1)] += 1
        self._closed = self._summed(meets)
        self._needed = {root for first, last in geared for root in self._closed_roots(first, last)}

    def _turned(self, gear: Gear) -> tuple[str, str]:
        """The bodies that a gear's joints carry, twice the same where a guide moves the other one."""
        bodies = [t.child for name in gear.joints for t in self._tree if t.joint.name == name and degrees(t.joint)]
        return bodies[0], bodies[-1]

    def _summed(self, own: dict[str, int]) -> dict[str, int]:
        """Of each body and all that it carries."""
        total = {body: own.get(body, 0) for body in self._carrier}
        for body in reversed(self._carrier):
            if self._carrier[body] != GROUND:
                total[self._carrier[body]] += total[body]
        return total

    def _link(self, first: list[str], last: list[str], below: int = 0) -> str:
        """The body where two paths to the ground meet, ``below`` or more bodies on; bodies further out than next to it are open."""
        meet = next(body for body in first[below:] if body in last[below:])
        outside = [path[: path.index(meet)] for path in (first, last)]
        for path in outside:
            self._open.update(path[:-1])
        roots = [path[-1] for path in outside if path]
        if roots:
            self._linked[meet].append((roots[0], roots[-1]))
        return meet

    def _path(self, body: str) -> list[str]:
        path = [body]
        while path[-1] != GROUND:
            path.append(self._carrier[path[-1]])
        return path

    def _closed_roots(self, first: list[str], last: list[str]) -> list[str]:
        """The bodies of the innermost group with all of a gear that no joint opens: next to where the paths meet, or further in."""
        meet = next(body for body in first[1:] if body in last[1:])
        while True:
            group = next(roots for roots in self._groups(meet) if set(roots) & set(first))
            if not self._open & set(group):
                return group
            meet = self._carrier[meet]

    def branches(self) -> Iterator[Branch]:
        """From the ground outwards; within a branch none is looked for."""
        carriers = [GROUND]
        for carrier in carriers:
            for roots in self._groups(carrier):
                closed = sum(self._closed[root] for root in roots) + sum(a in roots for a, _ in self._linked[carrier])
                small = sum(self._unknowns[root] for root in roots) <= MOST_UNKNOWNS
                if closed and (small or self._needed & set(roots)) and not self._open & set(roots):
                    yield self._branch(carrier, set(roots))
                else:
                    carriers += roots

    def _groups(self, carrier: str) -> list[list[str]]:
        """The bodies next to a carrier, those that cut joints connect together."""
        group = {body: body for body in self._carried[carrier]}
        for a, b in self._linked[carrier]:
            first, last = group[a], group[b]
            if first != last:
                group = {body: first if g == last else g for body, g in group.items()}
        members: dict[str, list[str]] = defaultdict(list)
        for body, g in group.items():
            members[g].append(body)
        return list(members.values())

    def _branch(self, carrier: str, roots: set[str]) -> Branch:
        inside = set(roots)
        for body, below in self._carrier.items():
            if below in inside:
                inside.add(body)
        bodies = tuple(t.child for t in self._tree if self._top[t.child] in inside)
        cuts = tuple(c.name for c in self._cuts if inside & {self._top[c.base], self._top[c.follower]})
        gears = tuple(name for name, (first, _) in self._geared.items() if first in inside)
        return Branch(carrier=carrier, bodies=bodies, cuts=cuts, gears=gears)
