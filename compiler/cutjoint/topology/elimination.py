"""The elimination of the joints played through on the body graph alone: which bodies it couples.

The graph of couplings is that of design equation (3): eliminating body i couples its parent and every
body that i is coupled to with each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cutjoint.model.records import GROUND, Joint
from cutjoint.topology.records import TreeJoint


def degrees(joint: Joint) -> int:
    """The unknown speeds of a joint: none where it is guided."""
    return 0 if joint.guide is not None else len(joint.element.speeds)


def eliminate(tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> Mapping[str, frozenset[str]]:
    """The bodies that each body is coupled to when its joint is eliminated, leaves first."""
    neighbours: dict[str, set[str]] = {t.child: set() for t in tree}
    for cut in cuts:
        if GROUND not in (cut.base, cut.follower):
            neighbours[cut.base].add(cut.follower)
            neighbours[cut.follower].add(cut.base)
    coupled: dict[str, frozenset[str]] = {}
    for t in reversed(tree):
        others = neighbours.pop(t.child)
        coupled[t.child] = frozenset(others)
        for body in others:
            neighbours[body].discard(t.child)
        clique = others | ({t.parent} - {GROUND})
        for body in clique:
            # a body without unknowns hands its couplings to its parent and makes none among the others
            partners = clique if degrees(t.joint) or body == t.parent else {t.parent} - {GROUND}
            neighbours[body] |= partners - {body}
    return coupled
