"""Laws as plain Python: SymPy's own printer, numbers by the shortest text that reads back the same."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import sympy
from sympy.printing.pycode import PythonCodePrinter

from cutjoint.model.records import Scalar


class _Printer(PythonCodePrinter):  # type: ignore[misc]
    """Methods are called by the names of SymPy's classes."""

    def _print_Float(self, number: Any) -> str:
        value = float(number)
        if not math.isfinite(value):
            raise ValueError(f"{value} has no place in a law")
        return repr(value)

    def _print_Integer(self, number: Any) -> str:
        return repr(float(number))

    def _print_Rational(self, number: Any) -> str:
        return f"{float(number.p)!r}/{float(number.q)!r}"

    def _print_Choice(self, choice: Any) -> str:
        return str(self._print_Piecewise(choice))

    def _print_NumberSymbol(self, number: Any) -> str:
        return repr(float(number))

    def _print_Pi(self, number: Any) -> str:
        return self._print_NumberSymbol(number)

    def _print_Exp1(self, number: Any) -> str:
        return self._print_NumberSymbol(number)


def function(variables: Sequence[str], *laws: Scalar) -> str:
    """A law over variables and ``t``, of one value or of several."""
    values = [_expression(law) for law in laws]
    value = values[0] if len(values) == 1 else f"({', '.join(values)})"
    return f"lambda {', '.join((*variables, 't'))}: {value}"


def _expression(law: Scalar) -> str:
    return " ".join(_Printer().doprint(sympy.sympify(law)).split())
