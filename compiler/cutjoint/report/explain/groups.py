"""Which elements are explained together: counterparts in isomorphic subtrees, and elements of one and the same form."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeAlias

from cutjoint.model.records import GROUND
from cutjoint.topology.classes import force_bodies, joint_ends
from cutjoint.topology.records import SubtreeClass, Topology

#: Names of elements that play the same part, one for each member of a class.
Counterparts: TypeAlias = tuple[str, ...]


def find_counterparts(topology: Topology, subtree_class: SubtreeClass) -> tuple[Counterparts, ...]:
    """The elements of a class' subtrees side by side: bodies, tree joints, cut joints, forces.

    An element that belongs to two subtrees of the class is named with the first only.
    """
    members = [_elements(topology, root) for root in subtree_class.roots]
    rows, known = [], set[str]()
    for row in zip(*members, strict=True):
        fresh = tuple(name for name in dict.fromkeys(row) if name not in known)
        known.update(fresh)
        if fresh:
            rows.append(fresh)
    return tuple(rows)


def bodies_of(topology: Topology, root: str) -> tuple[str, ...]:
    """The bodies of a subtree, innermost first, then breadth by breadth."""
    bodies = [root]
    for body in bodies:
        bodies.extend(t.child for t in topology.tree if t.parent == body)
    return tuple(bodies)


def _elements(topology: Topology, root: str) -> list[str]:
    """The names of a subtree's elements, in an order that isomorphic subtrees share."""
    bodies = bodies_of(topology, root)
    joint_of = topology.joint_of
    joints = [joint_of[b].joint.name for b in bodies]
    place = {b: i for i, b in enumerate(bodies)}

    def where(body: str) -> int:
        return place.get(body, -2 if body == GROUND else -1)

    ends = joint_ends(topology.tree, topology.cuts)
    cuts = sorted(((c.kind, where(c.base), where(c.follower)), i) for i, c in enumerate(topology.cuts))
    forces = sorted(
        ((type(f).__name__, tuple(where(b) for b in force_bodies(f, ends))), i) for i, f in enumerate(topology.model.forces)
    )
    inside = [topology.cuts[i].name for key, i in cuts if max(key[1:]) >= 0]
    return [*bodies, *joints, *inside, *(topology.model.forces[i].name for key, i in forces if max(key[1]) >= 0)]


def group(
    names: Sequence[str], counterparts: Iterable[Counterparts], kind: Callable[[str], Hashable], form: Callable[[str], Hashable]
) -> tuple[tuple[str, ...], ...]:
    """The names in groups of one kind: counterparts together, and groups whose first elements have the same form."""
    first = {name: row[0] for row in counterparts for name in row}
    by_first: dict[Hashable, list[str]] = {}
    for name in names:
        by_first.setdefault((kind(name), first.get(name, name)), []).append(name)
    by_form: dict[Hashable, list[str]] = {}
    for members in by_first.values():
        by_form.setdefault((kind(members[0]), form(members[0])), []).extend(members)
    return tuple(tuple(members) for members in by_form.values())
