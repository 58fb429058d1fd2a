"""Times at which what a scene or a guide gives goes over to another formula."""

from __future__ import annotations

from collections.abc import Iterator

import sympy
from sympy.core.relational import Relational

from cutjoint.formulate.inputs import TIME, input_functions
from cutjoint.model.evaluate import evaluate
from cutjoint.model.records import Model, Scalar, Scene


def jump_times(model: Model, scene: Scene) -> tuple[float, ...]:
    """The times (s) at which an input of the scene or a guide goes over to another formula by conditions that are linear in time.

    What jumps there has a value on either side.
    """
    laws = [*scene.inputs.values(), *(law for joint in model.joints for law in joint.guide or ())]
    known = {p.symbol: p.value for p in model.parameters}
    conditions = {c for law in laws for c in sympy.sympify(law).atoms(Relational)}
    return tuple(sorted({time for c in conditions for time in _zeros(c.lhs - c.rhs, known)}))


def guides_jump(model: Model, scene: Scene) -> bool:
    """Return whether a guide, or an input that moves one, goes over to another formula in the scene, so that its rate may jump."""
    laws = [sympy.sympify(law) for joint in model.joints for law in joint.guide or ()]
    laws += [law for symbol, law in input_functions(model, scene).items() if any(guide.has(symbol) for guide in laws)]
    return any(law.has(sympy.Piecewise, sympy.Abs, sympy.sign) for law in laws)


def _zeros(expression: Scalar, known: dict[Scalar, float]) -> Iterator[float]:
    """The time at which an expression is zero, if it is linear in time and has no other variable."""
    if not {TIME} <= expression.free_symbols <= {TIME, *known} or not expression.is_polynomial(TIME):
        return
    at_zero, at_one, at_two = (evaluate(expression, {**known, TIME: float(t)}) for t in (0, 1, 2))
    slope = at_one - at_zero
    if slope and abs(at_two - at_one - slope) <= 1e-12 * abs(slope):
        yield -at_zero / slope
