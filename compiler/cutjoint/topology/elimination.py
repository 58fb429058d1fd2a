"""The elimination of the joints played through on the body graph alone: couplings, loop width, predicted operations.

The graph of couplings is that of design equation (3): eliminating body i couples its parent and every
body that i is coupled to with each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cutjoint.model.records import GROUND, SPEEDS, Joint
from cutjoint.topology.records import TreeJoint


@dataclass(frozen=True, kw_only=True)
class Elimination:
    """The bodies that each body is coupled to when its joint is eliminated, and the predicted operations of all of it."""

    coupled: Mapping[str, frozenset[str]]
    operations: int


def degrees(joint: Joint) -> int:
    """The unknown speeds of a joint: none where it is guided."""
    return 0 if joint.guide is not None else len(SPEEDS[joint.kind])


def eliminate(tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> Elimination:
    """Play the elimination through, leaves first."""
    neighbours: dict[str, set[str]] = {t.child: set() for t in tree}
    for cut in cuts:
        if GROUND not in (cut.base, cut.follower):
            neighbours[cut.base].add(cut.follower)
            neighbours[cut.follower].add(cut.base)
    coupled: dict[str, frozenset[str]] = {}
    operations = 0
    for t in reversed(tree):
        others = neighbours.pop(t.child)
        coupled[t.child] = frozenset(others)
        operations += _operations(degrees(t.joint), len(others - {t.parent}))
        for body in others:
            neighbours[body].discard(t.child)
        clique = others | ({t.parent} - {GROUND})
        for body in clique:
            neighbours[body] |= clique - {body}
    return Elimination(coupled=coupled, operations=operations)


def _operations(degrees: int, coupled: int) -> int:
    """Operations of one body with k unknowns coupled to s bodies besides its parent: M b, C^T b and the symmetric updates."""
    blocks = coupled + 1
    return 66 * degrees * blocks + 42 * degrees * blocks + 72 * degrees * coupled * blocks // 2 + 21 + 36 * coupled
