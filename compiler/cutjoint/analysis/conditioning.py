"""The condition of a loop's equations by each of its cuts: it ranks cuts of equal cost, and with the costs it gives the reason of a
choice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cutjoint.topology.geometry import JointGeometry, loop_condition
from cutjoint.topology.records import Topology
from cutjoint.topology.search import Choice, Option


@dataclass(frozen=True, kw_only=True)
class RatedOption:
    """A way to cut a loop.

    ``condition`` is that of the equations of this loop and of those that share a joint with it, in the design position: the largest
    singular value by the smallest that is not zero.
    """

    option: Option
    condition: float


@dataclass(frozen=True, kw_only=True)
class RatedChoice:
    """The cut joint in use and the best of its alternatives, the best first."""

    used: RatedOption
    alternatives: tuple[RatedOption, ...]

    @property
    def reason(self) -> str:
        """The reason that the cut joint in use is cut, beside the best alternative."""
        given = self.used.option.joint.cut is True
        if not self.alternatives:
            return "given by the model" if given else "no other joint of the loop may be cut"
        return f"{'given by the model' if given else 'chosen'}: {_difference(self.used, self.alternatives[0])}"


def _difference(used: RatedOption, other: RatedOption) -> str:
    mine, cost, name = used.option.cost, other.option.cost, other.option.joint.name
    if mine.counted_once != cost.counted_once:
        return f"{_less(cost.counted_once - mine.counted_once, 'operations fewer', 'operations more')} than at {name}"
    if mine.redundant != cost.redundant:
        return f"{_less(cost.redundant - mine.redundant, 'redundant equations fewer', 'redundant equations more')} than at {name}"
    return f"the same cost as at {name}"


def _less(difference: int, less: str, more: str) -> str:
    return f"{abs(difference)} {less if difference > 0 else more}"


def rate_choices(topology: Topology, choices: Sequence[Choice], limit: int = 3) -> tuple[RatedChoice, ...]:
    """The choices with at most ``limit`` alternatives each; of equal cost, the better conditioned one comes first."""
    geometry = JointGeometry(model=topology.model)
    rated = []
    for choice in choices:
        worst = [o.cost for o in choice.alternatives[:limit]][-1:]
        options = [_rate(geometry, o) for o in choice.alternatives if o.cost <= worst[0]]
        options.sort(key=lambda r: (r.option.cost, float(f"{r.condition:.2e}")))
        rated.append(RatedChoice(used=_rate(geometry, choice.used), alternatives=tuple(options[:limit])))
    return tuple(rated)


def _rate(geometry: JointGeometry, option: Option) -> RatedOption:
    return RatedOption(option=option, condition=loop_condition(geometry, option.tree, option.cuts, option.joint))
