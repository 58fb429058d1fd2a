"""The cut joint of a loop, the others that could be cut, and the cost of each choice."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.model.records import Joint
from cutjoint.topology.alike import number_alike
from cutjoint.topology.cuts import find_rules
from cutjoint.topology.records import Topology, TreeJoint
from cutjoint.topology.search import Exchanges, Spanning
from cutjoint.topology.spanning_tree import Cost


@dataclass(frozen=True, kw_only=True)
class Option:
    """One joint to cut a loop at: the tree and the cut joints that follow, and their cost.

    In all loops alike the joint alike is cut, or in this loop alone, whichever costs less; all other cuts stay.
    """

    joint: Joint
    tree: tuple[TreeJoint, ...]
    cuts: tuple[Joint, ...]
    cost: Cost


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A loop's cut joint in use, and the joints of its loop that could be cut instead, cheapest first, the file's order at equal cost."""

    used: Option
    alternatives: tuple[Option, ...]


def rank_cuts(topology: Topology) -> tuple[Choice, ...]:
    """The choice of each loop, in the order of the cut joints; a joint that must not be cut is no alternative."""
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
