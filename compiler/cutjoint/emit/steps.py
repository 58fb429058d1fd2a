"""The integrators of the core by the names of methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Steps:
    """An integrator of the core: its header and its C++ class for a mechanism, or for that and a system.

    ``stages`` is the number of derivatives that an explicit one holds, with parts of its interpolant beyond five, ``finds_events`` whether
    its steps can end at events, ``is_iterated`` whether a number of iterations can be set, ``adaptive`` whether tolerances can,
    ``differentiable`` whether steps have derivatives, ``by_residual`` whether these need the derivatives of the residual of the equations
    of motion.
    """

    header: str
    name: str
    stages: int = 0
    finds_events: bool = False
    is_iterated: bool = False
    adaptive: bool = False
    differentiable: bool = False
    by_residual: bool = False


_EXPLICIT, _IMPLICIT = "cutjoint/core/explicit_steps.hpp", "cutjoint/core/implicit_steps.hpp"
_NEWTON = "cutjoint/core/recursive_newton_steps.hpp"

#: By the names of methods and integrators.
STEPS: Mapping[str, Mapping[str, Steps]] = {
    "recursive": {
        "trapezoidal": Steps(
            header="cutjoint/core/fixed_point_steps.hpp", name="FixedPointSteps<Mechanism>", is_iterated=True, differentiable=True
        ),
        "rk4": Steps(
            header=_EXPLICIT, name="ExplicitSteps<Mechanism, cutjoint::runge_kutta::ClassicalTable>", stages=5, finds_events=True,
            differentiable=True,
        ),
        "dormand-prince": Steps(
            header=_EXPLICIT, name="ExplicitSteps<Mechanism, cutjoint::runge_kutta::DormandPrinceTable>", stages=7, finds_events=True,
            adaptive=True, differentiable=True,
        ),
        "dop853": Steps(
            header=_EXPLICIT, name="ExplicitSteps<Mechanism, cutjoint::runge_kutta::Dop853Table>", stages=20, finds_events=True,
            adaptive=True, differentiable=True,
        ),
    },
    "augmented": {
        "trapezoidal": Steps(header="cutjoint/core/augmented_steps.hpp", name="AugmentedSteps<Mechanism, System>"),
    },
    "classical": {
        "trapezoidal": Steps(header="cutjoint/core/classical_steps.hpp", name="ClassicalSteps<Mechanism, System>"),
    },
    "recursive-newton": {
        "trapezoidal": Steps(header=_NEWTON, name="RecursiveNewtonSteps<Mechanism, System>", differentiable=True),
        "generalised-alpha": Steps(header=_NEWTON, name="RecursiveNewtonSteps<Mechanism, System>"),
        "radau5": Steps(
            header=_IMPLICIT, name="RadauSteps<Mechanism, System, true>", finds_events=True, adaptive=True, differentiable=True,
            by_residual=True,
        ),
        "radau5-fixed": Steps(
            header=_IMPLICIT, name="RadauSteps<Mechanism, System, false>", finds_events=True, differentiable=True, by_residual=True
        ),
    },
}  # fmt: skip

#: All integrators of the core.
INTEGRATORS_OF_CORE = tuple(dict.fromkeys(name for steps in STEPS.values() for name in steps))
