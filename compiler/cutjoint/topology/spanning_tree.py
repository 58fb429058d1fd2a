"""Which joints form the tree and which are cut."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from cutjoint.model.records import GROUND, Joint, JointForce, JointKind, Model
from cutjoint.topology.elimination import degrees, eliminate
from cutjoint.topology.records import TreeJoint


class TopologyError(ValueError):
    """The graph cannot be spanned as the model asks."""


def span(model: Model) -> tuple[tuple[TreeJoint, ...], tuple[Joint, ...]]:
    """The tree joints, parents first, and the cut joints in the file's order.

    Given cuts are honoured.  Where loops stay, the compiler cuts: it starts from the tree of shortest paths to the ground and
    exchanges a cut joint for a tree joint of its loop as long as that makes the widest loop narrower or, at equal width, the
    predicted operations fewer.

    Raises:
        TopologyError: the given cuts tear a body off, or joints that must not be cut close a loop.
    """
    joints = [j for j in model.joints if j.cut is not True]
    bound = tree_only(model)
    chosen = _shortest_paths(joints, bound)
    _check(model, joints, chosen, bound)
    chosen = _improve(model, joints, chosen, bound)
    tree = _orient(model, [j for j in joints if j.name in chosen])
    return tree, tuple(j for j in model.joints if j.name not in chosen)


def tree_only(model: Model) -> frozenset[str]:
    """The joints whose coordinates are used, so that they cannot be cut: wanted in the tree, guided, with a force on the coordinate, with
    an initial coordinate or speed, reported; and free joints, which close nothing."""
    wanted = {j.name for j in model.joints if j.cut is False or j.guide is not None or j.kind is JointKind.FREE}
    forced = {f.joint for f in model.forces if isinstance(f, JointForce)}
    names = {j.name for j in model.joints}
    used: set[str] = set()
    for scene in model.scenes.values():
        used |= {key.rpartition(".")[0] for key in (*scene.positions, *scene.rates)} | {o.element for o in scene.outputs}
    return frozenset(wanted | forced | (used & names))


def _shortest_paths(joints: Sequence[Joint], bound: frozenset[str]) -> set[str]:
    """A breadth-first tree; joints that must not be cut go first."""
    known, chosen = {GROUND}, set()
    for candidates in ([j for j in joints if j.name in bound], joints):
        queue = deque(sorted(known))
        while queue:
            body = queue.popleft()
            for joint in candidates:
                other = _other(joint, body)
                if other is not None and other not in known:
                    known.add(other)
                    chosen.add(joint.name)
                    queue.append(other)
    return chosen


def _other(joint: Joint, body: str) -> str | None:
    if joint.base == body:
        return joint.follower
    return joint.base if joint.follower == body else None


def _check(model: Model, joints: Sequence[Joint], chosen: set[str], bound: frozenset[str]) -> None:
    reached = {GROUND} | {b for j in joints if j.name in chosen for b in (j.base, j.follower)}
    problems = [
        f"{b.span}: body '{b.name}': the cut joints tear it off the ground; leave one of its joints uncut"
        for b in model.bodies if b.name not in reached
    ] + [
        f"{j.span}: joint '{j.name}': it closes a loop but must not be cut, since its coordinate is used; "
        "leave another joint of the loop free to be cut"
        for j in joints if j.name not in chosen and j.name in bound
    ]  # fmt: skip
    if problems:
        raise TopologyError("\n".join(problems))


def _improve(model: Model, joints: Sequence[Joint], chosen: set[str], bound: frozenset[str]) -> set[str]:
    best, cost = chosen, _cost(model, joints, chosen)
    improved = True
    while improved:
        improved = False
        for candidate in _exchanges(joints, best, bound):
            price = _cost(model, joints, candidate)
            if price < cost:
                best, cost, improved = candidate, price, True
                break
    return best


def _cost(model: Model, joints: Sequence[Joint], chosen: set[str]) -> tuple[int, int]:
    tree = _orient(model, [j for j in joints if j.name in chosen])
    cuts = [j for j in model.joints if j.name not in chosen]
    elimination = eliminate(tree, cuts)
    return max((len(s) for s in elimination.coupled.values()), default=0), elimination.operations


def _exchanges(joints: Sequence[Joint], chosen: set[str], bound: frozenset[str]) -> Iterable[set[str]]:
    """Every tree that differs from the chosen one by one exchange of a compiler's cut joint for a joint of its loop."""
    for cut in (j for j in joints if j.name not in chosen):
        for name in _loop(joints, chosen, cut):
            if name not in bound:
                yield (chosen - {name}) | {cut.name}


def _loop(joints: Sequence[Joint], chosen: set[str], cut: Joint) -> list[str]:
    """The tree joints on the way from the cut joint's base to its follower."""
    came: dict[str, tuple[str, str]] = {cut.base: ("", "")}
    queue = deque([cut.base])
    while queue:
        body = queue.popleft()
        for joint in joints:
            other = _other(joint, body) if joint.name in chosen else None
            if other is not None and other not in came:
                came[other] = (body, joint.name)
                queue.append(other)
    path, body = [], cut.follower
    while body != cut.base:
        body, name = came[body]
        path.append(name)
    return path


def _orient(model: Model, joints: Sequence[Joint]) -> tuple[TreeJoint, ...]:
    """The joints as seen from the ground, depth first in the file's order, so that a subtree stands together."""
    tree: list[TreeJoint] = []
    stack = [GROUND]
    placed: set[str] = set()
    while stack:
        body = stack.pop()
        found = [j for j in joints if j.name not in placed and body in (j.base, j.follower)]
        arrived = [t for t in tree if t.child == body]
        assert body == GROUND or arrived, body
        for joint in found:
            child = joint.follower if joint.base == body else joint.base
            placed.add(joint.name)
            tree.append(TreeJoint(joint=joint, parent=body, child=child, reversed=joint.base != body))
        stack.extend(t.child for t in reversed(tree[len(tree) - len(found) :]))
    return _depth_first(tree)


def _depth_first(tree: Sequence[TreeJoint]) -> tuple[TreeJoint, ...]:
    """Subtrees together; what moves in a known way comes last, so that it is eliminated first and its couplings merge."""
    children: dict[str, list[TreeJoint]] = {}
    for t in sorted(tree, key=lambda t: degrees(t.joint) == 0):
        children.setdefault(t.parent, []).append(t)
    ordered: list[TreeJoint] = []
    stack = list(reversed(children.get(GROUND, [])))
    while stack:
        t = stack.pop()
        ordered.append(t)
        stack.extend(reversed(children.get(t.child, [])))
    return tuple(ordered)
