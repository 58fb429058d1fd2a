"""From a model to its topology."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from cutjoint.model.records import Joint, Model
from cutjoint.topology.body_graph import BodyGraph
from cutjoint.topology.classes import find_classes
from cutjoint.topology.geometry import arm_of
from cutjoint.topology.records import Loop, Topology, TreeJoint, bodies_inwards, eliminate
from cutjoint.topology.search import span


def build_topology(model: Model) -> Topology:
    """Span the body graph, close its loops, and find its repeated parts.

    Raises:
        TopologyError: the model's own cuts cannot be honoured.
    """
    tree, closing = span(model).parts
    closed = {name for embedded_loop in model.embedded_loops for name in embedded_loop.cuts}
    arm = arm_of(model)
    cuts = tuple(replace(joint, arm=arm) for joint in closing if joint.name not in closed)
    coupled = eliminate(tree, cuts)
    loops = tuple(_loop(cut, tree, coupled) for cut in cuts)
    return Topology(
        model=model, tree=tree, cuts=cuts, loops=loops, branches=BodyGraph(tree, cuts, model.gears).branches,
        classes=find_classes(model, BodyGraph(tree, closing, model.gears)),
        embedded=tuple(joint for joint in closing if joint.name in closed), arm=arm,
    )  # fmt: skip


def _loop(cut: Joint, tree: Sequence[TreeJoint], coupled: Mapping[str, frozenset[str]]) -> Loop:
    above = {t.child: t for t in tree}
    left, right = bodies_inwards(above, cut.base), bodies_inwards(above, cut.follower)
    base = next(b for b in left if b in right)
    bodies = (*left[: left.index(base)], *right[: right.index(base)])
    width = max((len(coupled[b]) for b in bodies), default=0)
    return Loop(cut=cut.name, base=base, bodies=bodies, width=width)
