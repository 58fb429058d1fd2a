"""Values of expressions in plain floats, without SymPy's arithmetic: fast, and bounded in time."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

import sympy

from cutjoint.model.operations import RELATIONS, SMOOTH
from cutjoint.model.records import Scalar


def evaluate(expression: Scalar, values: Mapping[Scalar, float]) -> float:
    """The value of an expression of a model file, in plain floats; NaN when it has none."""
    try:
        result = _evaluate(expression, values)
    except (ArithmeticError, ValueError):
        return math.nan
    return float(result)


def _evaluate(node: Scalar, values: Mapping[Scalar, float]) -> Any:
    if node in values:
        return values[node]
    if node.is_Number or node.is_NumberSymbol:
        return float(node)
    if isinstance(node, sympy.Piecewise):
        for value, condition in node.args:
            if _evaluate(condition, values):
                return _evaluate(value, values)
        return math.nan
    if node in (sympy.true, sympy.false):
        return node is sympy.true
    if node.func not in _EVALUATORS:
        return math.nan
    return _EVALUATORS[node.func](*(_evaluate(argument, values) for argument in node.args))


def _power(base: float, exponent: float) -> float:
    """A power; a root of a negative number has no value, in whatever it stands.

    Raises:
        ArithmeticError: it has none.
    """
    power = base**exponent
    if isinstance(power, complex):
        raise ArithmeticError
    return float(power)


_EVALUATORS: Mapping[Any, Callable[..., Any]] = {
    sympy.Add: lambda *terms: math.fsum(terms),
    sympy.Mul: lambda *factors: math.prod(factors),
    sympy.Pow: _power,
    sympy.And: lambda *parts: all(parts),
    sympy.Or: lambda *parts: any(parts),
    sympy.Not: operator.not_,
    sympy.Abs: abs,
    sympy.exp: math.exp,
    **dict(RELATIONS.values()),
    **{function: numeric for function, numeric in SMOOTH.values() if isinstance(function, type)},
}
