"""Laws as C++: SymPy's own printer, numbers by the shortest text that reads back the same."""

from __future__ import annotations

import math
from typing import Any

import sympy
from sympy.printing.cxx import CXX17CodePrinter

from cutjoint.model.records import Scalar

_LARGEST_POWER = 12


class RealNumbers:
    """The common part of printers of laws: every number is a real one.  Methods are called by the names of SymPy's classes."""

    def _print_Float(self, number: Any) -> str:
        return real(float(number))

    def _print_Integer(self, number: Any) -> str:
        return self._print_Float(number)

    def _print_NumberSymbol(self, number: Any) -> str:
        return self._print_Float(number)

    def _print_Pi(self, number: Any) -> str:
        return self._print_Float(number)

    def _print_Exp1(self, number: Any) -> str:
        return self._print_Float(number)

    def _print_Rational(self, number: Any) -> str:
        return f"{real(float(number.p))}/{real(float(number.q))}"

    def _print_Exponential(self, exponential: Any) -> str:
        return str(self._print(sympy.exp(exponential.args[0], evaluate=False)))  # type: ignore[attr-defined]

    def _print_Choice(self, choice: Any) -> str:
        return str(self._print_Piecewise(choice))  # type: ignore[attr-defined]


class _Printer(RealNumbers, CXX17CodePrinter):  # type: ignore[misc]
    """Whole powers without std::pow."""

    def _print_Pow(self, expression: Any) -> str:
        base, exponent = expression.as_base_exp()
        if exponent.is_Integer and 2 <= exponent <= _LARGEST_POWER:
            return f"power<{int(exponent)}>({self._print(base)})"
        return str(super()._print_Pow(expression))


def real(value: float) -> str:
    """A number of a law; a negative one in brackets."""
    if not math.isfinite(value):
        raise ValueError(f"{value} has no place in a law")
    return f"({value!r})" if value < 0 else repr(value)


def expression(law: Scalar) -> str:
    """A law as an expression over its variables' names."""
    return " ".join(_Printer({"math_macros": {}}).doprint(sympy.sympify(law)).split())
