"""The functions of a system that Newton's iteration solves, in whatever coordinates: runtime/include/cutjoint/lagrangian/system.hpp."""

from __future__ import annotations

from collections.abc import Mapping

from cutjoint.formulate.records import Function
from cutjoint.program.blocks import Block

_STATE = ("const Real* q", "const Real* v", "const Real* vdot")
_BALANCE = (*_STATE, "const Real* lambda", "Real penalty")
_BALANCED = ("Real* balance", "Real* residual")

#: The arguments of each function, results last.
_ARGUMENTS: Mapping[str, tuple[str, ...]] = {
    "place": ("const Real* relative_q", "const Real* relative_v", "Real* q", "Real* v"),
    "balance": (*_BALANCE, *_BALANCED),
    "linearise": (*_BALANCE, "const Weights<Real>& weights", *_BALANCED, "Real* tangent"),
    "close": (*_STATE, "Real* residual", "Real* rate", "Real* curvature"),
    "pull": ("const Real* q", "const Real* w", "Real* force"),
    "stretch": ("const Real* q", "const Real* vdot", "Real* change"),
    "report": (*_STATE, "const Real* lambda", "Real* column"),
}

#: What the generated ``load`` takes.
LOAD_ARGUMENTS = ("const Real* parameters", "const Road<Real>* roads")

#: The arrays that have an element for each equation.
EQUATION_ARRAYS = ("lambda", "w", "residual", "rate", "curvature", "change")


def system_functions(
    place: Mapping[str, Block], balance: Mapping[str, Block], tangent: Mapping[str, Block], close: Mapping[str, Block],
    pull: Mapping[str, Block], stretch: Mapping[str, Block], report: Mapping[str, Block],
) -> tuple[Function, ...]:  # fmt: skip
    """The functions with their results; ``linearise`` has those of the balance and of the tangent."""
    results = {
        "place": place, "balance": balance, "linearise": {**balance, **tangent}, "close": close, "pull": pull, "stretch": stretch,
        "report": report,
    }  # fmt: skip
    return tuple(Function(name=name, arguments=arguments, results=results[name]) for name, arguments in _ARGUMENTS.items())
