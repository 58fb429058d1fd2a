"""Parameters: numbers, and expressions of other parameters, which are substituted wherever these are used."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import sympy

from cutjoint.model.document import model_file
from cutjoint.model.errors import worded
from cutjoint.model.expressions.dependencies import in_order
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.parse import parameter_symbol, read_term, symbols_of
from cutjoint.model.expressions.scope import FAILED_TERM, Element, Scope, element
from cutjoint.model.expressions.units import NONE, Dimension, Measure, UnitError, described, measure, read_measure
from cutjoint.model.records import Binding, DerivedParameter, Parameter


@dataclass(frozen=True)
class Parameters:
    """The parameters of a model: given ones, derived ones, and each one's term by its name in the file's order."""

    independent: tuple[Parameter, ...]
    derived: tuple[DerivedParameter, ...]
    terms: Mapping[str, Term]

    def extend(self, scope: Scope) -> Scope:
        """The scope of a model that has these parameters."""
        return replace(
            scope, names=self.terms, values={p.symbol: p.value for p in self.independent},
            settled={p.symbol: sympy.Float(p.value) for p in self.independent if p.binding is Binding.CONST},
            moving=frozenset(p.symbol for p in self.independent if p.binding is Binding.INPUT),
        )  # fmt: skip


def read_parameters(scope: Scope, model: model_file.Document, lost: frozenset[str]) -> Parameters:
    """All parameters, whichever stands first in the file; ``lost`` ones have no value, and their uses are not judged."""
    parts = {name: entry if isinstance(entry, model_file.Parameter) else model_file.Parameter(value=entry)
             for name, entry in model.parameters.items()}  # fmt: skip
    used = {name: symbols_of(part.value) & parts.keys() for name, part in parts.items()}
    where = {name: element(scope, "parameter", "parameters", name) for name in parts}
    numbers, terms = _read_numbers({name: part for name, part in parts.items() if not symbols_of(part.value)}, where)
    values = {p.symbol: p.value for p in numbers}
    terms |= dict.fromkeys(lost, FAILED_TERM)
    for name in _in_order(used, where):
        if name not in terms:
            terms[name] = _read_derived(where[name], parts[name], terms, values)
    terms = {name: terms.get(name, FAILED_TERM) for name in (*parts, *sorted(lost))}
    derived = tuple(
        DerivedParameter(name=name, value=terms[name].value, span=where[name].span) for name in parts if symbols_of(parts[name].value)
    )
    return Parameters(numbers, derived, terms)


def _read_numbers(parts: Mapping[str, model_file.Parameter], where: Mapping[str, Element]) -> tuple[tuple[Parameter, ...], dict[str, Term]]:
    parameters, terms = [], {}
    for name, part in parts.items():
        found, dimension = _number(where[name], part)
        symbol, binding = parameter_symbol(name), Binding(part.binding)
        if where[name].scope.tunables.takes(name) and binding is Binding.CONST:
            binding = Binding.PARAM
        parameters.append(Parameter(name=name, symbol=symbol, value=found.value, unit=found.unit, binding=binding, span=where[name].span))
        terms[name] = FAILED_TERM if math.isnan(found.value) else Term(symbol, dimension)
    return tuple(parameters), terms


def _number(where: Element, part: model_file.Parameter) -> tuple[Measure, Dimension | None]:
    """The value in SI; the dimension is None when no unit is given."""
    try:
        written = read_measure(part.value) if isinstance(part.value, str) else None
        if written is not None and part.unit is not None:
            where.fail("has two units", "write the unit once", ("unit",))
        if written is None and part.unit is not None:
            written = measure(_plain_number(part.value), part.unit)
        if written is not None:
            return written, written.dimension
        return Measure(_plain_number(part.value), NONE, ""), None
    except ExpressionError as error:
        where.fail(worded("value", error.message), error.hint, ("value",))
    except UnitError as error:
        where.fail(str(error), "write for example N*s/m", ("unit",) if part.unit is not None else ("value",))
    return Measure(math.nan, NONE, ""), None


def _plain_number(value: int | float | str) -> float:
    number = read_term(value, {}).number
    assert number is not None  # an expression without names is a number
    return number


def _in_order(used: Mapping[str, frozenset[str]], where: Mapping[str, Element]) -> list[str]:
    """The parameters, each after those that it uses; cycles are reported, and they and their dependents are left out."""
    ordered, found = in_order(used)
    for circle in found:
        _note_circle(where, circle)
    circles = {name for circle in found for name in circle}  # then their dependents, too
    order: list[str] = []
    for name in ordered:
        if circles.isdisjoint(used[name]):
            order.append(name)
        else:
            circles.add(name)
    return order


def _note_circle(where: Mapping[str, Element], circle: Sequence[str]) -> None:
    names = ", ".join(f"'{name}'" for name in (*circle[1:], circle[0]))
    message = f"value: it follows from {names} in a circle" if len(circle) > 1 else "value: it follows from itself"
    where[circle[0]].fail(message, "give one of them a number" if len(circle) > 1 else "give it a number", ("value",))


def _read_derived(where: Element, part: model_file.Parameter, terms: Mapping[str, Term], values: Mapping[sympy.Symbol, float]) -> Term:
    if "binding" in part.model_fields_set:
        where.fail("binding: it changes with the parameters that it follows from", "remove binding", ("binding",))
    term = where.term(part.value, ("value",), terms)
    if term is FAILED_TERM:
        return term
    if not term.value.has(sympy.nan) and not math.isfinite(evaluate(term.value, values)):
        where.fail("value has no finite value", "", ("value",))
        return FAILED_TERM
    return term if part.unit is None else replace(term, dimension=_stated(where, part.unit, term.dimension))


def _stated(where: Element, unit: str, dimension: Dimension | None) -> Dimension | None:
    """The dimension of a derived parameter with a unit, which must be one of SI and that of the expression."""
    try:
        found = measure(1.0, unit)
    except UnitError as error:
        where.fail(str(error), "write for example N*s/m", ("unit",))
        return dimension
    if found.value != 1.0:
        where.fail(f"unit: an expression of parameters is in SI units, not in {unit}", f"write unit: {found.unit}", ("unit",))
    elif dimension not in (None, found.dimension):
        where.fail(f"value needs {described(found.dimension)}, got {described(dimension)}", "", ("value",))
        return None
    return found.dimension
