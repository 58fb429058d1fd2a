"""Numbers and laws of a model with its parameters put in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import sympy

from cutjoint.formulate.inputs import input_functions, input_parameters
from cutjoint.model.evaluate import evaluate
from cutjoint.model.records import Binding, Model, Scalar, Scene
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
