"""Numbers and laws of a model with its parameters put in; laws as C++ by SymPy, with numbers that read back the same."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import sympy
from numpy.typing import NDArray
from sympy.printing.cxx import CXX17CodePrinter

from cutjoint.formulate.inputs import input_functions, input_parameters
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.records import Binding, Model, Scalar, Scene
from cutjoint.run.run_file import constant_inputs, parameter_values

#: Components in the global frame.
Triple: TypeAlias = tuple[float, float, float]
_LARGEST_POWER = 12
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """The values of parameters, and inputs as the scene's functions of time."""

    values: Mapping[Scalar, float]
    inputs: Mapping[Scalar, Scalar]

    @classmethod
    def of(cls, model: Model, scene: Scene, parameters: Mapping[str, float]) -> "Numbers":
        """The numbers of a scene after changes of parameters (SI units), and with inputs that these hold constant.
        Raises RunError: a change names neither a tunable parameter nor an input.
        """
        changed = parameter_values(model, parameters)
        values = {p.symbol: changed.get(p.name, p.value) for p in model.parameters if p.binding is not Binding.INPUT}
        held = constant_inputs(model, parameters)
        inputs = {p.symbol: sympy.Float(held[p.name]) for p in input_parameters(model) if p.name in held}
        return cls(values=values, inputs={**input_functions(model, scene), **inputs})

    def number(self, expression: Scalar) -> float:
        """The value of an expression over parameters."""
        return evaluate(sympy.sympify(expression), self.values)

    def triple(self, vector: Sequence[Scalar]) -> Triple:
        """The values of three expressions."""
        x, y, z = (self.number(e) for e in vector)
        return x, y, z

    def law(self, expression: Scalar) -> Scalar:
        """An expression over the variables of its law and ``t`` alone."""
        known = {symbol: sympy.Float(value) for symbol, value in self.values.items()}
        return sympy.sympify(expression).xreplace(dict(self.inputs)).xreplace(known)


class RealNumbers:
    """The common part of printers of laws: every number is a real one.  Methods are called by the names of SymPy's classes."""

    def _print_Float(self, number: Any) -> str:
        return real(float(number))

    _print_Integer = _print_NumberSymbol = _print_Pi = _print_Exp1 = _print_Float  # noqa: N815

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
