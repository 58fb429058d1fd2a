"""Which joints may be cut, and whether the others span a tree."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence

from cutjoint.model.records import GROUND, Body, Joint, JointForce, Model


def reasons_to_stay(model: Model) -> Mapping[str, str]:
    """Why joints stay in the tree, by their names: free joints, which close nothing, and those whose coordinates are used."""
    reasons: dict[str, str] = {}
    for scene in model.scenes.values():
        for output in scene.outputs:
            reasons[output.element] = f"scene '{scene.name}' has its coordinate among the outputs"
        for key in (*scene.positions, *scene.rates):
            reasons[key.rpartition(".")[0]] = f"scene '{scene.name}' gives its coordinate or speed"
    reasons |= {name: f"gear '{gear.name}' couples its coordinate" for gear in model.gears for name in gear.joints}
    acting = [force for force in model.force_elements if isinstance(force, JointForce)]
    reasons |= {force.joint: f"force '{force.name}' acts on its coordinate" for force in acting}
    names = {joint.name for joint in model.joints}
    for joint in model.joints:
        if not joint.element.closes:
            reasons[joint.name] = f"a {joint.kind} joint closes no loop"
        elif joint.guide is not None:
            reasons[joint.name] = "it has a guide"
        elif joint.cut is False:
            reasons[joint.name] = "it has cut: false"
    return {name: reason for name, reason in reasons.items() if name in names}


def shortest_paths(joints: Sequence[Joint], bound: Iterable[str]) -> set[str]:
    """A breadth-first tree of joints that are not cut; ``bound`` ones, which must not be cut, count as no distance, so that it has all of
    them unless they close a loop."""
    known: set[str] = set()
    chosen: set[str] = set()
    kept = set(bound)
    held = [j for j in joints if j.name in kept]
    queue = deque(sorted(_reach(GROUND, held, known, chosen)))
    while queue:
        body = queue.popleft()
        for joint in joints:
            other = _other(joint, body)
            if other is not None and other not in known:
                chosen.add(joint.name)
                queue.extend(_reach(other, held, known, chosen))
    return chosen


def problems_of_cuts(
    bodies: Iterable[Body], joints: Sequence[Joint], chosen: set[str], reasons: Mapping[str, str]
) -> Iterator[str]:  # fmt: skip
    """What is wrong where ``chosen`` joints, of those that are not cut, are to be the tree."""
    reached = {GROUND} | {b for j in joints if j.name in chosen for b in (j.base, j.follower)}
    for body in bodies:
        if body.name not in reached:
            yield f"{body.span}: body '{body.name}': the cut joints tear it off the ground; leave one of its joints uncut"
    for joint in joints:
        if joint.name not in chosen and joint.name in reasons:
            yield (
                f"{joint.span}: joint '{joint.name}': it closes a loop but must not be cut, since {reasons[joint.name]}, "
                "and no other joint of the loop may be; leave one of them free to be cut"
            )


def _reach(body: str, held: Sequence[Joint], known: set[str], chosen: set[str]) -> list[str]:
    """A body and all that ``held`` joints connect with it, nearest first; they become known and the joints chosen."""
    known.add(body)
    reached = [body]
    for inner in reached:
        for joint in held:
            other = _other(joint, inner)
            if other is not None and other not in known:
                known.add(other)
                chosen.add(joint.name)
                reached.append(other)
    return reached


def _other(joint: Joint, body: str) -> str | None:
    if joint.base == body:
        return joint.follower
    return joint.base if joint.follower == body else None
