"""Degrees of freedom: the rank of the cut joints' equations, in the design position and around it; models without a solution.

Guides contradict each other if loops cannot stay closed while they move. With a penalty, such a loop would open silently, since guides do
not yield to forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
import sympy

from cutjoint.analysis.closing import Array, Pose, close_loops, design_coordinates, evaluate_closures, evaluate_guided_rates, explore
from cutjoint.formulate.inputs import TIME, input_functions
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.functions import SuppliedCall
from cutjoint.model.records import Joint
from cutjoint.package.errors import EquationsError

_TIMES = (0.01, 0.03, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)  #: times of the checks as shares of the scene's duration
_PART = 1e-3  #: the share of the guides' rates that must remain after a least-squares fit of all speeds


@dataclass(frozen=True, kw_only=True)
class Mobility:
    """Unknown speeds, cut-joint equations and how many of them are independent. ``rank`` is the largest over ``poses`` poses that close the
    loops, ``design_rank`` that of the design position; if it is smaller, that position is singular. ``condition`` is the largest singular
    value there by the smallest that is not zero. ``closed`` is False if the guides' positions keep the loops from closing."""

    speeds: int
    equations: int
    rank: int
    design_rank: int
    poses: int
    condition: float
    closed: bool

    @property
    def degrees_of_freedom(self) -> int:
        """Speeds that the equations leave free."""
        return self.speeds - self.rank

    @property
    def redundant(self) -> int:
        """Equations that follow from the others in every pose."""
        return self.equations - self.rank


def find_mobility(equations: RecursiveEquations, poses: Sequence[Pose] | None = None) -> Mobility:
    """The mobility with default parameters and guides at rest; ``poses`` are those of ``explore``."""
    poses = explore(equations) if poses is None else poses
    return Mobility(
        speeds=equations.speeds, equations=len(equations.equation_names), rank=max(p.rank for p in poses), design_rank=poses[0].rank,
        poses=len(poses), condition=poses[0].condition, closed=poses[0].closed,
    )  # fmt: skip


class GuideError(EquationsError, ValueError):
    """Guides that no motion of the other joints can follow."""


def require_guides(equations: RecursiveEquations) -> None:
    """Refuse guides that contradict a loop or a gear in the equations' scene, or begin without a finite position and rate.
    They contradict if, at each of several times, the loops cannot be closed, and no speeds of other joints fit the guides' rates. Raises
    GuideError: they do; it names them and the loop."""
    model = equations.topology.model
    begin = {**{p.symbol: p.value for p in model.parameters}, TIME: 0.0}
    for joint in model.joints:
        laws = [sympy.sympify(law).subs(input_functions(model, equations.scene)) for law in joint.guide or ()]
        known = [x for x in (*laws, *(law.diff(TIME) for law in laws)) if not x.has(SuppliedCall, sympy.Derivative, sympy.Subs)]
        if not all(isfinite(evaluate(x, begin)) for x in known):
            words = "the guide has no finite position and rate at 0 s; write a law that begins with both"
            raise GuideError(f"{joint.span}: joint '{joint.name}': {words}")
    moving = moving_joints(equations)
    if not moving or not equations.closures:
        return
    violations = np.zeros(len(equations.equation_names))
    q = design_coordinates(equations)
    for time in (equations.scene.end * share for share in _TIMES):
        rates = evaluate_guided_rates(equations, q, time)
        if not np.abs(rates).max(initial=0.0) > 0:
            continue
        jacobian = evaluate_closures(equations, q, time)[1]
        left = rates - jacobian @ np.linalg.lstsq(jacobian, rates, rcond=1e-9)[0]  # what speeds cannot compensate
        if np.abs(left).max() < _PART * np.abs(rates).max() or close_loops(equations, q, t=time) is not None:
            return
        violations = np.maximum(violations, np.abs(left))
    if violations.any():
        raise GuideError(_words(equations, moving, violations))


def moving_joints(equations: RecursiveEquations) -> list[Joint]:
    """The tree joints whose guides move in the scene."""
    laws, joints = input_functions(equations.topology.model, equations.scene), [t.joint for t in equations.topology.tree]
    return [joint for joint in joints if any(sympy.diff(guide.subs(laws), TIME) != 0 for guide in joint.guide or ())]


def _words(equations: RecursiveEquations, moving: list[Joint], violations: Array) -> str:
    worst = int(np.argmax(violations))
    torn = next(c.joint for c in equations.closures if c.first <= worst < c.first + len(c.names))
    if any(gear.name == torn for gear in equations.topology.model.gears):
        names = ", ".join(f"'{joint.name}'" for joint in moving)
        return (
            f"{moving[0].span}: scene '{equations.scene.name}': the guides of {names} contradict the gear '{torn}': "
            "no motion of the other joints goes with them; leave out a guide or the gear"
        )
    loop = next(loop for loop in equations.topology.loops if loop.cut == torn)
    joint_of = equations.topology.joint_of
    guided = [joint_of[body].joint for body in loop.bodies if joint_of[body].joint.guide is not None]
    names = ", ".join(f"'{joint.name}'" for joint in guided or moving)
    return (
        f"{(guided or moving)[0].span}: scene '{equations.scene.name}': the guides of {names} are incompatible with "
        f"the loop that '{torn}' closes: no motion of its other joints satisfies them; leave out a guide, or free another joint of the loop"
    )
