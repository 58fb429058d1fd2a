"""Numbers and laws of a model with its parameters put in; laws as C++ by SymPy's own printer, with numbers that read back the same."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy
from sympy.printing.cxx import CXX17CodePrinter

from cutjoint.formulate.inputs import input_functions, input_parameters
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.evaluate import evaluate
from cutjoint.model.friction import bristle_name
from cutjoint.model.quantities import reading_elements
from cutjoint.model.records import Binding, Contact, FirstOrderState, Force, Model, Scalar, Scene, Signal, Wheel
from cutjoint.run.run_file import given_inputs, parameter_values

#: Components in the global frame.
Triple: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """The values of parameters, and inputs as the scene's functions of time."""

    values: Mapping[Scalar, float]
    inputs: Mapping[Scalar, Scalar]

    @classmethod
    def of(cls, model: Model, scene: Scene, parameters: Mapping[str, float]) -> Numbers:
        """The numbers of a scene after changes of parameters (SI units), and with inputs that these hold constant.

        Raises:
            RunError: a change names neither an open parameter nor an input.
        """
        changed = parameter_values(model, parameters)
        values = {p.symbol: changed.get(p.name, p.value) for p in model.parameters if p.binding is not Binding.INPUT}
        held = given_inputs(model, parameters)
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


def require_mechanics_alone(model: Model) -> None:
    """Raise ModelError for states, signals, laws that read other elements, friction by loads, grounds of wheels, contacts, gears with laws
    and functions of the user, which programs with mechanics alone do not have."""
    bristles = {bristle_name(f.name) for f in model.forces if f.by_load}
    reading = (e for e in reading_elements(model) if not (isinstance(e, Signal) and e.reported))  # outputs may be left out
    found = (*(s for s in model.states if s.name not in bristles), *(e for e in reading if not isinstance(e, FirstOrderState)))
    message = "only cutjoint has states, controllers and laws that read quantities"
    problems = [Problem(span=e.span, element=f"'{e.name}'", message=message, hint="leave it out") for e in found]
    problems += [
        Problem(span=f.span, element=f"'{f.name}'", message=f"only cutjoint has {_words(f)}", hint="leave it out")
        for f in model.forces if f.by_load or isinstance(f, Contact) or (f.has_road and f.expressions and f not in found)
    ]  # fmt: skip
    problems += [
        Problem(span=g.span, element=f"gear '{g.name}'", message=f"only cutjoint has gears {what}", hint="give it a ratio")
        for g in model.gears if (what := "with a law" if g.law is not None else "of more than two joints" if g.others else "")
    ]  # fmt: skip
    problems += [
        Problem(span=j.span, element=f"joint '{j.name}'", message="only cutjoint has armatures here", hint="leave it out")
        for j in model.joints if j.armature != 0
    ]
    problems += [
        Problem(span=f.span, element=f"function '{f.name}'", message="only cutjoint calls functions of users", hint="write an expression")
        for f in model.functions
    ]
    if problems:
        raise ModelError(problems)


def _words(force: Force) -> str:
    if force.by_load:
        return "friction by what a joint carries"
    if isinstance(force, Contact):
        return "contacts"
    return "wheels that turn" if isinstance(force, Wheel) else "a ground of a wheel's own"


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
