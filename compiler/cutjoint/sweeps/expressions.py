"""Expressions over outputs: names with dots, by the reader of model files."""

from __future__ import annotations

import re
from collections.abc import Mapping

from cutjoint.model.errors import nearest
from cutjoint.model.expressions import read_term, symbols_of, variable
from cutjoint.model.operations import ExpressionError, Term
from cutjoint.model.quantities import quantities
from cutjoint.model.records import Binding, Model, Output, Scalar, Span

#: Stands for the dot of an output's name in symbols; no name of a model has two underscores in a row.
_DOT = "__"
_DOTTED = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+", re.ASCII)


def symbol_of(column: str) -> Scalar:
    """The symbol that stands for an output in expressions."""
    return variable(column.replace(".", _DOT))


class Reader:
    """Reads expressions over a model's outputs, its parameters and time ``t``; ``outputs`` are those that were used, by column."""

    def __init__(self, model: Model) -> None:
        groups = (model.bodies, model.markers, model.reactions, model.force_elements, model.joints, model.gears)
        self._elements = {element.name: element for group in groups for element in group}
        fixed = {p.name: Term(p.symbol) for p in model.parameters if p.binding is not Binding.INPUT}
        moving = {p.symbol for p in model.parameters if p.binding is Binding.INPUT}
        derived = {d.name: Term(d.value) for d in model.derived if moving.isdisjoint(d.value.free_symbols)}
        self._names = {**fixed, **derived, "t": Term(variable("t"))}
        self._units: dict[str, str] = {}
        self.outputs: dict[str, Output] = {}

    def read(self, value: int | float | str, span: Span) -> tuple[Scalar, str]:
        """An expression and its unit, "" where that is not known.

        Raises:
            ExpressionError: it is none, or names something that the model does not have.
        """
        if not isinstance(value, str):
            return read_term(value, {}).value, ""
        text = _DOTTED.sub(lambda found: found[0].replace(".", _DOT), value)
        used = {name.replace(_DOT, "."): name for name in symbols_of(text) if _DOT in name}
        outputs = {column: self._output(column, span) for column in sorted(used)}
        names: Mapping[str, Term] = {**self._names, **{used[column]: Term(symbol_of(column)) for column in outputs}}
        try:
            expression = read_term(text, names).value
        except ExpressionError as error:
            raise ExpressionError(_as_written(error.message, used), _as_written(error.hint, used)) from None
        self.outputs |= outputs
        bare = value.strip().removeprefix("-").strip()
        if bare.startswith("abs(") and bare.endswith(")"):
            bare = bare[4:-1].strip()
        return expression, self._units.get(bare, "")

    def _output(self, column: str, span: Span) -> Output:
        element, _, quantity = column.rpartition(".")
        if element not in self._elements:
            raise ExpressionError(f"unknown element '{element}'", nearest(element, self._elements, "elements"))
        allowed = quantities(self._elements[element])
        if quantity not in allowed:
            hint = nearest(quantity, allowed, "quantities") or "it has none"
            raise ExpressionError(f"'{element}' has no quantity '{quantity}'", hint)
        self._units[column] = allowed[quantity]
        return Output(element=element, quantity=quantity, span=span)


def _as_written(text: str, used: Mapping[str, str]) -> str:
    """A message with the names of outputs as the user wrote them."""
    for column, name in used.items():
        text = text.replace(name, column)
    return text
