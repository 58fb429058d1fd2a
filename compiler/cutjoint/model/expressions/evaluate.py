"""Evaluation of expressions in floats, one or many at once, without SymPy's arithmetic."""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.elements.terms import Scalar
from cutjoint.model.expressions.operations import RELATIONS, SMOOTH
from cutjoint.ops import OPERATIONS


def evaluate(expression: Scalar, values: Mapping[Scalar, float]) -> float:
    """The value of an expression of a model file, in plain floats; NaN when it has none."""
    try:
        result = _evaluate(expression, values, _EVALUATORS, _first_case)
    except (ArithmeticError, ValueError):
        return math.nan
    return float(result)


def _evaluate(node: Scalar, values: Mapping[Scalar, Any], by: Mapping[Any, Callable[..., Any]], choose: Callable[..., Any]) -> Any:
    """The value of an expression by functions ``by`` its kinds of nodes, and ``choose`` for those of cases."""
    if node in values:
        return values[node]
    if node.is_Number or node.is_NumberSymbol:
        return float(node)
    if isinstance(node, sympy.Piecewise):
        return choose(node.args, lambda part: _evaluate(part, values, by, choose))
    if node in (sympy.true, sympy.false):
        return node is sympy.true
    if node.func not in by:
        return math.nan
    return by[node.func](*(_evaluate(argument, values, by, choose) for argument in node.args))


def substitute(part: Any, values: Mapping[Scalar, Scalar]) -> Any:
    """An expression with values in place of symbols, or a record, a mapping or a tuple with all its expressions so."""
    if isinstance(part, sympy.Basic):
        return part.xreplace(values) if part.free_symbols & values.keys() else part
    if isinstance(part, tuple):
        return tuple(substitute(x, values) for x in part)
    if isinstance(part, Mapping):
        return {key: substitute(x, values) for key, x in part.items()}
    if is_dataclass(part) and not isinstance(part, type):
        old = {f.name: getattr(part, f.name) for f in fields(part) if f.init}
        changed = {name: new for name, x in old.items() if (new := substitute(x, values)) is not x and new != x}
        return replace(part, **changed) if changed else part
    return part


def _first_case(cases: Sequence[tuple[Scalar, Scalar]], value_of: Callable[[Scalar], Any]) -> Any:
    return next((value_of(value) for value, condition in cases if value_of(condition)), math.nan)


def _case_of_each_run(cases: Sequence[tuple[Scalar, Scalar]], value_of: Callable[[Scalar], Any]) -> Any:
    result: Any = math.nan
    for value, condition in reversed(cases):
        result = np.where(value_of(condition), value_of(value), result)
    return result


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

_OF_RUNS: Mapping[Any, Callable[..., Any]] = {
    **_EVALUATORS,
    sympy.Add: lambda *terms: sum(terms),
    sympy.Pow: lambda base, exponent: np.power(np.float64(base), exponent),
    sympy.And: lambda *parts: reduce(np.logical_and, parts),
    sympy.Or: lambda *parts: reduce(np.logical_or, parts),
    sympy.Not: np.logical_not,
    sympy.Abs: np.abs,
    sympy.exp: np.exp,
    **{function: OPERATIONS[name].numpy for name, (function, _) in SMOOTH.items() if isinstance(function, type)},
}


def evaluate_runs(expression: Scalar, values: Mapping[Scalar, float | NDArray[np.float64]], runs: int) -> NDArray[np.float64]:
    """The values of an expression in many runs, (runs,), whose symbols have one value, or one for each run; NaN or infinite for none."""
    with np.errstate(all="ignore"):
        return np.broadcast_to(np.asarray(_evaluate(expression, values, _OF_RUNS, _case_of_each_run), dtype=np.float64), runs)

