"""Corresponding blocks of isomorphic subtrees, which lanes can compute side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from cutjoint.model.records import GROUND
from cutjoint.program.blocks import Block, Quantity
from cutjoint.program.fold import Family
from cutjoint.topology.elimination import degrees
from cutjoint.topology.records import SubtreeClass, Topology

#: Members side by side: what a vector register of 256 bits holds in double precision.
WIDEST = 4


def find_corresponding(quantities: Mapping[Quantity, Block], topology: Topology) -> list[Family]:
    """A family for every quantity of a class's first member that has a counterpart in all others.

    Only classes whose members touch nothing but what carries them all are taken: a chain's members follow from each other.
    Large classes are divided into groups of four and two members, since registers hold powers of two.
    """
    families = []
    for members in (group for subtrees in _independent_classes(topology) for group in _grouped(subtrees.members)):
        counterparts = [dict(zip(members[0], member, strict=True)) for member in members]
        for quantity in quantities:
            family = _family(quantity, quantities, counterparts)
            if family is not None:
                families.append(family)
    return families


def _independent_classes(topology: Topology) -> list[SubtreeClass]:
    """The classes whose members are coupled through their common ancestors only."""
    return [c for c in topology.classes if all(_touched(topology, m) <= _carriers(topology, c) for m in c.members)]


def _touched(topology: Topology, member: tuple[str, ...]) -> set[str]:
    """The outside bodies of a member's joints; a body whose motion is known counts as the one that carries it."""
    joint_of = topology.joint_of
    bodies = {b for c in topology.cuts if c.name in member for b in (c.base, c.follower)}
    geared = {name for g in topology.model.gears if g.name in member for name in g.joints}
    bodies |= {t.child for t in topology.tree if t.joint.name in geared}
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


def _grouped(members: tuple[tuple[str, ...], ...]) -> list[tuple[tuple[str, ...], ...]]:
    """Members in groups of four and two, those that go into one register together."""
    groups, first, width = [], 0, WIDEST
    while len(members) - first > 1:
        while width > len(members) - first:
            width //= 2
        groups.append(members[first : first + width])
        first += width
    return groups


def _family(quantity: Quantity, quantities: Mapping[Quantity, Block], counterparts: list[dict[str, str]]) -> Family | None:
    members: list[Block] = []
    for names in counterparts:
        found = quantities.get(replace(quantity, parts=tuple(_renamed(part, names) for part in quantity.parts)))
        if found is None or found.shape != quantities[quantity].shape:
            return None
        members.append(found)
    return tuple(members) if any(m is not members[0] for m in members) else None


def _renamed(name: str, names: Mapping[str, str]) -> str:
    """The name of an element, or of a node called after one, in another member."""
    end = len(name)
    while end > 0:
        if name[:end] in names:
            return names[name[:end]] + name[end:]
        end = name.rfind(".", 0, end)
    return name
