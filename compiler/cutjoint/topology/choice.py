"""Which joint of a loop is cut, which others could be, and what each choice costs."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.model.records import Joint
from cutjoint.topology.cuts import find_rules, joints_around
from cutjoint.topology.records import Topology, TreeJoint
from cutjoint.topology.spanning_tree import Cost, cost_of, split


@dataclass(frozen=True, kw_only=True)
class Option:
    """One joint to cut a loop at, all other cuts kept: the tree and the cut joints that follow, and their cost."""

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
    rules, place = find_rules(model), {j.name: i for i, j in enumerate(model.joints)}
    kept = {t.joint.name for t in topology.tree}
    cost = cost_of(model, topology.tree, topology.cuts)
    choices = []
    for cut in topology.cuts:
        free = [t.joint for t in joints_around(topology.tree, cut) if t.joint.name not in rules.stay]
        options = [_exchange(topology, kept, cut, joint) for joint in sorted(free, key=lambda j: place[j.name])]
        options = [o for o in options if not rules.faults(o.tree, o.cuts) and rules.forces_on(o.cuts) <= rules.forces_on(topology.cuts)]
        used = Option(joint=cut, tree=topology.tree, cuts=topology.cuts, cost=cost)
        choices.append(Choice(used=used, alternatives=tuple(sorted(options, key=lambda o: o.cost))))
    return tuple(choices)


def _exchange(topology: Topology, kept: set[str], cut: Joint, instead: Joint) -> Option:
    """Cut another joint of the loop, and put the cut joint into the tree."""
    tree, cuts = split(topology.model, (kept - {instead.name}) | {cut.name})
    return Option(joint=instead, tree=tree, cuts=cuts, cost=cost_of(topology.model, tree, cuts))
