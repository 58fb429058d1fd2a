"""Laws as plain Python: SymPy's own printer, numbers by the shortest text that reads back the same."""

from __future__ import annotations

from collections.abc import Sequence

import sympy
from sympy.printing.pycode import PythonCodePrinter

from cutjoint.model.records import Scalar
from cutjoint_bench.export.laws import RealNumbers


class _Printer(RealNumbers, PythonCodePrinter):  # type: ignore[misc]
    """Functions of math."""


def function(variables: Sequence[str], *laws: Scalar) -> str:
    """A law over variables and ``t``, of one value or of several."""
    values = [_expression(law) for law in laws]
    value = values[0] if len(values) == 1 else f"({', '.join(values)})"
    return f"lambda {', '.join((*variables, 't'))}: {value}"


def _expression(law: Scalar) -> str:
    return " ".join(_Printer().doprint(sympy.sympify(law)).split())
