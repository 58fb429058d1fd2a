"""Outputs: quantities of elements, and expressions of them with a name and a unit of their own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import sympy

from cutjoint.model.document import model_file
from cutjoint.model.document.source import Path
from cutjoint.model.elements.expand import Expansion
from cutjoint.model.elements.instances import find_uses
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.expressions.quantities import Element as Quantified
from cutjoint.model.expressions.quantities import QuantityError, find_quantity, is_angular_speed
from cutjoint.model.expressions.scope import FAILED, Element
from cutjoint.model.expressions.units import NONE, Measure, UnitError, described, fault_of_hertz, measure
from cutjoint.model.records import VALUE, Output, Signal, Span

_Entry: TypeAlias = str | dict[str, model_file.OutputExpression]


@dataclass
class OutputReader:
    """Reads lists of outputs; ``signals`` are the expressions of all that have one, by their names.
    ``_of_instances`` are the expressions of instances with their places and prefixes, by the names that other lists have for them."""

    expansion: Expansion
    known: Mapping[str, Quantified]
    signals: dict[str, Signal] = field(default_factory=dict)
    _units: dict[str, str] = field(default_factory=dict)
    _of_instances: dict[str, tuple[dict[str, model_file.OutputExpression], Path, str]] = field(default_factory=dict)

    def default(self, model: model_file.Document) -> tuple[Output, ...]:
        """The model's outputs, then those of each instance."""
        scope = self.expansion.scope
        lists = [(use.name, use.submodel.outputs, (*use.at, "outputs")) for use in find_uses(model) if use.submodel is not None]
        for name, entries, path in lists:
            expressions = ((index, entry) for index, entry in enumerate(entries) if not isinstance(entry, str))
            self._of_instances |= {f"{name}.{next(iter(entry))}": (entry, (*path, index), f"{name}.") for index, entry in expressions}
        found = {o.column: o for o in self.outputs(Element(scope, "outputs", "", ()), model.outputs, ("outputs",), "")}
        for name, entries, path in lists:
            for output in self.outputs(Element(scope, f"instance '{name}'", name, ()), entries, path, f"{name}."):
                found.setdefault(output.column, output)
        return tuple(found.values())

    def outputs(self, where: Element, entries: Sequence[_Entry], path: Path, prefix: str) -> tuple[Output, ...]:
        """The outputs of a list at a path, whose names have a prefix."""
        found: dict[str, Output] = {}
        for index, entry in enumerate(entries):
            span = where.scope.source.value_span((*path, index))
            if isinstance(entry, str) and (named := self._of_instances.get(prefix + entry)):
                name, output = entry, found.get(prefix + entry) or self._expression(*named)
            elif isinstance(entry, str):
                name, output = entry, self._quantity(where, entry, prefix, span)
            else:
                name = next(iter(entry))
                output = found.get(prefix + name) or self._expression(entry, (*path, index), prefix)
            if output is not None and output.column in found:
                where.scope.problems.add(span, where.label, f"the output '{name}' stands twice", "remove one")
            elif output is not None:
                found[output.column] = output
        return tuple(found.values())

    def _quantity(self, where: Element, name: str, prefix: str, span: Span) -> Output | None:
        try:
            element, quantity = find_quantity(self.known, name, lambda local: prefix + local, prefix, where.scope.directory.broken)
        except QuantityError as error:
            if not where.scope.directory.misses(error.element):
                where.scope.problems.add(span, where.label, f"output '{name}': {error.message}", error.hint)
            return None
        return Output(element=element, quantity=quantity, span=span)

    def _expression(self, entry: dict[str, model_file.OutputExpression], path: Path, prefix: str) -> Output | None:
        """An output by an expression, which is a signal that nothing reads."""
        ((local, part),) = entry.items()
        name, scope = prefix + local, self.expansion.reporting.get(prefix)
        if scope is None:
            return None  # of an instance whose problems are noted
        where = Element(scope, f"output '{name}'", name, (*path, local))
        if name == "t":
            where.fail("the column 't' is the time", "choose another name")
        term = where.term(part.value, (VALUE,), scope.reading("t"))
        value = where.scalar(part.value, None, (VALUE,), scope.reading("t"))
        own = "" if term.dimension in (None, NONE) else str(term.dimension)
        unit = None if part.unit is None else read_unit(where, part.unit, ("unit",))
        if unit is not None and term.dimension not in (None, unit.dimension):
            message = f"unit {part.unit} does not fit: the expression is in {described(term.dimension)}"
            where.fail(message, "write a unit of that", ("unit",))
        elif part.unit is not None and is_angular_speed(self.known, f"{prefix}{part.value}") and (fault := fault_of_hertz(part.unit)):
            where.fail(fault, "", ("unit",))
        if value is FAILED or (unit is None and part.unit is not None):
            return None
        signal = Signal(
            name=name, symbol=quantity_symbol(name, VALUE), value=sympy.sympify(value), unit=own if unit is None else unit.unit,
            span=where.span, reported=True,
        )  # fmt: skip
        self._keep(where, signal, part.unit or "")
        factor = 1.0 if unit is None else 1.0 / unit.value
        return Output(element=name, quantity=VALUE, span=where.span, name=name, unit=part.unit or "", factor=factor)

    def _keep(self, where: Element, signal: Signal, unit: str) -> None:
        """Take note of the signal; it may stand in several scenes, if it is the same there."""
        before = self.signals.setdefault(signal.name, signal)
        if signal.name in self.known or any(signal.name in (output, f"{output}.") for output in self.expansion.reporting if output):
            where.fail(f"duplicate name '{signal.name}', which an element has", "rename one of them")
        elif (before.value, self._units.setdefault(signal.name, unit)) != (signal.value, unit):
            place = before.span.seen_from(signal.span)
            where.fail(f"duplicate name '{signal.name}', first defined at {place} with another value or unit", "rename one of them")


def read_unit(where: Element, unit: str, keys: Path) -> Measure | None:
    """One of a unit that something is converted to; None where it is wrong, which is noted at ``keys``."""
    try:
        one = measure(1.0, unit)
        if measure(0.0, unit).value == 0.0:
            return one
        where.fail(f"unit {unit} does not begin at zero", "write one that does, such as K", keys)
    except UnitError as error:
        where.fail(str(error), "write for example deg or N*s/m", keys)
    return None
