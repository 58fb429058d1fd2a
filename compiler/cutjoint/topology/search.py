"""The joints that may be cut, the search for those to cut, and the alternatives for one loop, with the cost of each choice.

Joints stand alike in the body graph, before anything is cut, by their kind, and by the joints and forces around them.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import GROUND, Body, Joint, Model
from cutjoint.topology.geometry import JointGeometry, loop_condition
from cutjoint.topology.measured import Use, reason_not_to_measure, uses_of_coordinates
from cutjoint.topology.records import Topology, TreeJoint, degrees, grouped
from cutjoint.topology.spanning_tree import Cost, TopologyError, cost_of, joints_around, split

RADIUS = 8  #: the largest distance, in joints, at which surroundings of joints are compared


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
    Free joints stay, since they close nothing, and joints whose coordinates are given or coupled."""
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
            yield Problem(body.span, f"body '{body.name}'", "the cut joints disconnect it from the ground", "leave one of its joints uncut")


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


def span(model: Model) -> "Spanning":
    """The joints of the tree and those to cut.

    Given cuts are honoured.  Where loops stay, the compiler cuts: it starts from the tree of shortest paths to the ground and exchanges a
    cut joint for a tree joint of its loop, in all loops alike or in this one alone, as long as that lowers the cost, or at the same cost
    the condition of the loop's equations. Raises TopologyError: the given cuts tear a body off, or joints that must not be cut close a
    loop.
    """
    joints, rules = [j for j in model.joints if j.cut is not True], find_rules(model)
    chosen = shortest_paths(joints, [*rules.uncuttable, *rules.uses])
    if problems := list(disconnected_bodies(model.bodies, joints, chosen)):
        raise TopologyError(problems)
    best = Spanning(model=model, cut=frozenset(j.name for j in model.joints if j.name not in chosen))
    if len(chosen) < len(joints):
        exchanges = Exchanges(rules=rules, number=number_alike(model))
        best = _Search(joints=joints, exchanges=exchanges, geometry=JointGeometry(model=model)).improve(best)
    if problems := list(wrong_cuts(rules, best.tree, best.cuts)):
        raise TopologyError(problems)
    return best


@dataclass(frozen=True, kw_only=True)
class Spanning:
    """A choice of cut joints: those of the names ``cut`` are cut, the others form the tree."""

    model: Model
    cut: frozenset[str]

    @cached_property
    def parts(self) -> tuple[tuple[TreeJoint, ...], tuple[Joint, ...]]:
        """The tree joints, parents first, and the cut joints in the file's order."""
        return split(self.model, self.cut)

    @property
    def tree(self) -> tuple[TreeJoint, ...]:
        """The tree joints, parents first."""
        return self.parts[0]

    @property
    def cuts(self) -> tuple[Joint, ...]:
        """The cut joints in the file's order."""
        return self.parts[1]

    @cached_property
    def cost(self) -> Cost:
        """The cost of the choice."""
        return cost_of(self.model, self.tree, self.cuts)

    def exchanged(self, cut: Joint, instead: Joint) -> "Spanning":
        """A copy of the choice in which another joint is cut ``instead``."""
        return replace(self, cut=(self.cut - {cut.name}) | {instead.name})


@dataclass(frozen=True, kw_only=True)
class Exchanges:
    """Exchanges of cut joints for others by the ``rules``; joints of one ``number`` stand alike."""

    rules: CutRules
    number: Mapping[str, int]

    def around(self, spanning: Spanning, cut: Joint) -> list[Joint]:
        """The joints of a cut joint's loop that have no reason to stay in the tree; `violations` judges the exchange."""
        return [t.joint for t in joints_around(spanning.tree, cut) if t.joint.name not in self.rules.uncuttable]

    def violations(self, spanning: Spanning) -> tuple[int, int]:
        """Two counts that precede the cost: cut joints that must not be cut, and forces on cut joints, which would be free in the tree."""
        return self.rules.faults(spanning.tree, spanning.cuts), self.rules.forces_on(spanning.cuts)

    def exchange_in_all_alike(self, spanning: Spanning, cut: Joint, instead: Joint) -> Spanning:
        """The exchange in this loop and in those of all cut joints alike; given cuts for given ones only.
        Of several joints alike, the one at the same place in its loop is taken."""
        result, place = spanning.exchanged(cut, instead), self.around(spanning, cut).index(instead)
        for other in spanning.cuts:
            if other.name != cut.name and self.number[other.name] == self.number[cut.name] and bool(other.cut) == bool(cut.cut):
                around = enumerate(self.around(result, other))
                alike = [(abs(i - place), i, j) for i, j in around if self.number[j.name] == self.number[instead.name]]
                result = result.exchanged(other, min(alike)[2]) if alike else result
        return result


@dataclass(kw_only=True)
class _Search:
    joints: Sequence[Joint]
    exchanges: Exchanges
    geometry: JointGeometry
    costs: dict[frozenset[str], tuple[tuple[int, int], Cost]] = field(default_factory=dict)
    left: set[frozenset[str]] = field(default_factory=set)

    def improve(self, best: Spanning) -> Spanning:
        """Try all exchanges repeatedly until none improves the choice."""
        improved = True
        while improved:
            improved, seen = False, set[int]()
            for cut in self.joints:
                if cut.name in best.cut:
                    better = self._best(best, cut, everywhere=self.exchanges.number[cut.name] not in seen)
                    seen.add(self.exchanges.number[cut.name])
                    if better is not best:
                        self.left.add(best.cut)
                        best, improved = better, True
        return best

    def _best(self, used: Spanning, cut: Joint, *, everywhere: bool) -> Spanning:
        """The best of the present choice and those with another joint of a cut joint's loop cut.
        In this loop alone, or ``everywhere`` in all loops alike."""
        options = [(cut, used)]
        for joint in self.exchanges.around(used, cut):
            options += [(joint, used.exchanged(cut, joint))]
            options += [(joint, self.exchanges.exchange_in_all_alike(used, cut, joint))] if everywhere else []
        least = min(self._cost(spanning) for _, spanning in options)
        equal = [(joint, spanning) for joint, spanning in options if self._cost(spanning) == least and spanning.cut not in self.left]
        return min(equal, key=lambda option: self._condition(*option))[1] if len(equal) > 1 else equal[0][1]

    def _cost(self, spanning: Spanning) -> tuple[tuple[int, int], Cost]:
        if spanning.cut not in self.costs:
            self.costs[spanning.cut] = self.exchanges.violations(spanning), spanning.cost
        return self.costs[spanning.cut]

    def _condition(self, cut: Joint, spanning: Spanning) -> float:
        """The condition number of a cut joint's loop and its neighbours to three digits, so that rounding has no influence."""
        try:
            return float(f"{loop_condition(self.geometry, spanning.tree, spanning.cuts, cut):.2e}")
        except ModelError:  # a direction of this joint depends on a tunable parameter and has no value yet
            return math.inf


def number_alike(model: Model) -> Mapping[str, int]:
    """A number for each joint by its name, the same for joints whose surroundings have one shape up to RADIUS joints away.
    Bodies that guided joints carry count as the bodies that carry them, so that a steered axle is like another."""
    merged = grouped((GROUND, *(b.name for b in model.bodies)), ((j.base, j.follower) for j in model.joints if degrees(j) == 0))
    heavy = {merged[body.name] for body in model.bodies if not body.is_massless}
    forces: dict[str, list[str]] = {}
    for force in model.forces:
        for body in force.bodies:
            forces.setdefault(merged[body], []).append(type(force).__name__)
    bodies: dict[str, Any] = {b: (b == merged[GROUND], b not in heavy, tuple(sorted(forces.get(b, ())))) for b in merged.values()}
    joints: dict[str, Any] = {j.name: (j.kind, j.guide is not None) for j in model.joints}
    ends = {j.name: (merged[j.base], merged[j.follower]) for j in model.joints}
    for _ in range(RADIUS):
        bodies, joints = _numbered(bodies), _numbered(joints)
        seen: dict[str, list[tuple[int, int, int]]] = {}
        for name, (base, follower) in ends.items():
            seen.setdefault(base, []).append((joints[name], 0, bodies[follower]))
            seen.setdefault(follower, []).append((joints[name], 1, bodies[base]))
        joints = {name: (joints[name], bodies[base], bodies[follower]) for name, (base, follower) in ends.items()}
        bodies = {body: (number, tuple(sorted(seen.get(body, ())))) for body, number in bodies.items()}
    return _numbered(joints)


def _numbered(shapes: Mapping[str, Any]) -> dict[str, int]:
    known: dict[Any, int] = {}
    return {name: known.setdefault(shape, len(known)) for name, shape in shapes.items()}


@dataclass(frozen=True, kw_only=True)
class Option:
    """One joint to cut a loop at: the tree and the cut joints that follow, and their cost.
    In all loops alike the joint alike is cut, or in this loop alone, whichever costs less; all other cuts stay."""

    joint: Joint
    tree: tuple[TreeJoint, ...]
    cuts: tuple[Joint, ...]
    cost: Cost


@dataclass(frozen=True, kw_only=True)
class Choice:
    """The cut joint of a loop, and its alternatives by increasing cost, then in the file's order."""

    used: Option
    alternatives: tuple[Option, ...]


def rank_cuts(topology: Topology) -> tuple[Choice, ...]:
    """The choices of all loops, in the order of the cut joints; joints that must not be cut are left out."""
    model = topology.model
    exchanges, place = Exchanges(rules=find_rules(model), number=number_alike(model)), {j.name: i for i, j in enumerate(model.joints)}
    used = Spanning(model=model, cut=frozenset(cut.name for cut in topology.cuts))
    choices = []
    for cut in topology.cuts:
        joints = sorted(exchanges.around(used, cut), key=lambda j: place[j.name])
        choices_of = {joint: (exchanges.exchange_in_all_alike(used, cut, joint), used.exchanged(cut, joint)) for joint in joints}
        harmless = {joint: [s for s in both if exchanges.violations(s) <= exchanges.violations(used)] for joint, both in choices_of.items()}
        options = [_option(joint, *spannings) for joint, spannings in harmless.items() if spannings]
        choices.append(Choice(used=_option(cut, used), alternatives=tuple(sorted(options, key=lambda o: o.cost))))
    return tuple(choices)


def _option(joint: Joint, *choices: Spanning) -> Option:
    best = min(choices, key=lambda choice: choice.cost)
    return Option(joint=joint, tree=best.tree, cuts=best.cuts, cost=best.cost)
