"""Spanning trees of the body graph, and what they cost."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field

from cutjoint.model.errors import ModelError
from cutjoint.model.records import GROUND, Joint, Model
from cutjoint.topology.operations import predict_operations
from cutjoint.topology.records import TreeJoint, degrees


class TopologyError(ModelError):
    """The graph has no spanning tree with the cuts of the model."""


@dataclass(frozen=True, kw_only=True, order=True)
class Cost:
    """The cost of a choice of cut joints.

    ``counted_once`` are the operations predicted for one evaluation, those side by side in lanes counted once: the time that it takes,
    by which choices compare.  ``operations`` has all lanes counted.  ``redundant`` counts the cut joints that align a direction by three
    equations, of which two are independent.
    """

    counted_once: int
    operations: int = field(compare=False)
    redundant: int = field(compare=False)


def cost_of(model: Model, tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> Cost:
    """The cost of a spanning tree and its cut joints."""
    predicted = predict_operations(model, tree, cuts)
    return Cost(
        counted_once=predicted.counted_once, operations=predicted.all_lanes,
        redundant=sum(c.element.shared_direction is not None for c in cuts),
    )  # fmt: skip


def split(model: Model, cut: Container[str]) -> tuple[tuple[TreeJoint, ...], tuple[Joint, ...]]:
    """The tree without the joints of the names ``cut``, parents first, and these in the file's order."""
    return _orient([j for j in model.joints if j.name not in cut]), tuple(j for j in model.joints if j.name in cut)


def loops_of(tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> dict[str, list[TreeJoint]]:
    """The tree joints of each cut joint's loop by its name, from its follower to its base."""
    above = {t.child: t for t in tree}
    return {cut.name: _around(above, cut) for cut in cuts}


def joints_around(tree: Sequence[TreeJoint], cut: Joint) -> list[TreeJoint]:
    """The tree joints around the loop of one cut joint."""
    return loops_of(tree, [cut])[cut.name]


def _around(above: Mapping[str, TreeJoint], cut: Joint) -> list[TreeJoint]:
    from_follower, from_base = _path_to_ground(above, cut.follower), _path_to_ground(above, cut.base)
    while from_follower and from_base and from_follower[-1] is from_base[-1]:
        del from_follower[-1], from_base[-1]
    return from_follower + from_base[::-1]


def _path_to_ground(above: Mapping[str, TreeJoint], body: str) -> list[TreeJoint]:
    path: list[TreeJoint] = []
    while body != GROUND:
        path.append(above[body])
        body = above[body].parent
    return path


def _orient(joints: Sequence[Joint]) -> tuple[TreeJoint, ...]:
    """The joints as seen from the ground, depth first in the file's order.
    Bodies of known motion come last, so that they are eliminated first and their couplings merge."""
    at: dict[str, list[Joint]] = {}
    for joint in sorted(joints, key=lambda j: degrees(j) == 0):
        at.setdefault(joint.base, []).append(joint)
        at.setdefault(joint.follower, []).append(joint)
    tree: list[TreeJoint] = []
    stack = _outwards(GROUND, "", at)
    while stack:
        t = stack.pop()
        tree.append(t)
        stack.extend(_outwards(t.child, t.joint.name, at))
    return tuple(tree)


def _outwards(body: str, arrived: str, at: dict[str, list[Joint]]) -> list[TreeJoint]:
    """The joints that lead outwards from a body, last first."""
    return [
        TreeJoint(joint=j, parent=body, child=j.follower if j.base == body else j.base, reversed=j.base != body)
        for j in reversed(at.get(body, [])) if j.name != arrived
    ]  # fmt: skip
