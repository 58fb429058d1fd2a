"""How well a loop's equations are conditioned wherever it is cut: it ranks cuts of equal cost, and with the costs it says why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cutjoint.analysis.closing import Array
from cutjoint.analysis.geometry import JointGeometry
from cutjoint.analysis.poses import TOLERANCE
from cutjoint.model.records import Joint
from cutjoint.topology.choice import Choice, Option
from cutjoint.topology.elimination import degrees
from cutjoint.topology.records import Topology, TreeJoint
from cutjoint.topology.spanning_tree import joints_around


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
        """Why the cut joint in use is cut, beside the best alternative."""
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
    around = {cut.name: joints_around(option.tree, cut) for cut in option.cuts}
    mine = {t.joint.name for t in around[option.joint.name]}
    near = [cut for cut in option.cuts if any(t.joint.name in mine for t in around[cut.name])]
    jacobian = design_jacobian(geometry, [(cut, around[cut.name]) for cut in near])
    values = np.linalg.svd(jacobian, compute_uv=False) if jacobian.size else np.zeros(0)
    positive = values[values > TOLERANCE * values.max(initial=0.0)]
    return RatedOption(option=option, condition=float(positive[0] / positive[-1]) if positive.size else 1.0)


def design_jacobian(geometry: JointGeometry, loops: Sequence[tuple[Joint, Sequence[TreeJoint]]]) -> Array:
    """d rate / d v of cut joints with the tree joints around their loops; the columns are those joints' speeds as they are met."""
    columns: dict[str, slice] = {}
    end = 0
    for t in (t for _, around in loops for t in around):
        if t.joint.name not in columns:
            columns[t.joint.name] = slice(end, end + degrees(t.joint))
            end += degrees(t.joint)
    rows = [np.zeros((0, end))]
    for cut, around in loops:
        held = geometry.held(cut)
        rows.append(np.zeros((held.shape[0], end)))
        for sign, t in _along(cut, around):
            rows[-1][:, columns[t.joint.name]] = sign * held @ geometry.freed(t)
    return np.concatenate(rows)


def _along(cut: Joint, around: Sequence[TreeJoint]) -> list[tuple[float, TreeJoint]]:
    """The joints from follower to base with the sign of their twist in that of the follower beside the base."""
    body, signed = cut.follower, []
    for t in around:
        inwards = t.child == body
        signed.append((1.0 if inwards else -1.0, t))
        body = t.parent if inwards else t.child
    return signed
