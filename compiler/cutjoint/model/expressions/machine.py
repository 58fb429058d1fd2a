"""The quantities of a whole model, as laws of forces, rates of states, signals and controllers read them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

from cutjoint.model.document import model_file
from cutjoint.model.document.values import Table
from cutjoint.model.elements.controllers import dimension_of_sample, memory_term
from cutjoint.model.elements.mirror import Image
from cutjoint.model.errors import IgnoredProblems
from cutjoint.model.expressions.laws import dimension_of_table
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.expressions.quantities import Element, QuantityError, find_quantity, follows_from_forces, quantities
from cutjoint.model.expressions.scope import FAILED, FAILED_TERM, UNKNOWN, Scope, element
from cutjoint.model.expressions.scope import Element as ScopedElement
from cutjoint.model.expressions.units import Dimension, measure
from cutjoint.model.records import VALUE, Controller, Joint, Signal


@dataclass
class Machine:
    """The elements of a model, which ``survey`` finds when the first of their quantities is read; ``scopes`` by their prefixes.
    ``terms`` are those of signals that were read for their dimensions, but while that of a controller's sample is open."""

    survey: Callable[[], Mapping[str, Element]]
    scopes: dict[str, Scope] = field(default_factory=dict)
    terms: dict[str, Term] = field(default_factory=dict)
    _signals: dict[str, tuple[Scope, int | float | str | Table]] = field(default_factory=dict)
    _controllers: dict[str, tuple[Scope, model_file.Controller]] = field(default_factory=dict)
    _dimensions: dict[str, Dimension | None] = field(default_factory=dict)
    _open: int = 0

    @cached_property
    def _elements(self) -> Mapping[str, Element]:
        return self.survey()

    @cached_property
    def _joints(self) -> Mapping[str, Joint]:
        return {joint.name: joint for joint in self._elements.values() if isinstance(joint, Joint)}

    def expect(self, scope: Scope, part: model_file.Elements) -> None:
        """Take note of the signals and controllers of a scope, whose dimensions others may ask for before they are read."""
        self.scopes[scope.prefix] = scope
        self._signals.update({scope.prefix + name: (scope, value) for name, value in part.signals.items()})
        self._controllers.update({scope.prefix + name: (scope, controller) for name, controller in part.controllers.items()})

    def read(self, scope: Scope, name: str, *, reported: bool = False) -> Term:
        """The term of "element.quantity", or of a state or a signal, by its name in a scope; as in the original if mirrored.
        Raises ExpressionError: there is no such quantity, or only one that is ``reported`` may read it."""
        if memory := self._memory(scope.full(name)):
            return memory
        found = self._found(scope, name, reported=reported)
        if found is None:
            return FAILED_TERM
        term = self._term(*found)
        for axis in scope.mirrors:
            term = replace(term, value=Image(axis, self._joints).sign(self._elements[found[0]], found[1]) * term.value)
        return term

    def _memory(self, name: str) -> Term | None:
        """The memory of a function that a controller has under this name."""
        owner, _, own = name.rpartition(".")
        part = self._controllers[owner][1].memory.get(own) if owner in self._controllers else None
        return memory_term(owner, own, part) if isinstance(part, model_file.FunctionMemory) else None

    def _found(self, scope: Scope, name: str, *, reported: bool) -> tuple[str, str] | None:
        """An element and its quantity; None if the name may refer to an element that could not be read."""
        whole, elements = scope.full(name), self._elements
        if whole in elements and VALUE in quantities(elements[whole]):
            return whole, VALUE
        try:
            found = find_quantity(elements, name, scope.full, scope.prefix, scope.directory.broken)
        except QuantityError as error:
            if error.element == UNKNOWN or scope.directory.misses(error.element):
                return None
            raise ExpressionError(f"quantity '{name}': {error.message}", error.hint) from None
        if not reported and not scope.sampled and follows_from_forces(elements[found[0]], found[1]):
            reason = "accelerations and reactions follow from all forces, and so from what reads them"
            hint = "use positions and speeds, or let a controller sample it"
            raise ExpressionError(f"the quantity '{name}' cannot be used here: {reason}", hint)
        return found

    def _term(self, name: str, quantity: str) -> Term:
        found = self._elements[name]
        unit = quantities(found)[quantity]
        match found:
            case Signal():
                known = self._dimension(name, "signal", name, self._signals, self._dimension_of_signal)
            case Controller():
                read = partial(dimension_of_sample, value=quantity)
                known = self._dimension(f"{name}.{quantity}", "controller", name, self._controllers, read)
            case _:
                known = measure(1.0, unit).dimension if unit else None
        return Term(quantity_symbol(name, quantity), known)

    def _dimension_of_signal(self, where: ScopedElement, value: int | float | str | Table) -> Dimension | None:
        if isinstance(value, Table):
            return dimension_of_table(where, value)
        term = where.term(value, (), where.scope.reading("t"))
        if not self._open and not term.value.has(FAILED):
            self.terms[where.name] = term
        return term.dimension

    def _dimension(
        self, key: str, kind: str, name: str, known: Mapping[str, tuple[Scope, Any]], read: Callable[..., Dimension | None]
    ) -> Dimension | None:
        """The dimension of a signal or of a discrete state of a controller; None of one that depends on itself."""
        if key not in self._dimensions and name in known:
            self._dimensions[key] = None
            scope, part = known[name]
            where = element(replace(scope, problems=IgnoredProblems()), kind, f"{kind}s", name.removeprefix(scope.prefix))
            self._open += kind == "controller"
            self._dimensions[key] = read(where, part)
            self._open -= kind == "controller"
        return self._dimensions.get(key)
