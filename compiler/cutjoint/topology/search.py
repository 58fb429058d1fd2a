"""The search for the joints to cut."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from cutjoint.model.records import Joint, Model
from cutjoint.topology.alike import number_alike
from cutjoint.topology.cuts import problems_of_cuts, shortest_paths
from cutjoint.topology.records import TreeJoint
from cutjoint.topology.spanning_tree import Cost, TopologyError, cost_of, joints_around, split, tree_only


def span(model: Model) -> Spanning:
    """The joints of the tree and those to cut.

    Given cuts are honoured.  Where loops stay, the compiler cuts: it starts from the tree of shortest paths to the ground and
    exchanges a cut joint for a tree joint of its loop, in all loops alike or in this one alone, as long as that lowers the cost.

    Raises:
        TopologyError: the given cuts tear a body off, or joints that must not be cut close a loop.
    """
    joints = [j for j in model.joints if j.cut is not True]
    bound = tree_only(model)
    chosen = shortest_paths(joints, bound)
    if problems := list(problems_of_cuts(model.bodies, joints, chosen, bound)):
        raise TopologyError("\n".join(problems))
    best = Spanning(model=model, cut=frozenset(j.name for j in model.joints if j.name not in chosen))
    if len(chosen) == len(joints):
        return best
    return _improve(best, joints, Exchanges(bound=bound, number=number_alike(model)))


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
        """What it costs."""
        return cost_of(self.model, self.tree, self.cuts)

    def exchanged(self, cut: Joint, instead: Joint) -> Spanning:
        """The same with another joint cut, and the cut joint in the tree."""
        return replace(self, cut=(self.cut - {cut.name}) | {instead.name})


@dataclass(frozen=True, kw_only=True)
class Exchanges:
    """Which joints may be cut instead of others: ``bound`` must not be cut, those of one ``number`` stand alike."""

    bound: Container[str]
    number: Mapping[str, int]

    def around(self, spanning: Spanning, cut: Joint) -> list[Joint]:
        """The joints of a cut joint's loop that may be cut in its place."""
        return [t.joint for t in joints_around(spanning.tree, cut) if t.joint.name not in self.bound]

    def everywhere(self, spanning: Spanning, cut: Joint, instead: Joint) -> Spanning:
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


def _improve(best: Spanning, joints: list[Joint], exchanges: Exchanges) -> Spanning:
    """Sweeps over the joints that may be cut, until none finds a cheaper tree."""
    known: dict[frozenset[str], Cost] = {}

    def price(spanning: Spanning) -> Cost:
        if spanning.cut not in known:
            known[spanning.cut] = spanning.cost
        return known[spanning.cut]

    improved = True
    while improved:
        improved, seen = False, set[int]()
        for cut in joints:
            if cut.name in best.cut:
                candidates = _candidates(best, cut, exchanges, everywhere=exchanges.number[cut.name] not in seen)
                seen.add(exchanges.number[cut.name])
                cheapest = min(candidates, key=price, default=best)
                if price(cheapest) < price(best):
                    best, improved = cheapest, True
    return best


def _candidates(spanning: Spanning, cut: Joint, exchanges: Exchanges, *, everywhere: bool) -> Iterator[Spanning]:
    """The choices with another joint of a cut joint's loop cut: in all loops alike if asked for, and in this loop alone."""
    for joint in exchanges.around(spanning, cut):
        yield spanning.exchanged(cut, joint)
        if everywhere:
            yield exchanges.everywhere(spanning, cut, joint)
