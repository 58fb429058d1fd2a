"""Corresponding blocks of isomorphic parts of a system, which lanes can compute side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from cutjoint.formulate.recursive.families import grouped_members, independent_classes
from cutjoint.program.blocks import Block
from cutjoint.program.fold import Family
from cutjoint.topology.records import Topology

#: What a block is: names of elements and nodes, and numbers among blocks that the same names lead to.
Key: TypeAlias = tuple[str | int, ...]


@dataclass(kw_only=True)
class Correspondence:
    """Blocks by what they are, in the terms of the model."""

    blocks: dict[Key, Block] = field(default_factory=dict)
    _counts: dict[Key, int] = field(default_factory=dict, repr=False)

    def record(self, *names: str, block: Block) -> Block:
        """Remember a block; blocks of the same names are numbered."""
        count = self._counts[names] = self._counts.get(names, -1) + 1
        self.blocks[*names, count] = block
        return block


def find_corresponding(correspondence: Correspondence, topology: Topology) -> list[Family]:
    """A family for every block of a class's first member that has a counterpart in all others."""
    families = []
    for members in (group for subtrees in independent_classes(topology) for group in grouped_members(subtrees.members)):
        counterparts = [dict(zip(members[0], member, strict=True)) for member in members]
        for key in correspondence.blocks:
            family = _family(key, correspondence.blocks, counterparts)
            if family is not None:
                families.append(family)
    return families


def _family(key: Key, blocks: Mapping[Key, Block], counterparts: list[dict[str, str]]) -> Family | None:
    members: list[Block] = []
    for names in counterparts:
        found = blocks.get(tuple(part if isinstance(part, int) else _renamed(part, names) for part in key))
        if found is None or found.shape != blocks[key].shape:
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
