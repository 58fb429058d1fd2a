"""Evaluation of expressions in floats, one or many at once, without SymPy's arithmetic."""

import math
import operator
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.elements.terms import Scalar
from cutjoint.model.expressions.operations import RELATIONS, SMOOTH
from cutjoint.ops import OPERATIONS

_OF_RUNS: Mapping[Any, Callable[..., Any]] = {
    sympy.Add: lambda *terms: sum(terms),
    sympy.Mul: lambda *factors: math.prod(factors),
    sympy.Pow: lambda base, exponent: np.power(np.float64(base), exponent),
    sympy.And: lambda *parts: reduce(np.logical_and, parts),
    sympy.Or: lambda *parts: reduce(np.logical_or, parts),
    sympy.Not: np.logical_not,
    sympy.Abs: np.abs,
    sympy.exp: np.exp,
    **dict(RELATIONS.values()),
    **{function: OPERATIONS[name].numpy for name, (function, _) in SMOOTH.items() if isinstance(function, type)},
}


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
    """A power; a root of a negative number is undefined, and so is any expression that contains it. Raises ArithmeticError: it has none."""
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


def evaluate_runs(expression: Scalar, values: Mapping[Scalar, float | NDArray[np.float64]], runs: int) -> NDArray[np.float64]:
    """The values of an expression in many runs, (runs,), whose symbols have one value, or one for each run; NaN or infinite for none."""
    with np.errstate(all="ignore"):
        return np.broadcast_to(np.asarray(_evaluate_runs(expression, values), dtype=np.float64), runs)


def _evaluate_runs(node: Scalar, values: Mapping[Scalar, Any]) -> Any:
    if node in values:
        return values[node]
    if node.is_Number or node.is_NumberSymbol:
        return np.float64(node)
    if isinstance(node, sympy.Piecewise):
        result: Any = math.nan
        for case in reversed(node.args):
            value, condition = (_evaluate_runs(part, values) for part in case.args)
            result = np.where(condition, value, result)
        return result
    if node in (sympy.true, sympy.false):
        return node is sympy.true
    if node.func not in _OF_RUNS:
        return math.nan
    return _OF_RUNS[node.func](*(_evaluate_runs(argument, values) for argument in node.args))
