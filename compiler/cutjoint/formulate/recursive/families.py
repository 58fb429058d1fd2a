"""Corresponding blocks of isomorphic subtrees, found by the names that the formulation gave them."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.model.records import GROUND
from cutjoint.program.blocks import Block, Builder
from cutjoint.program.fold import Family
from cutjoint.topology.elimination import degrees
from cutjoint.topology.records import SubtreeClass, Topology

#: Members side by side: what a vector register of 256 bits holds in double precision.
WIDEST = 4


def find_families(builder: Builder, topology: Topology) -> list[Family]:
    """One family for every label that names an element of a class's first member and has a counterpart in all others.

    Only classes whose members touch nothing but what carries them all are taken: a chain's members follow from each other.
    Large classes are divided into groups of four and two members, since registers hold powers of two.
    """
    blocks = {label: block for block, label in builder.labels.items()}
    families = []
    for members in (group for subtrees in independent_classes(topology) for group in grouped_members(subtrees.members)):
        counterparts = [
            {_identifier(mine): _identifier(theirs) for mine, theirs in zip(members[0], member, strict=True)} for member in members
        ]
        for label, block in blocks.items():
            family = _family(label, block, blocks, counterparts)
            if family is not None:
                families.append(family)
    return families


def independent_classes(topology: Topology) -> list[SubtreeClass]:
    """The classes whose members are coupled through their common ancestors only."""
    return [c for c in topology.classes if all(_touched(topology, m) <= _carriers(topology, c) for m in c.members)]


def _touched(topology: Topology, member: tuple[str, ...]) -> set[str]:
    """The outside bodies of a member's joints; a body whose motion is known counts as the one that carries it."""
    joint_of = topology.joint_of
    bodies = {b for c in topology.cuts if c.name in member for b in (c.base, c.follower)}
    touched = {joint_of[member[0]].parent}
    for body in bodies - set(member):
        while body != GROUND and degrees(joint_of[body].joint) == 0:
            body = joint_of[body].parent
        touched.add(body)
    return touched


def _carriers(topology: Topology, subtrees: SubtreeClass) -> set[str]:
    """The ground and the bodies on the way to all of the class's roots."""
    joint_of = topology.joint_of
    common: set[str] | None = None
    for root in subtrees.roots:
        path, body = {GROUND}, joint_of[root].parent
        while body != GROUND:
            path.add(body)
            body = joint_of[body].parent
        common = path if common is None else common & path
    return common or {GROUND}


def grouped_members(members: tuple[tuple[str, ...], ...]) -> list[tuple[tuple[str, ...], ...]]:
    """Members in groups of four and two, those that go into one register together."""
    groups, first, width = [], 0, WIDEST
    while len(members) - first > 1:
        while width > len(members) - first:
            width //= 2
        groups.append(members[first : first + width])
        first += width
    return groups


def _family(label: str, block: Block, blocks: dict[str, Block], counterparts: Sequence[dict[str, str]]) -> Family | None:
    symbol, _, rest = label.partition("_")
    members: list[Block] = []
    for names in counterparts:
        found = blocks.get(f"{symbol}_{_renamed(rest, names)}")
        if found is None or found.shape != block.shape:
            return None
        members.append(found)
    return tuple(members) if any(m is not block for m in members) else None


def _renamed(rest: str, names: dict[str, str]) -> str:
    """A label's elements with those of the class's first member replaced by another member's."""
    for mine in sorted(names, key=len, reverse=True):
        if rest == mine or rest.startswith(f"{mine}_") or rest.endswith(f"_{mine}"):
            return rest.replace(mine, names[mine], 1)
    return rest


def _identifier(element: str) -> str:
    return element.replace(".", "_")
