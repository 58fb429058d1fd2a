"""Which joints form the tree and which are cut."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass

from cutjoint.model.records import GROUND, Joint, Model
from cutjoint.topology.cuts import CutRules, find_rules, joints_around, shortest_paths, torn_bodies, wrong_cuts
from cutjoint.topology.elimination import degrees, eliminate
from cutjoint.topology.operations import predict_operations
from cutjoint.topology.records import TreeJoint


class TopologyError(ValueError):
    """The graph cannot be spanned as the model asks."""


def span(model: Model) -> tuple[tuple[TreeJoint, ...], tuple[Joint, ...]]:
    """The tree joints, parents first, and the cut joints in the file's order.

    Given cuts are honoured.  Where loops stay, the compiler cuts: it starts from the tree of shortest paths to the ground and
    exchanges a cut joint for a tree joint of its loop as long as that lowers the cost, see ``cost_of``.

    Raises:
        TopologyError: the given cuts tear a body off, or joints that must not be cut close a loop.
    """
    joints, rules = [j for j in model.joints if j.cut is not True], find_rules(model)
    chosen = shortest_paths(joints, [*rules.stay, *rules.uses])
    if problems := list(torn_bodies(model.bodies, joints, chosen)):
        raise TopologyError("\n".join(problems))
    tree, cuts = split(model, _improve(model, joints, chosen, rules))
    if problems := list(wrong_cuts(rules, tree, cuts)):
        raise TopologyError("\n".join(problems))
    return tree, cuts


@dataclass(frozen=True, kw_only=True, order=True)
class Cost:
    """What a choice of cut joints costs; the first difference decides.

    ``width`` is the largest number of bodies to which an eliminated body is coupled, ``operations`` are predicted for one evaluation,
    ``redundant`` counts the cut joints that align a direction by three equations, of which two are independent.
    """

    width: int
    operations: int
    redundant: int


def cost_of(model: Model, tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> Cost:
    """The cost of a spanning tree and its cut joints."""
    coupled = eliminate(tree, cuts)
    return Cost(
        width=max((len(s) for s in coupled.values()), default=0), operations=predict_operations(model, tree, cuts, coupled),
        redundant=sum(c.element.shared_direction is not None for c in cuts),
    )  # fmt: skip


def split(model: Model, chosen: set[str]) -> tuple[tuple[TreeJoint, ...], tuple[Joint, ...]]:
    """The tree that the chosen joints form, parents first, and the others in the file's order."""
    return _orient([j for j in model.joints if j.name in chosen]), tuple(j for j in model.joints if j.name not in chosen)


def _improve(model: Model, joints: Sequence[Joint], chosen: set[str], rules: CutRules) -> set[str]:
    best, price = chosen, _judge(model, chosen, rules)
    improved = True
    while improved:
        improved = False
        for candidate in _exchanges(model, joints, best, rules.stay):
            judged = _judge(model, candidate, rules)
            if judged < price:
                best, price, improved = candidate, judged, True
                break
    return best


def _judge(model: Model, chosen: set[str], rules: CutRules) -> tuple[int, int, Cost]:
    """Wrong cuts, then forces on the coordinates of cut joints, which cost nothing in the tree, then the cost."""
    tree, cuts = split(model, chosen)
    return rules.faults(tree, cuts), rules.forces_on(cuts), cost_of(model, tree, cuts)


def _exchanges(model: Model, joints: Sequence[Joint], chosen: set[str], stay: Container[str]) -> Iterable[set[str]]:
    """Every tree that differs from the chosen one by one exchange of a compiler's cut joint for a joint of its loop."""
    tree, _ = split(model, chosen)
    for cut in (j for j in joints if j.name not in chosen):
        for t in joints_around(tree, cut):
            if t.joint.name not in stay:
                yield (chosen - {t.joint.name}) | {cut.name}


def _orient(joints: Sequence[Joint]) -> tuple[TreeJoint, ...]:
    """The joints as seen from the ground, depth first in the file's order, so that a subtree stands together; what moves in a known
    way comes last, so that it is eliminated first and its couplings merge."""
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
    """The joints that lead on from a body, last first."""
    return [
        TreeJoint(joint=j, parent=body, child=j.follower if j.base == body else j.base, reversed=j.base != body)
        for j in reversed(at.get(body, [])) if j.name != arrived
    ]  # fmt: skip
