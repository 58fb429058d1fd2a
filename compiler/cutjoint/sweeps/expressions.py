"""Expressions over outputs, by the reader of model files."""

from __future__ import annotations

from cutjoint.model.expressions import Names, quantity_symbol, read_term, variable
from cutjoint.model.operations import ExpressionError, Term
from cutjoint.model.quantities import QuantityError, elements_of, find_quantity, quantities
from cutjoint.model.records import VALUE, Binding, Model, Output, Scalar, Span


def symbol_of(column: str) -> Scalar:
    """The symbol that stands for an output in expressions."""
    element, _, quantity = column.rpartition(".")
    return quantity_symbol(element, quantity)


class Reader:
    """Reads expressions over a model's outputs, its parameters and time ``t``; ``outputs`` are those that were used, by column."""

    def __init__(self, model: Model) -> None:
        self._elements = elements_of(model)
        self._own = frozenset(element.name for group in (model.states, model.signals) for element in group)
        fixed = {p.name: Term(p.symbol) for p in model.parameters if p.binding is not Binding.INPUT}
        moving = {p.symbol for p in model.parameters if p.binding is Binding.INPUT}
        derived = {d.name: Term(d.value) for d in model.derived if moving.isdisjoint(d.value.free_symbols)}
        self._names = {**fixed, **derived, "t": Term(variable("t"))}
        self.outputs: dict[str, Output] = {}

    def read(self, value: int | float | str, span: Span) -> tuple[Scalar, str]:
        """An expression and its unit, "" where that is not known.

        Raises:
            ExpressionError: it is none, or names something that the model does not have.
        """
        if not isinstance(value, str):
            return read_term(value, {}).value, ""
        outputs: dict[str, Output] = {}

        def quantity(name: str) -> Term:
            output = outputs.setdefault(name, self._output(name, span))
            return Term(quantity_symbol(output.element, output.quantity))

        expression = read_term(value, Names(self._names, self._own, quantity)).value
        self.outputs |= {output.column: output for _, output in sorted(outputs.items())}
        bare = value.strip().removeprefix("-").strip()
        if bare.startswith("abs(") and bare.endswith(")"):
            bare = bare[4:-1].strip()
        output = outputs.get(bare)
        return expression, "" if output is None else quantities(self._elements[output.element])[output.quantity]

    def _output(self, name: str, span: Span) -> Output:
        try:
            element, quantity = (name, VALUE) if name in self._own else find_quantity(self._elements, name, str, "")
        except QuantityError as error:
            raise ExpressionError(error.message, error.hint) from None
        return Output(element=element, quantity=quantity, span=span)
