"""The joints that may be cut, and a check that the others span a tree."""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from cutjoint.model.errors import Problem
from cutjoint.model.records import GROUND, Body, Joint, Model
from cutjoint.topology.measured import Use, reason_not_to_measure, uses_of_coordinates
from cutjoint.topology.records import TreeJoint
from cutjoint.topology.spanning_tree import joints_around


@dataclass(frozen=True, kw_only=True)
class CutRules:
    """The rules of cutting: joints without a reason to ``uncuttable`` may be cut if the coordinates in ``uses`` can be measured."""

    uncuttable: Mapping[str, str]
    uses: Mapping[str, tuple[Use, ...]]

    def reason(self, cut: Joint, tree: Sequence[TreeJoint]) -> str:
        """The reason that a joint must not be cut with this tree; "" if it may be."""
        if cut.name in self.uncuttable and cut.cut is not True:
            return self.uncuttable[cut.name]
        uses = self.uses.get(cut.name, ())
        return reason_not_to_measure(cut, uses, joints_around(tree, cut)) if uses else ""

    def faults(self, tree: Sequence[TreeJoint], cuts: Iterable[Joint]) -> int:
        """The number of cut joints that must not be cut."""
        return sum(bool(self.reason(cut, tree)) for cut in cuts)

    def forces_on(self, cuts: Iterable[Joint]) -> int:
        """The number of forces on coordinates of cut joints."""
        return sum(use.is_force for cut in cuts for use in self.uses.get(cut.name, ()))


def find_rules(model: Model) -> CutRules:
    """The rules of a model."""
    return CutRules(uncuttable=reasons_not_to_cut(model), uses=uses_of_coordinates(model))


def reasons_not_to_cut(model: Model) -> Mapping[str, str]:
    """The reasons that joints stay in the tree, by their names.

    Free joints stay, since they close nothing, and joints whose coordinates are given or coupled.
    """
    reasons: dict[str, str] = {}
    for scene in model.scenes.values():
        sought = () if scene.trim is None else (*scene.trim.find, *scene.trim.unsteady)
        for key in (*scene.positions, *scene.rates, *(unknown.entry for unknown in sought if unknown.kind in ("position", "rate"))):
            reasons[key.rpartition(".")[0]] = f"scene '{scene.name}' gives its coordinate or speed"
    reasons |= {name: f"gear '{gear.name}' couples its coordinate" for gear in model.gears for name in gear.joints}
    names = {joint.name for joint in model.joints}
    for joint in model.joints:
        if not joint.element.closes:
            reasons[joint.name] = f"a {joint.kind} joint closes no loop"
        elif joint.guide is not None:
            reasons[joint.name] = "it has a guide"
        elif joint.armature != 0:
            reasons[joint.name] = "it has an armature"
        elif joint.cut is False:
            reasons[joint.name] = "it has cut: false"
    return {name: reason for name, reason in reasons.items() if name in names}


def shortest_paths(joints: Sequence[Joint], bound: Iterable[str]) -> set[str]:
    """A breadth-first tree of joints that are not cut.
    ``bound`` joints, which must not be cut, count as no distance, so that the tree has all of them unless they close a loop."""
    known: set[str] = set()
    chosen: set[str] = set()
    kept = set(bound)
    unbroken = [j for j in joints if j.name in kept]
    queue = deque(sorted(_connected(GROUND, unbroken, known, chosen)))
    while queue:
        body = queue.popleft()
        for joint in joints:
            other = _other(joint, body)
            if other is not None and other not in known:
                chosen.add(joint.name)
                queue.extend(_connected(other, unbroken, known, chosen))
    return chosen


def disconnected_bodies(bodies: Iterable[Body], joints: Sequence[Joint], chosen: set[str]) -> Iterator[Problem]:
    """The problems of bodies that the ``chosen`` joints do not reach."""
    reached = {GROUND} | {b for j in joints if j.name in chosen for b in (j.base, j.follower)}
    for body in bodies:
        if body.name not in reached:
            yield Problem(
                span=body.span, element=f"body '{body.name}'", message="the cut joints disconnect it from the ground",
                hint="leave one of its joints uncut",
            )  # fmt: skip


def wrong_cuts(rules: CutRules, tree: Sequence[TreeJoint], cuts: Iterable[Joint]) -> Iterator[Problem]:
    """The problems of cut joints that must not be cut."""
    for cut in cuts:
        reason = rules.reason(cut, tree)
        message, hint = f"it must not be cut, since {reason}", "cut another joint of its loop"
        if cut.cut is not True:
            message = f"it closes a loop but must not be cut, since {reason}, and no other joint of the loop may be"
            hint = "leave one of them free to be cut"
        if reason:
            yield Problem(span=cut.span, element=f"joint '{cut.name}'", message=message, hint=hint)


def _connected(body: str, unbroken: Sequence[Joint], known: set[str], chosen: set[str]) -> list[str]:
    """A body and all that ``unbroken`` joints connect with it, nearest first; they become known and the joints chosen."""
    known.add(body)
    reached = [body]
    for inner in reached:
        for joint in unbroken:
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
