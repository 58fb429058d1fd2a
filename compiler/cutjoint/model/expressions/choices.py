"""Piecewise expressions that are never rewritten, and the size of an expression and its derivatives.

SymPy's own Piecewise folds the cases inside a condition into ever more conditions, which takes exponential time.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import sympy
from sympy.functions.elementary.piecewise import ExprCondPair

from cutjoint.elements.terms import Scalar


class Case(ExprCondPair):  # type: ignore[misc]
    """A value and its condition, neither of them rewritten."""

    def __new__(cls, value: Any, condition: Any) -> Any:
        return sympy.Tuple.__new__(cls, sympy.sympify(value), sympy.sympify(condition))


class Choice(sympy.Piecewise):  # type: ignore[misc]
    """A Piecewise that is never rewritten, neither when it is built anew nor when it is differentiated."""

    def __new__(cls, *cases: Any, **_: Any) -> Any:
        kept = []
        for case in cases:
            value, condition = getattr(case, "args", case)
            if condition in (False, sympy.false):
                continue
            kept.append(Case(value, condition))
            if condition in (True, sympy.true):
                break
        if not kept:
            return sympy.nan
        return kept[0].expr if kept[0].cond is sympy.true else sympy.Basic.__new__(cls, *kept)

    def _eval_derivative(self, x: Any) -> Any:
        derivatives = [(sympy.diff(value, x), condition) for value, condition in self.args]
        return Choice(*derivatives) if any(derivative != 0 for derivative, _ in derivatives) else sympy.Integer(0)

    def _eval_power(self, exponent: Any) -> Any:
        """Leave a power as it is: a root taken case by case has complex values in the cases that do not hold."""
        return None

    def _eval_simplify(self, **_: Any) -> Any:
        return self

    def _latex(self, printer: Any) -> Any:
        return printer._print_Piecewise(self)

    def _sympystr(self, printer: Any) -> str:
        return f"Piecewise({', '.join(printer._print(case) for case in self.args)})"


@dataclass(frozen=True)
class Extent:
    """Numbers of nodes, with repetitions: of an expression, and about of its first and second derivative."""

    nodes: int
    first: int
    second: int


_NUMBER = Extent(1, 0, 0)
_SYMBOL = Extent(1, 1, 0)


def measure(expression: Scalar, of_symbols: Mapping[Scalar, Extent] | None = None) -> Extent:
    """The extent of an expression, all of whose symbols may vary at once; some of them may stand for larger expressions."""
    known = dict(of_symbols or {})
    for node in bottom_up(expression):
        if node not in known:
            known[node] = _extent(node, [known[part] for part in node.args])
    return known[expression]


def bottom_up(expression: Scalar) -> Iterator[Scalar]:
    """Every different part of an expression once, after its own parts."""
    seen: set[Scalar] = set()
    stack = [(expression, False)]
    while stack:
        node, is_ready = stack.pop()
        if is_ready:
            yield node
        elif node not in seen:
            seen.add(node)
            stack.append((node, True))
            stack.extend((part, False) for part in node.args)


def _extent(node: Scalar, parts: list[Extent]) -> Extent:
    if not parts:
        varies = node.is_Symbol and ":" not in node.name  # the values of a function's memory, "@keeper.kept:3", are discrete states
        return _SYMBOL if varies else _NUMBER
    nodes = 1 + sum(part.nodes for part in parts)
    first, second = sum(part.first for part in parts), sum(part.second for part in parts)
    if isinstance(node, Case):
        return Extent(nodes, parts[0].first + parts[1].nodes, parts[0].second + parts[1].nodes)
    if isinstance(node, sympy.Add | sympy.Piecewise):
        return Extent(nodes, first + 1, second + 1)
    if isinstance(node, sympy.Abs):  # becomes a choice
        return Extent(3 * nodes, nodes + 2 * first, nodes + 2 * second)
    varying = [part for part in parts if part.first]
    if not varying:
        return Extent(nodes, 0, 0)
    count = len(varying) if node.is_Mul else 2 * len(varying)
    once = count * nodes + first
    return Extent(nodes, once, count * (once + nodes) + second)
