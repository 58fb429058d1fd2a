"""The parents of bodies in a spanning tree, and the subtrees that cut joints and gears connect.

A body of known motion counts as the one that carries it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

from cutjoint.model.records import GROUND, Gear, Joint
from cutjoint.topology.elimination import degrees
from cutjoint.topology.records import TreeJoint


class BodyGraph:
    """A spanning tree, cut joints and gears, and the bodies of unknown motion by the ones that carry them.

    ``top`` is each body's innermost body of the same motion but for known ones; ``carrier`` is the top that carries a top, ``carried`` the
    reverse.  ``linked`` has by carrier the pairs of bodies next to it whose subtrees a cut joint or a gear connects.  ``meets`` counts the
    cut joints and gears whose loops end at a body, ``open`` are the bodies of loops that end further in than the body's own carrier.
    The subtrees of ``tied`` bodies are connected with others beside them.  ``geared`` has by gear the two bodies that its joints carry.
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
            self.meets[self._link(self.path(self.top[cut.base]), self.path(self.top[cut.follower]))] += 1
        for ends in self.geared.values():
            first, last = map(self.path, ends)
            self.meets[self._link(first, last, below=1)] += 1

    def path(self, body: str) -> list[str]:
        """The bodies from one of unknown motion to the ground."""
        path = [body]
        while path[-1] != GROUND:
            path.append(self.carrier[path[-1]])
        return path

    def _link(self, first: list[str], last: list[str], below: int = 0) -> str:
        """The body where two paths to the ground meet, ``below`` or more bodies on; bodies further out than next to it are open."""
        meet = _meet(first[below:], last[below:])
        outside = [path[: path.index(meet)] for path in (first, last)]
        for path in outside:
            self.open.update(path[:-1])
        roots = [path[-1] for path in outside if path]
        if roots:
            self.linked[meet].append((roots[0], roots[-1]))
        if len(roots) > 1:
            self.tied.update(*outside)
        return meet

    def groups(self, carrier: str) -> list[list[str]]:
        """The bodies next to a carrier, those that cut joints and gears connect together."""
        if carrier not in self.linked:
            return [[body] for body in self.carried[carrier]]
        group = {body: body for body in self.carried[carrier]}
        for a, b in self.linked[carrier]:
            first, last = group[a], group[b]
            if first != last:
                group = {body: first if g == last else g for body, g in group.items()}
        members: dict[str, list[str]] = defaultdict(list)
        for body, g in group.items():
            members[g].append(body)
        return list(members.values())

    def inside(self, roots: Iterable[str]) -> set[str]:
        """The bodies of unknown motion of some subtrees."""
        inside = set(roots)
        for body, below in self.carrier.items():
            if below in inside:
                inside.add(body)
        return inside


def _meet(first: Sequence[str], last: Sequence[str]) -> str:
    known = set(last)
    return next(body for body in first if body in known)


def _turned(gear: Gear, tree: Sequence[TreeJoint]) -> tuple[str, str]:
    """The bodies that a gear's joints carry, twice the same where a guide moves the other one."""
    bodies = [t.child for name in gear.joints for t in tree if t.joint.name == name and degrees(t.joint)]
    return bodies[0], bodies[-1]
