"""Scalar operations, one row each: the model language, folding, interpretation, printing, derivatives and domains follow from it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Operation:
    """A scalar operation.

    ``numpy`` evaluates it for arrays, ``fold`` for constants where the graph has no rule of its own. C++ and JavaScript write ``infix``
    between its arguments, C++ with lanes ``infix_of_lanes``; a ``standard`` one has its name in ``std`` and ``Math`` too, a ``smooth`` one
    in models, `math` and SymPy. ``partials`` are its partial derivatives as functions of a calculus (program/differentiate.py), its value
    and its arguments. ``parity`` is 1 for an even and -1 for an odd function. ``margin`` is an expression of its arguments that is not
    negative (positive if ``strict``) where the operation is defined; None if it is defined everywhere.
    """

    name: str
    arity: int
    numpy: Callable[..., Any]
    fold: Callable[..., float] | None = None
    infix: str = ""
    infix_of_lanes: str = ""
    standard: bool = False
    smooth: bool = False
    partials: Callable[..., list[Any]] | None = None
    parity: int = 0
    margin: Callable[..., Any] | None = None
    strict: bool = False


def _smooth(name: str, partials: Callable[..., list[Any]], **more: Any) -> Operation:
    of_numpy = getattr(np, name.replace("a", "arc", 1) if name.startswith(("asin", "acos", "atan")) else name)
    row = {"arity": 1, "numpy": of_numpy, "fold": getattr(math, name), **more}
    return Operation(name=name, partials=partials, standard=True, smooth=True, **row)


def _condition(name: str, infix: str, numpy: Any, fold: Callable[..., bool], arity: int = 2) -> Operation:
    return Operation(
        name=name, arity=arity, numpy=numpy, fold=lambda *args: float(fold(*args)), infix=infix,
        infix_of_lanes={"&&": "&", "||": "|"}.get(infix, infix), partials=lambda c, y, *args: [c.b.zero(1)] * arity,
    )  # fmt: skip


def _by_atan2(c: Any, _: Any, y: Any, x: Any) -> list[Any]:
    squares = c.b.add(c.square(x), c.square(y))
    return [c.call("div", x, squares), c.b.neg(c.call("div", y, squares))]


def _by_pow(c: Any, value: Any, x: Any, n: Any) -> list[Any]:
    by_base = c.product(n, c.call("pow", x, c.b.sub(n, c.one)))
    return [by_base, c.b.zero(1) if n.op == "const" else c.product(value, c.call("log", x))]


def _base(b: Any, x: Any, n: Any) -> Any:
    """The base of a power, which is defined everywhere for a whole exponent."""
    return None if n.op == "const" and float(n.data[0][0]).is_integer() else x


def _within_one(b: Any, x: Any) -> Any:
    return b.sub(b.number(1.0), b.mul(x, x))


_ROWS = (
    Operation(name="add", arity=2, infix="+", numpy=lambda a, b: a + b),
    Operation(name="sub", arity=2, infix="-", numpy=lambda a, b: a - b),
    Operation(name="neg", arity=1, numpy=lambda a: -a),
    Operation(name="mul", arity=2, infix="*", numpy=lambda a, b: a * b, partials=lambda c, y, a, x: [x, a]),
    Operation(name="div", arity=2, infix="/", numpy=lambda a, b: np.float64(a) / np.float64(b), margin=lambda b, a, x: b.mul(x, x),
        strict=True, partials=lambda c, y, a, x: [c.inverse(x), c.b.neg(c.call("div", y, x))]),
    _smooth("sqrt", lambda c, y, a: [c.call("div", c.b.number(0.5), y)], margin=lambda b, x: x),
    _smooth("sin", lambda c, y, a: [c.call("cos", a)], parity=-1),
    _smooth("cos", lambda c, y, a: [c.b.neg(c.call("sin", a))], parity=1),
    _smooth("tan", lambda c, y, a: [c.b.add(c.one, c.square(y))], parity=-1),
    _smooth("asin", lambda c, y, a: [c.inverse(c.root_of_rest(a))], parity=-1, margin=_within_one),
    _smooth("acos", lambda c, y, a: [c.b.neg(c.inverse(c.root_of_rest(a)))], margin=_within_one),
    _smooth("atan", lambda c, y, a: [c.inverse(c.b.add(c.one, c.square(a)))], parity=-1),
    _smooth("atan2", _by_atan2, arity=2),
    _smooth("sinh", lambda c, y, a: [c.call("cosh", a)], parity=-1),
    _smooth("cosh", lambda c, y, a: [c.call("sinh", a)], parity=1),
    _smooth("tanh", lambda c, y, a: [c.b.sub(c.one, c.square(y))], parity=-1),
    _smooth("exp", lambda c, y, a: [y]),
    _smooth("log", lambda c, y, a: [c.inverse(a)], margin=lambda b, x: x, strict=True),
    Operation(name="abs", arity=1, numpy=np.abs, fold=abs, standard=True, parity=1,
        partials=lambda c, y, a: [c.call("where", c.call("lt", a, c.b.zero(1)), c.b.number(-1.0), c.one)]),
    Operation(name="pow", arity=2, numpy=lambda a, b: np.power(np.float64(a), b), fold=math.pow, standard=True,
        partials=_by_pow, margin=_base),
    _condition("lt", "<", np.less, lambda a, b: a < b),
    _condition("le", "<=", np.less_equal, lambda a, b: a <= b),
    _condition("and", "&&", np.logical_and, lambda a, b: bool(a) and bool(b)),
    _condition("or", "||", np.logical_or, lambda a, b: bool(a) or bool(b)),
    _condition("not", "", np.logical_not, lambda a: not a, arity=1),
    Operation(name="where", arity=3, numpy=np.where, fold=lambda c, a, b: a if c else b),
)  # fmt: skip

OPERATIONS = {row.name: row for row in _ROWS}


def _names(condition: Callable[[Operation], Any]) -> tuple[str, ...]:
    return tuple(row.name for row in _ROWS if condition(row))


#: Functions of namespace std that keep their name, those of models, and functions whose values are conditions, which lanes cannot store as
#: numbers.
STANDARD, SMOOTH = _names(lambda row: row.standard), _names(lambda row: row.smooth)
CONDITIONS = ("lt", "le", "and", "or", "not")


def fact(operation: str, name: str) -> Any:
    """A field of an operation's row.

    Raises:
        LookupError: there is no such row, or the field is empty.
    """
    found = getattr(OPERATIONS.get(operation), name, None)
    if not found:
        raise LookupError(f"the operation '{operation}' has no '{name}' in {__name__}")
    return found
