"""The exponential function of sums with decimal numbers."""

from __future__ import annotations

from typing import Any

import sympy

from cutjoint.model.records import Scalar


class Exponential(sympy.Function):  # type: ignore[misc]
    """exp of a sum with a decimal number, anything else SymPy's.

    SymPy takes such a number out of the exponent, exp(x - 800.5) = exp(-800.5) exp(x): of its factors one may overflow and one vanish where
    the whole has a value.
    """

    nargs = 1

    @classmethod
    def eval(cls, argument: Scalar) -> Scalar | None:
        """SymPy's function where it leaves the exponent whole."""
        if argument.is_Add and any(part.is_Float for part in argument.args):
            return None
        return sympy.exp(argument)

    def fdiff(self, argindex: int = 1) -> Scalar:
        """Its slope, itself."""
        return self

    def _eval_is_extended_real(self) -> bool | None:
        return self.args[0].is_extended_real  # type: ignore[no-any-return]

    def _eval_is_extended_positive(self) -> bool | None:
        return self.args[0].is_extended_real  # type: ignore[no-any-return]

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        power = f"e^{{{printer.doprint(self.args[0])}}}"
        return power if exp is None else rf"\left({power}\right)^{{{exp}}}"

    def _sympystr(self, printer: Any) -> str:
        return f"exp({printer.doprint(self.args[0])})"
