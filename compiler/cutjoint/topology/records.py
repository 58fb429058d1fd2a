"""The records of the body graph.

The elimination of the joints played through on the body graph alone: which bodies it couples.

The graph of couplings is that of design equation (3): eliminating body i couples its parent and every
body that i is coupled to with each other.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from cutjoint.elements.joint import Ball
from cutjoint.model.records import GROUND, Gear, Joint, Model

WIDEST = 4  #: the largest number of lanes: double precision numbers in a vector register of 256 bits


@dataclass(frozen=True, kw_only=True)
class TreeJoint:
    """A joint of the spanning tree, seen from its inner body; ``reversed`` if the tree passes from its follower to its base."""

    joint: Joint
    parent: str
    child: str
    reversed: bool

    @property
    def has_columns_behind_ball(self) -> bool:
        """Return whether motions of the joint follow its ball, which turns their columns."""
        chain = self.joint.element.chain_from_inner(self.reversed)
        return self.joint.element.has_ball and not isinstance(chain[-1], Ball)


@dataclass(frozen=True, kw_only=True)
class Loop:
    """The loop that a cut joint closes: ``bodies`` of both branches below ``base``, their deepest common ancestor.
    ``width`` is the largest number of bodies to which an eliminated body of the loop is coupled."""

    cut: str
    base: str
    bodies: tuple[str, ...]
    width: int


@dataclass(frozen=True, kw_only=True)
class Branch:
    """Subtrees below ``carrier`` that cut joints and gears connect with each other; ``bodies``, parents first.
    ``cuts`` and ``gears`` are names.  Cut joints may connect them with one body more, their ``hub``, whose own branch is named by it."""

    carrier: str
    bodies: tuple[str, ...]
    cuts: tuple[str, ...]
    gears: tuple[str, ...] = ()
    hub: str = ""


@dataclass(frozen=True, kw_only=True)
class SubtreeClass:
    """Isomorphic parts, each a subtree or several that cut joints and gears connect.
    ``roots`` are the first of their innermost bodies, ``size`` is the number of bodies in each.

    ``members`` are the elements of each part (bodies, tree joints, cut joints, gears, forces), corresponding ones in the same place.
    ``independent`` is whether one body carries them all and they are coupled through it and its carriers only.
    """

    roots: tuple[str, ...]
    size: int
    members: tuple[tuple[str, ...], ...]
    independent: bool

    @property
    def lanes(self) -> tuple[tuple[tuple[str, ...], ...], ...]:
        """The sizes of groups that are evaluated together: four and two, since registers hold powers of two."""
        groups, first, width = [], 0, WIDEST if self.independent else 1
        while len(self.members) - first > 1 < width:
            while width > len(self.members) - first:
                width //= 2
            groups.append(self.members[first : first + width])
            first += width
        return tuple(groups)


@dataclass(frozen=True, kw_only=True)
class Topology:
    """The spanning tree (parents first), the cut joints, and quantities derived from them.
    ``embedded`` are the joints that loop embedding closes. ``arm``: see `topology.geometry.arm_of`."""

    model: Model
    tree: tuple[TreeJoint, ...]
    cuts: tuple[Joint, ...]
    loops: tuple[Loop, ...]
    branches: tuple[Branch, ...]
    classes: tuple[SubtreeClass, ...]
    embedded: tuple[Joint, ...] = ()
    arm: float = 1.0

    def __repr__(self) -> str:
        loops = f"{len(self.cuts)} cut joints, {len(self.loops)} loops, {len(self.classes)} classes of isomorphic subtrees"
        return f"<Topology of '{self.model.name}': {len(self.tree)} tree joints, {loops}>"

    @property
    def closing(self) -> tuple[Joint | Gear, ...]:
        """The elements that have equations: the cut joints, then the model's gears."""
        return (*self.cuts, *self.model.gears)

    @property
    def ends_on_massless(self) -> bool:
        """Whether all loop closures join massless bodies, so that penalties are scaled by the kinetic energy.
        See runtime/include/cutjoint/core/mechanism/effective_mass.hpp."""
        massless, joints = {b.name for b in self.model.bodies if b.is_massless}, {j.name: j for j in self.model.joints}
        ends = [[e] if isinstance(e, Joint) else [joints[name] for name in e.joints] for e in self.closing]
        return bool(ends) and all(any({j.base, j.follower} & massless for j in around) for around in ends)

    @property
    def order(self) -> tuple[str, ...]:
        """The bodies, parents first."""
        return tuple(t.child for t in self.tree)

    @property
    def joint_of(self) -> Mapping[str, TreeJoint]:
        """Each body's joint to its parent."""
        return {t.child: t for t in self.tree}


def degrees(joint: Joint) -> int:
    """The number of unknown speeds of a joint: 0 if it is guided."""
    return 0 if joint.guide is not None else len(joint.element.speeds)


def grouped(bodies: Iterable[str], pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """For each body the first of those that pairs connect it with, directly or through others."""
    order = {body: i for i, body in enumerate(bodies)}
    group = {body: body for body in order}
    for pair in pairs:
        first, last = sorted((group[body] for body in pair), key=order.__getitem__)
        if first != last:
            group = {body: first if g == last else g for body, g in group.items()}
    return group


def reached(pairs: Iterable[tuple[str, str]]) -> set[str]:
    """The ground, and the bodies that pairs connect with it, directly or through others."""
    pairs, found, before = tuple(pairs), {GROUND}, 0
    while len(found) > before:
        before = len(found)
        for pair in pairs:
            if not found.isdisjoint(pair):
                found.update(pair)
    return found


def joints_inwards(above: Mapping[str, TreeJoint], body: str) -> list[TreeJoint]:
    """The tree joints from a body inwards as far as ``above`` has them by the bodies that they carry."""
    path: list[TreeJoint] = []
    while body in above:
        path.append(above[body])
        body = above[body].parent
    return path


def bodies_inwards(above: Mapping[str, TreeJoint], body: str) -> list[str]:
    """A body and those that carry it, inwards."""
    return [body, *(t.parent for t in joints_inwards(above, body))]


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
            # a body without unknowns passes its couplings to its parent and adds none between others
            partners = clique if degrees(t.joint) or body == t.parent else {t.parent} - {GROUND}
            neighbours[body] |= partners - {body}
    return coupled
