"""The parents of bodies in a spanning tree, and the subtrees that cut joints and gears connect.

A body of known motion counts as the one that carries it.

Branches that close on themselves: their joints are eliminated at once, in joint space.

A loop whose ends lie in a few subtrees of one body couples joints of these subtrees alone: not even the body that carries them is in its
equation, since only motion relative to it counts.  A gear couples two joints' speeds alone, so that every gear is in a branch.

Where one body that carries nothing connects several subtrees, as the rack of an axle that steers, they are branches of their own around
this hub: they share equations with it, and none with each other.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

from cutjoint.model.records import GROUND, Gear, Joint
from cutjoint.topology.records import Branch, TreeJoint, degrees, grouped

MOST_UNKNOWNS = 12  #: the largest number of unknowns of a branch: a dense matrix costs their cube, the recursion their number


class BodyGraph:
    """A spanning tree, cut joints and gears, and the bodies of unknown motion by the ones that carry them.

    ``top`` is each body's innermost body of the same motion but for known ones; ``carrier`` is the top that carries a top, ``carried`` the
    reverse.  ``linked`` has by carrier the pairs of bodies next to it whose subtrees a cut joint or a gear connects.  ``meets`` counts the
    cut joints and gears whose loops end at a body, ``open`` are the bodies of loops that end further in than the body's own carrier.
    The subtrees of ``tied`` bodies are connected with others beside them.  ``geared`` has by gear the bodies that its joints carry.
    """

    def __init__(self, tree: Sequence[TreeJoint], cuts: Sequence[Joint], gears: Sequence[Gear]) -> None:
        self.tree, self.cuts, self.gears = tuple(tree), tuple(cuts), tuple(gears)
        self.top = {GROUND: GROUND}
        self.carrier: dict[str, str] = {}
        self.carried: dict[str, list[str]] = defaultdict(list)
        for t in tree:
            self.top[t.child] = t.child if degrees(t.joint) else self.top[t.parent]
            if degrees(t.joint):
                self.carrier[t.child] = self.top[t.parent]
                self.carried[self.top[t.parent]].append(t.child)
        self.geared = {gear.name: _turned(gear, tree) for gear in gears}
        self.linked: dict[str, list[tuple[str, str]]] = defaultdict(list)
        self.open: set[str] = set()
        self.tied: set[str] = set()
        self.meets: dict[str, int] = defaultdict(int)
        for cut in cuts:
            self.meets[self._link([self.path(self.top[cut.base]), self.path(self.top[cut.follower])])] += 1
        for ends in self.geared.values():
            self.meets[self._link([self.path(end) for end in ends], below=1)] += 1

    def path(self, body: str) -> list[str]:
        """The bodies from one of unknown motion to the ground."""
        path = [body]
        while path[-1] != GROUND:
            path.append(self.carrier[path[-1]])
        return path

    def _link(self, paths: list[list[str]], below: int = 0) -> str:
        """Connect the paths where they meet, ``below`` or more bodies on; bodies further out than its children are open."""
        meet = _meet([path[below:] for path in paths])
        outside = [path[: path.index(meet)] for path in paths]
        for path in outside:
            self.open.update(path[:-1])
        roots = [path[-1] for path in outside if path]
        self.linked[meet] += [(roots[0], root) for root in roots[1:] or roots]
        if len(roots) > 1:
            self.tied.update(*outside)
        return meet

    @cached_property
    def branches(self) -> tuple[Branch, ...]:
        """The largest branches of at most MOST_UNKNOWNS unknowns, those around a hub, and the smallest larger ones that a gear needs.
        They are in the order of their first bodies."""
        order = {t.child: i for i, t in enumerate(self.tree)}
        return tuple(sorted(_Search(self).branches(), key=lambda branch: order[branch.bodies[0]]))

    def groups(self, carrier: str, without: str = "") -> list[list[str]]:
        """The children of a carrier, except one, in groups that cut joints and gears connect."""
        if carrier not in self.linked:
            return [[body] for body in self.carried[carrier]]
        bodies = (body for body in self.carried[carrier] if body != without)
        group = grouped(bodies, (pair for pair in self.linked[carrier] if without not in pair))
        members: dict[str, list[str]] = defaultdict(list)
        for body, g in group.items():
            members[g].append(body)
        return list(members.values())

    def inside(self, roots: Iterable[str]) -> set[str]:
        """The bodies of unknown motion in some subtrees."""
        inside = set(roots)
        for body, below in self.carrier.items():
            if below in inside:
                inside.add(body)
        return inside


def _meet(paths: Sequence[Sequence[str]]) -> str:
    known = set(paths[-1]).intersection(*paths[1:])
    return next(body for body in paths[0] if body in known)


def _turned(gear: Gear, tree: Sequence[TreeJoint]) -> tuple[str, ...]:
    """The bodies that a gear's joints carry, without guided ones; a single body is listed twice."""
    bodies = tuple(t.child for name in gear.joints for t in tree if t.joint.name == name and degrees(t.joint))
    return bodies if len(bodies) > 1 else 2 * bodies


class _Search:
    def __init__(self, graph: BodyGraph) -> None:
        self._graph = graph
        self._unknowns = self._summed({t.child: degrees(t.joint) for t in graph.tree})
        self._closed = self._summed(graph.meets)
        self._needed = {root for ends in graph.geared.values() for root in self._closed_roots([graph.path(end) for end in ends])}

    def _summed(self, counts: Mapping[str, int]) -> dict[str, int]:
        """The sum of counts over the subtree of each body."""
        carrier = self._graph.carrier
        total = {body: counts.get(body, 0) for body in carrier}
        for body in reversed(carrier):
            if carrier[body] != GROUND:
                total[carrier[body]] += total[body]
        return total

    def _closed_roots(self, paths: list[list[str]]) -> list[str]:
        """The bodies of the innermost group with all of a gear that no joint opens: next to where the paths meet, or further in."""
        meet = _meet([path[1:] for path in paths])
        while True:
            group = next(roots for roots in self._graph.groups(meet) if set(roots) & set(paths[0]))
            if not self._graph.open & set(group):
                return group
            meet = self._graph.carrier[meet]

    def branches(self) -> Iterator[Branch]:
        """The branches from the ground outwards; within a branch none is looked for."""
        carriers = [GROUND]
        for carrier in carriers:
            for roots in self._graph.groups(carrier):
                closed = sum(self._closed[root] for root in roots) + sum(a in roots for a, _ in self._graph.linked[carrier])
                if not closed or self._graph.open & set(roots):
                    carriers += roots
                elif self._is_small(roots) or self._needed & set(roots):
                    yield self._branch(carrier, roots)
                elif (found := self._around_hub(carrier, roots)) is not None:
                    hub, parts = found
                    branches = [replace(self._branch(carrier, part), hub=hub) for part in parts]
                    own = self._branch(carrier, [hub])
                    shared = {name for branch in branches for name in branch.cuts}
                    yield replace(own, cuts=tuple(name for name in own.cuts if name not in shared))
                    yield from branches
                else:
                    carriers += roots

    def _is_small(self, roots: Iterable[str]) -> bool:
        return sum(self._unknowns[root] for root in roots) <= MOST_UNKNOWNS

    def _around_hub(self, carrier: str, roots: Sequence[str]) -> tuple[str, list[list[str]]] | None:
        """The body of some roots that carries nothing and connects parts of the others, each small, and these parts."""
        neighbours: dict[str, set[str]] = defaultdict(set)
        for a, b in self._graph.linked[carrier]:
            neighbours[a].add(b)
            neighbours[b].add(a)
        for hub in roots:
            if len(neighbours[hub] - {hub}) < 2 or self._graph.carried.get(hub):
                continue
            parts = [part for part in self._graph.groups(carrier, without=hub) if part[0] in roots]
            if len(parts) > 1 and all(self._is_small(part) for part in [[hub], *parts]):
                return hub, parts
        return None

    def _branch(self, carrier: str, roots: Sequence[str]) -> Branch:
        top, inside = self._graph.top, self._graph.inside(roots)
        bodies = tuple(t.child for t in self._graph.tree if top[t.child] in inside)
        cuts = tuple(c.name for c in self._graph.cuts if inside & {top[c.base], top[c.follower]})
        gears = tuple(name for name, (first, *_) in self._graph.geared.items() if first in inside)
        return Branch(carrier=carrier, bodies=bodies, cuts=cuts, gears=gears)
