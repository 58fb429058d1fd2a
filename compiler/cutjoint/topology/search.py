"""The search for the joints to cut."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from cutjoint.model.errors import ModelError
from cutjoint.model.records import Joint, Model
from cutjoint.topology.alike import number_alike
from cutjoint.topology.conditioning import loop_condition
from cutjoint.topology.cuts import CutRules, find_rules, shortest_paths, torn_bodies, wrong_cuts
from cutjoint.topology.geometry import JointGeometry
from cutjoint.topology.records import TreeJoint
from cutjoint.topology.spanning_tree import Cost, TopologyError, cost_of, joints_around, split


def span(model: Model) -> Spanning:
    """The joints of the tree and those to cut.

    Given cuts are honoured.  Where loops stay, the compiler cuts: it starts from the tree of shortest paths to the ground and
    exchanges a cut joint for a tree joint of its loop, in all loops alike or in this one alone, as long as that lowers the cost, or at the
    same cost the condition of the loop's equations.

    Raises:
        TopologyError: the given cuts tear a body off, or joints that must not be cut close a loop.
    """
    joints, rules = [j for j in model.joints if j.cut is not True], find_rules(model)
    chosen = shortest_paths(joints, [*rules.stay, *rules.uses])
    if problems := list(torn_bodies(model.bodies, joints, chosen)):
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
    """A choice: the joints of the names ``cut`` are cut, the others form the tree."""

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

    def exchanged(self, cut: Joint, instead: Joint) -> Spanning:
        """Copy the choice with another joint cut, and the cut joint in the tree."""
        return replace(self, cut=(self.cut - {cut.name}) | {instead.name})


@dataclass(frozen=True, kw_only=True)
class Exchanges:
    """Exchanges of cut joints for others by the ``rules``; joints of one ``number`` stand alike."""

    rules: CutRules
    number: Mapping[str, int]

    def around(self, spanning: Spanning, cut: Joint) -> list[Joint]:
        """The joints of a cut joint's loop that have no reason to stay in the tree; `violations` judges the exchange."""
        return [t.joint for t in joints_around(spanning.tree, cut) if t.joint.name not in self.rules.stay]

    def violations(self, spanning: Spanning) -> tuple[int, int]:
        """Two counts that come before the cost: cut joints that must not be cut, and forces on cut joints, which cost nothing in the
        tree."""
        return self.rules.faults(spanning.tree, spanning.cuts), self.rules.forces_on(spanning.cuts)

    def exchange_in_all_alike(self, spanning: Spanning, cut: Joint, instead: Joint) -> Spanning:
        """The exchange in this loop and in those of all cut joints alike; given cuts for given ones only.

        Of several joints alike, the one at the same place in its loop is taken.
        """
        result, place = spanning.exchanged(cut, instead), self.around(spanning, cut).index(instead)
        for other in spanning.cuts:
            if other is not cut and self.number[other.name] == self.number[cut.name] and bool(other.cut) == bool(cut.cut):
                around = enumerate(self.around(result, other))
                alike = [(abs(i - place), i, j) for i, j in around if self.number[j.name] == self.number[instead.name]]
                result = result.exchanged(other, min(alike)[2]) if alike else result
        return result


@dataclass(kw_only=True)
class _Search:
    """A search by exchanges; ``costs`` has those of all choices that were priced, ``left`` the choices that were left for better ones."""

    joints: Sequence[Joint]
    exchanges: Exchanges
    geometry: JointGeometry
    costs: dict[frozenset[str], tuple[tuple[int, int], Cost]] = field(default_factory=dict)
    left: set[frozenset[str]] = field(default_factory=set)

    def improve(self, best: Spanning) -> Spanning:
        """Sweeps over the joints that may be cut, until none finds a better choice."""
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
        """The choice in use or one with another joint of a cut joint's loop cut, in all loops alike if asked for, or in this loop alone."""
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
        """The condition of a cut joint's loop and its neighbours to three digits, so that rounding decides nothing."""
        try:
            return float(f"{loop_condition(self.geometry, spanning.tree, spanning.cuts, cut):.2e}")
        except ModelError:  # a direction of this joint depends on an open parameter, so that it has no numbers yet
            return math.inf
