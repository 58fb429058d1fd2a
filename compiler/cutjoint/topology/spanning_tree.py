"""Which joints form the tree and which are cut."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

from cutjoint.model.records import GROUND, Joint, Model
from cutjoint.topology.cuts import problems_of_cuts, reasons_to_stay, shortest_paths
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
    joints = [j for j in model.joints if j.cut is not True]
    bound = tree_only(model)
    chosen = shortest_paths(joints, bound)
    if problems := list(problems_of_cuts(model.bodies, joints, chosen, bound)):
        raise TopologyError("\n".join(problems))
    chosen = _improve(model, joints, chosen, bound)
    return split(model, chosen)


def tree_only(model: Model) -> Mapping[str, str]:
    """The joints that must not be cut, and why."""
    return reasons_to_stay(model)


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


def _improve(model: Model, joints: Sequence[Joint], chosen: set[str], bound: Container[str]) -> set[str]:
    best, cost = chosen, cost_of(model, *split(model, chosen))
    improved = True
    while improved:
        improved = False
        for candidate in _exchanges(model, joints, best, bound):
            price = cost_of(model, *split(model, candidate))
            if price < cost:
                best, cost, improved = candidate, price, True
                break
    return best


def _exchanges(model: Model, joints: Sequence[Joint], chosen: set[str], bound: Container[str]) -> Iterable[set[str]]:
    """Every tree that differs from the chosen one by one exchange of a compiler's cut joint for a joint of its loop."""
    tree, _ = split(model, chosen)
    for cut in (j for j in joints if j.name not in chosen):
        for t in joints_around(tree, cut):
            if t.joint.name not in bound:
                yield (chosen - {t.joint.name}) | {cut.name}


def joints_around(tree: Sequence[TreeJoint], cut: Joint) -> list[TreeJoint]:
    """The tree joints of a cut joint's loop, from its follower round to its base."""
    above = {t.child: t for t in tree}
    from_follower, from_base = _way_in(above, cut.follower), _way_in(above, cut.base)
    while from_follower and from_base and from_follower[-1] is from_base[-1]:
        del from_follower[-1], from_base[-1]
    return from_follower + from_base[::-1]


def _way_in(above: dict[str, TreeJoint], body: str) -> list[TreeJoint]:
    way: list[TreeJoint] = []
    while body != GROUND:
        way.append(above[body])
        body = above[body].parent
    return way


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
