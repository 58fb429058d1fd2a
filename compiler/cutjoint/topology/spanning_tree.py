"""Spanning trees of the body graph, and what they cost: operations of one evaluation, predicted from the body graph alone.

What a joint's kinematics and a cut joint's equations take is part of the catalogue of elements.  What the condensation takes is counted
from its formulas (formulate/recursive/), with dense blocks in body space and with zero blocks in the matrix of a branch.  Forces are left
out: they cost the same whatever is cut.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field

from cutjoint.model.errors import ModelError
from cutjoint.model.records import GROUND, Joint, Model
from cutjoint.topology.body_graph import BodyGraph
from cutjoint.topology.classes import find_independent_classes
from cutjoint.topology.records import Branch, TreeJoint, degrees, eliminate, joints_inwards, reached

# Predicted operations

BODY = 135  #: mass matrix, weight and inertia force of a body
#: Of an equation of a cut joint in a branch: residual, stabilisation, multiplier.  Of a gear between unguided joints in a branch.
EQUATION, GEAR = 30, 19
#: For a body in a branch: composite mass and force.  For each unknown of its joint: the column G = M^c S.
CARRIED, COLUMN = 30, 25
#: For two unknowns in one path to the ground: an entry of H.  For an equation and an unknown: an entry of J.
ENTRY, SLOPE = 8, 8


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Operations of one evaluation without forces: lanes counted one by one, and lanes counted once."""

    all_lanes: int
    counted_once: int


def predict_operations(model: Model, tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> Prediction:
    """The predicted operations of a choice of cut joints, also of choices that the rules forbid; gears of cut joints are left out."""
    joints = {t.joint.name for t in tree}
    graph = BodyGraph(tree, cuts, [gear for gear in model.gears if joints.issuperset(gear.joints)])
    shares = _shares(model, graph)
    total = sum(shares.values())
    groups = (group for found in find_independent_classes(model, graph) for group in found.lanes)
    repeated = sum(shares[name] for group in groups for member in group[1:] for name in member)
    return Prediction(all_lanes=total, counted_once=total - repeated)


def _shares(model: Model, graph: BodyGraph) -> Counter[str]:
    """The operations by body and cut joint; those of a branch belong to its first body."""
    tree, cuts = graph.tree, graph.cuts
    coupled = eliminate(tree, cuts)
    still = reached((t.parent, t.child) for t in tree if degrees(t.joint) == 0)
    upright = reached((t.parent, t.child) for t in tree if t.joint.element.keeps_attitude)
    moving = [t for t in tree if t.child not in still]
    turning = {t.child for t in moving} - upright
    massive = {b.name for b in model.bodies if not b.is_massless}
    within = {body for branch in graph.branches for body in branch.bodies}
    inside = {name for branch in graph.branches for name in branch.cuts}
    shares = Counter(dict.fromkeys(massive & turning, BODY))
    for t in moving:
        shares[t.child] += t.joint.element.operations.placing[t.parent in turning]
        if t.child not in within:
            shares[t.child] += _condensation(t, coupled[t.child] - still, t.parent not in still)
    shares.update(_closing(tree, [cut for cut in cuts if cut.name not in inside], still))
    shares.update({branch.bodies[0]: _branched(branch, graph, massive) for branch in graph.branches})
    return shares


def _closing(tree: Sequence[TreeJoint], cuts: Sequence[Joint], still: set[str]) -> dict[str, int]:
    root = {GROUND: GROUND}
    for t in tree:
        root[t.child] = t.child if t.parent == GROUND else root[t.parent]
    return {
        cut.name: cut.element.operations.closing[0 if {cut.base, cut.follower} & still else 1 + (root[cut.base] != root[cut.follower])]
        for cut in cuts if not {cut.base, cut.follower} <= still
    }  # fmt: skip


def _condensation(t: TreeJoint, others: frozenset[str], inner: bool) -> int:
    """Operations of eliminating a body and of back substitution; it is coupled to ``others``, ``inner`` if its parent moves."""
    k, s = degrees(t.joint), len(others)
    passed_on = (27 + 36 * s) * inner
    if k == 0:
        return passed_on
    is_ball = t.joint.element.is_ball
    linked = len(others | {t.parent}) if inner and not is_ball else s
    factor = k**3 // 3 + k + 6 * k * (k - 1) * linked
    updates = 60 * k * linked + 36 * k * linked * (linked - 1)
    drift = 66 * (1 + s) * inner
    way_back = 12 * k * (linked + 1)
    return (_ball(s, inner) if is_ball else _projection(t, s, inner)) + factor + drift + updates + passed_on + way_back


def _ball(s: int, inner: bool) -> int:
    """Operations of a ball about its centre: inertia, moments of s couplings, and the contribution to a moving parent."""
    return 40 + 120 * inner + (70 + 90 * inner) * s


def _projection(t: TreeJoint, s: int, inner: bool) -> int:
    """Operations of b^T M b and b^T C for s couplings, by the nonzero rows of b."""
    if t.joint.element.is_free and not inner:
        return 0
    k, width = degrees(t.joint), 5 if t.joint.element.keeps_attitude or not inner else 11
    return width * (6 * k * (1 + s) + k * (k + 1) // 2)


def _branched(branch: Branch, graph: BodyGraph, massive: set[str]) -> int:
    """Operations of composing and factorising the matrix of a branch, of what it passes on, and of its way back.
    A body that neither has mass nor carries any adds nothing to it but its equations."""
    joint_of = {t.child: t for t in graph.tree if t.child in branch.bodies}
    carriers = {body: [t.child for t in joints_inwards(joint_of, body)] for body in branch.bodies}
    unknowns = {body: degrees(joint_of[body].joint) for body in branch.bodies}
    laden = {i for j in branch.bodies if j in massive for i in carriers[j]}
    coupled = {j: {i for i in carriers[j] if i != j and j in laden} for j in branch.bodies}
    total = sum(CARRIED + COLUMN * unknowns[j] for j in laden)
    total += sum(ENTRY * unknowns[i] * unknowns[j] for j in laden for i in carriers[j])
    for cut in (c for c in graph.cuts if c.name in branch.cuts):
        moved = set(carriers.get(cut.base, ())) ^ set(carriers.get(cut.follower, ()))
        m, w = 6 - len(cut.element.speeds), sum(unknowns[body] for body in moved)
        total += m * (EQUATION + SLOPE * w + w * (w + 1) + 6 * w)
        for body in moved:
            coupled[body] |= moved - {body}
    below = _coupled_unknowns(branch.bodies, unknowns, coupled)
    total += sum(r * (r + 2) + 8 * r for later in below.values() for r in later)
    if branch.carrier != GROUND:
        total += sum(12 * r + 78 for j in laden for r in below[j])
    if branch.hub:
        shared = sum(degrees(t.joint) for t in graph.tree if t.child == branch.hub)
        total += shared * sum(2 * r + 14 for later in below.values() for r in later)
    return total + GEAR * len(branch.gears)


def _coupled_unknowns(bodies: Sequence[str], unknowns: Mapping[str, int], coupled: Mapping[str, set[str]]) -> dict[str, list[int]]:
    """The unknowns, eliminated later, that each unknown of a body is coupled to; leaves are eliminated first."""
    neighbours = {body: set(others) for body, others in coupled.items()}
    for body, others in coupled.items():
        for other in others:
            neighbours[other].add(body)
    found = {}
    for body in reversed(bodies):
        others = neighbours.pop(body)
        for other in others:
            neighbours[other] = (neighbours[other] | others) - {other, body}
        outside = sum(unknowns[other] for other in others)
        found[body] = [outside + i for i in reversed(range(unknowns[body]))]
    return found


class TopologyError(ModelError):
    """The graph has no spanning tree with the cuts of the model."""


@dataclass(frozen=True, kw_only=True, order=True)
class Cost:
    """The cost of a choice of cut joints. ``counted_once`` are the operations predicted for one evaluation, those side by side in lanes
    counted once: the time that it takes, by which choices compare. ``operations`` has all lanes counted. ``redundant`` counts the cut
    joints that align a direction by three equations, of which two are independent."""

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
    from_follower, from_base = joints_inwards(above, cut.follower), joints_inwards(above, cut.base)
    while from_follower and from_base and from_follower[-1] is from_base[-1]:
        del from_follower[-1], from_base[-1]
    return from_follower + from_base[::-1]


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
