"""Branches that close on themselves: their joints are eliminated at once, in joint space.

A loop whose ends lie in a few subtrees of one body couples joints of these subtrees alone: not even the body that carries them is in its
equation, since only motion relative to it counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cutjoint.model.records import GROUND, Joint
from cutjoint.topology.elimination import degrees
from cutjoint.topology.records import Branch, TreeJoint

#: The most unknowns of a branch: the cost of a dense matrix grows with their cube, that of the recursion with their number.
MOST_UNKNOWNS = 9


def find_branches(tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> tuple[Branch, ...]:
    """The largest branches of at most MOST_UNKNOWNS unknowns, outermost carriers last."""
    below = _Below(tree)
    branches: list[Branch] = []
    for carrier in (GROUND, *(t.child for t in tree if degrees(t.joint))):
        taken = {b for branch in branches for b in branch.bodies}
        if carrier not in taken:
            branches += [b for b in below.branches(carrier, cuts) if below.unknowns(b.bodies) <= MOST_UNKNOWNS]
    return tuple(branches)


class _Below:
    """Who is below whom, bodies of known motion counting as those that carry them."""

    def __init__(self, tree: Sequence[TreeJoint]) -> None:
        self._joint = {t.child: t for t in tree}

    def unknowns(self, bodies: Sequence[str]) -> int:
        return sum(degrees(self._joint[b].joint) for b in bodies)

    def top(self, body: str) -> str:
        """The body that carries this one, itself unless its motion is known."""
        while body != GROUND and degrees(self._joint[body].joint) == 0:
            body = self._joint[body].parent
        return body

    def root(self, body: str, carrier: str) -> str | None:
        """The body on the way to the carrier whose joint is next to it; None where the carrier is not on the way."""
        body = self.top(body)
        while body not in (GROUND, carrier):
            parent = self.top(self._joint[body].parent)
            if parent == carrier:
                return body
            body = parent
        return None

    def branches(self, carrier: str, cuts: Sequence[Joint]) -> list[Branch]:
        """Its subtrees that are closed in themselves, by connected ones."""
        roots = {t.child: self.root(t.child, carrier) for t in self._joint.values()}
        group = {root: root for root in roots.values() if root is not None}
        open_roots, inside = set(), []
        for cut in cuts:
            ends = [(body, roots.get(body)) for body in (cut.base, cut.follower)]
            found = [root for _, root in ends if root is not None]
            if any(root is None and self.top(body) != carrier for body, root in ends):
                open_roots.update(found)
            elif found:
                inside.append((cut, found[0]))
                first, last = group[found[0]], group[found[-1]]
                group = {root: first if g == last else g for root, g in group.items()}
        chosen = [g for g in dict.fromkeys(group.values()) if not any(group[r] == g for r in open_roots)]
        return [b for g in chosen if (b := self._branch(carrier, g, roots, group, inside)).cuts]

    def _branch(
        self, carrier: str, chosen: str, roots: Mapping[str, str | None], group: Mapping[str, str], inside: Sequence[tuple[Joint, str]]
    ) -> Branch:  # fmt: skip
        bodies = tuple(b for b, root in roots.items() if root is not None and group[root] == chosen)
        return Branch(carrier=carrier, bodies=bodies, cuts=tuple(cut.name for cut, root in inside if group[root] == chosen))
