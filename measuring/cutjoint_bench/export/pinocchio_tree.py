"""Mechanism -> a tree of elementary joints and contacts, as Pinocchio has them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cutjoint.model.records import GROUND, JointKind, Model, Scene
from cutjoint_bench.export.chains import Part, chain, frame, speeds, triple
from cutjoint_bench.export.independence import Row, independent_rows
from cutjoint_bench.export.laws import Array, Triple
from cutjoint_bench.export.records import Mechanism, PeerJoint, RigidBody

#: The ground in place of a joint.
NO_JOINT = -1
#: Cut joints that are contacts; others become joints of the tree on half of a body that is welded to its other half.
_CONTACTS = frozenset({JointKind.SPHERICAL, JointKind.REVOLUTE, JointKind.FIXED})


@dataclass(frozen=True, kw_only=True)
class TreeJoint:
    """An elementary joint of the tree on the joint number ``parent``, with its ``speeds`` at the start (as chains.speeds has them)."""

    name: str
    parent: int
    part: Part
    speeds: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Mass:
    """All or a ``share`` of the mass of a body, on a joint."""

    joint: int
    body: RigidBody
    share: float


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Two joints, -1 for the ground, whose points stay together, or their bodies altogether with ``weld``; places at the start."""

    name: str
    weld: bool
    first: int
    second: int
    on_first: Triple
    on_second: Triple


@dataclass(frozen=True, kw_only=True)
class Tree:
    """Joints, parents first.

    ``outermost`` is the joint that moves each rigid body, ``places`` that of each coordinate of the model's joints, by joint and number;
    ``split`` are bodies in parts, by the cut joint.
    """

    joints: tuple[TreeJoint, ...]
    masses: tuple[Mass, ...]
    contacts: tuple[Contact, ...]
    outermost: Mapping[str, int]
    places: Mapping[tuple[str, int], int]
    split: Mapping[str, str]


def build_tree(model: Model, scene: Scene, mechanism: Mechanism) -> Tree:
    """The tree with its contacts.
    A hinge has a second contact on its axis if the rest of its loop does not fix the body that turns it."""
    builder = _Builder(mechanism)
    for joint in mechanism.tree:
        builder.outermost[joint.child] = builder.add(joint)
    tilting = _tilting(model, scene, mechanism)
    contacts = tuple(contact for cut in mechanism.cuts for contact in builder.contacts(cut, cut.name in tilting))
    shares = Counter(builder.split.values())
    bodies = {body.name: body for body in mechanism.bodies}
    whole = [Mass(joint=builder.outermost[b.name], body=b, share=1 / (1 + shares[b.name])) for b in mechanism.bodies]
    parts = [Mass(joint=builder.halves[cut], body=bodies[name], share=1 / (1 + shares[name])) for cut, name in builder.split.items()]
    return _depth_first(
        Tree(
            joints=tuple(builder.joints), masses=(*whole, *parts), contacts=contacts, outermost=builder.outermost, places=builder.places,
            split=builder.split,
        )
    )  # fmt: skip


def _depth_first(tree: Tree) -> Tree:
    """The tree numbered so that each joint's subtree follows it, as Pinocchio's algorithms want it."""
    children: dict[int, list[int]] = {}
    for i, joint in enumerate(tree.joints):
        children.setdefault(joint.parent, []).append(i)
    order, waiting = [], children.get(NO_JOINT, [])[::-1]
    while waiting:
        order.append(waiting.pop())
        waiting += children.get(order[-1], [])[::-1]
    new = {NO_JOINT: NO_JOINT, **{old: number for number, old in enumerate(order)}}
    return Tree(
        joints=tuple(replace(tree.joints[i], parent=new[tree.joints[i].parent]) for i in order),
        masses=tuple(replace(mass, joint=new[mass.joint]) for mass in tree.masses),
        contacts=tuple(replace(c, first=new[c.first], second=new[c.second]) for c in tree.contacts),
        outermost={body: new[joint] for body, joint in tree.outermost.items()},
        places={place: new[joint] for place, joint in tree.places.items()}, split=tree.split,
    )  # fmt: skip


@dataclass(frozen=True)
class _Builder:
    mechanism: Mechanism
    joints: list[TreeJoint] = field(default_factory=list)
    outermost: dict[str, int] = field(default_factory=lambda: {GROUND: NO_JOINT})
    places: dict[tuple[str, int], int] = field(default_factory=dict)
    split: dict[str, str] = field(default_factory=dict)
    halves: dict[str, int] = field(default_factory=dict)

    def add(self, joint: PeerJoint) -> int:
        """Add the chain of a joint; the number of its last part."""
        parts, parent = chain(joint), self.outermost[joint.parent]
        values = list(speeds(self.mechanism, joint, parts))
        for i, part in enumerate(parts):
            count = {"ball": 3, "free": 6}.get(part.type, 1)
            name = joint.name if len(parts) == 1 else f"{joint.name}.{i}"
            self.joints.append(TreeJoint(name=name, parent=parent, part=part, speeds=tuple(values[:count])))
            values, parent = values[count:], len(self.joints) - 1
            if part.coordinate is not None:
                self.places[joint.name, part.coordinate] = parent
        return parent

    def contacts(self, cut: PeerJoint, tilts: bool) -> Iterator[Contact]:
        """Contacts that close a cut joint."""
        if cut.kind not in _CONTACTS:
            yield self.weld_half(cut)
            return
        weld = cut.kind is JointKind.FIXED and tilts
        points = [(cut.name, np.zeros(3))]
        if cut.kind is JointKind.REVOLUTE and tilts:
            way = self.reach(cut) * np.array(cut.base_axes[0])
            points = [(f"{cut.name}.first", way), (f"{cut.name}.second", -way)]
        for name, way in points:
            yield Contact(
                name=name, weld=weld, first=self.outermost[cut.base], second=self.outermost[cut.follower],
                on_first=triple(cut.base_point + way), on_second=triple(cut.follower_point + way),
            )  # fmt: skip

    def reach(self, cut: PeerJoint) -> float:
        """Distance from a hinge's point at which it is held: as far as the farther one of the centres of mass."""
        centres = [np.array(body.centre) for body in self.mechanism.bodies if body.name in (cut.base, cut.follower)]
        return max(float(np.linalg.norm(np.array(cut.base_point) - centre)) for centre in centres) or 1.0

    def weld_half(self, cut: PeerJoint) -> Contact:
        """Split the follower, or the base of one on the ground: a half moves on the cut joint and is welded to the other."""
        joint = replace(cut, reversed=True) if cut.follower == GROUND else cut
        half = self.halves[cut.name] = self.add(joint)
        self.split[cut.name] = joint.child
        centre = next(body.centre for body in self.mechanism.bodies if body.name == joint.child)
        other = self.outermost[joint.child]
        return Contact(name=cut.name, weld=True, first=half, second=other, on_first=centre, on_second=centre)


def _tilting(model: Model, scene: Scene, mechanism: Mechanism) -> set[str]:
    """The revolute and fixed cut joints that hold turns which nothing else holds, once all points are held."""
    cuts = [cut for cut in mechanism.cuts if cut.kind in _CONTACTS]
    points = [_row(cut, axis, cut.follower_point) for cut in cuts for axis in np.eye(3)]
    turns = [(cut, _row(cut, axis, None)) for cut in cuts for axis in _locked_turns(cut)]
    chosen = independent_rows(model, scene, mechanism, [*points, *(row for _, row in turns)])
    return {turns[i - len(points)][0].name for i in chosen if i >= len(points)}


def _locked_turns(cut: PeerJoint) -> Sequence[Sequence[float]]:
    if cut.kind is JointKind.REVOLUTE:
        return frame(np.array(cut.base_axes[0]))[:2]
    return np.eye(3).tolist() if cut.kind is JointKind.FIXED else ()


def _row(cut: PeerJoint, direction: Sequence[float] | Array, point: Triple | None) -> Row:
    return Row(base=cut.base, follower=cut.follower, direction=triple(np.array(direction)), point=point)
