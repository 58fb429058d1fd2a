"""Laws of forces and functions of time: every form in the file becomes one expression."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import sympy

from cutjoint.model.document import values
from cutjoint.model.document.source import Path, field_name
from cutjoint.model.errors import worded
from cutjoint.model.expressions.curves import monotone_cubic, polyline, surface
from cutjoint.model.expressions.operations import Term, choice
from cutjoint.model.expressions.parse import has_finite_numbers, variable, with_terms
from cutjoint.model.expressions.scope import FAILED, Element
from cutjoint.model.expressions.units import Dimension, Quantity, described
from cutjoint.model.records import Scalar

DRAWN = "drawn"  #: the keyword for the length or position in the design position
#: Variable, its key for the unloaded state, the key that it must not have, and the sign of the law.
_SPRINGS = (("length", "free_length", "free_position", 1), ("position", "free_position", "free_length", -1))


@dataclass(frozen=True)
class LawKind:
    """The ``variables`` of a law and its ``result`` with their dimensions, None for any."""

    variables: Mapping[str, Dimension | None]
    result: Dimension | None

    def per(self, name: str, power: int = 1) -> Dimension | None:
        """The dimension of the result over a power of a variable."""
        dimension = self.variables[name]
        return None if self.result is None or dimension is None else self.result / dimension**power


def read_law(
    element: Element, law: Any, kind: LawKind, keys: Path, names: Mapping[str, Term] | None = None, *, drawn: Scalar = 0
) -> Scalar:  # fmt: skip
    """The expression of a law over its variables and ``names`` (default: all parameters and quantities).
    ``drawn`` is the value of its length or position in the design position."""
    symbols = element.scope.reading(units=kind.variables) if names is None else names
    expression = _Law(element, kind, symbols, drawn).read(law, keys)
    if has_finite_numbers(expression):
        return expression
    element.fail(worded(field_name(keys), "a number in it overflows"), "write smaller numbers", keys)
    return FAILED


def read_lookup(element: Element, law: int | float | str | values.Table, result: Dimension | None, keys: Path) -> Scalar:
    """The value of an expression or a table over quantities, states, signals, parameters and the time."""
    names = element.scope.reading("t")
    if not isinstance(law, values.Table):
        return element.scalar(law, result, keys, names)
    terms = {name: element.term(name, (*keys, "table", name), names) for name in law.table if name != "value"}
    curve = read_law(element, law, LawKind({name: term.dimension for name, term in terms.items()}, result), keys, {})
    if any(term.value is FAILED for term in terms.values()):
        return FAILED
    return sympy.sympify(curve).xreplace({variable(name): term.value for name, term in terms.items()})


def dimension_of_table(element: Element, law: values.Table) -> Dimension | None:
    """The dimension of a table's first value; None for any."""
    first: Any = law.table.get("value", ())
    while isinstance(first, tuple) and first:
        first = first[0]
    if isinstance(first, Quantity | tuple):
        return first.dimension if isinstance(first, Quantity) else None
    return element.term(first, ("table", "value"), element.scope.constants()).dimension


def read_names(element: Element, let: Mapping[str, int | float | str], keys: Path, names: Mapping[str, Term]) -> Mapping[str, Term]:
    """``names`` with those of a ``let``, each a number that may be tunable, or an expression over those before; none hides another name."""
    known = names
    for name, value in let.items():
        if name in known:
            what = "parameter" if name in element.scope.names else "name above"
            element.fail(f"{field_name(keys)}: '{name}' is a {what} already", "choose another name", (*keys, name), at_key=True)
        else:
            known = with_terms(known, {name: element.tunable(element.term(value, (*keys, name), known), None, (*keys, name))})
    return known


@dataclass(frozen=True)
class _Law:
    element: Element
    kind: LawKind
    names: Mapping[str, Term]
    drawn: Scalar

    def read(self, law: Any, keys: Path) -> Scalar:
        match law:
            case values.Polynomial():
                return self.polynomial(law.polynomial, self.of(law.of, keys), (*keys, "polynomial"))
            case values.Piecewise():
                return self.piecewise(law, keys)
            case values.Sum():
                parts = [self.read(part, (*keys, "sum", index)) for index, part in enumerate(law.sum)]
                return sympy.Add(*parts)
            case values.Let():
                names = read_names(self.element, law.let, (*keys, "let"), self.names)
                return replace(self, names=names).read(law.law, (*keys, "law"))
            case values.Table():
                return self.table(law, keys)
            case values.SpringDamper():
                return self.spring(law, keys)
            case values.Stop():
                return self.stop(law.stop, (*keys, "stop"))
        return self.element.scalar(law, self.kind.result, keys, self.names)

    def of(self, name: str, keys: Path) -> str:
        """The variable that a law names; the first one when it names an unknown."""
        if name in self.kind.variables:
            return name
        hint = f"variables: {', '.join(self.kind.variables)}"
        self.element.fail(f"'{name}' is not a variable of this law", hint, (*keys, "of"))
        return next(iter(self.kind.variables))

    def polynomial(self, coefficients: tuple[Any, ...], of: str, keys: Path) -> Scalar:
        """The polynomial in Horner's form."""
        x = variable(of)
        terms = [self.element.scalar(value, self.kind.per(of, power), (*keys, power)) for power, value in enumerate(coefficients)]
        value = terms[-1]
        for term in reversed(terms[:-1]):
            value = term + x * value
        return value

    def piecewise(self, law: values.Piecewise, keys: Path) -> Scalar:
        of = self.of(law.of, keys)
        branches, limits = [], [-math.inf]
        for index, piece in enumerate(law.piecewise):
            inner = (*keys, "piecewise", index)
            value = self.piece(piece, of, inner)
            condition = self.limit(piece, of, index == len(law.piecewise) - 1, limits, inner)
            branches.append((value, condition))
        return choice(*branches) if len(branches) > 1 else branches[0][0]

    def piece(self, piece: values.Branch, of: str, keys: Path) -> Scalar:
        if piece.polynomial is not None:
            return self.polynomial(piece.polynomial, of, (*keys, "polynomial"))
        assert piece.expression is not None
        return self.element.scalar(piece.expression, self.kind.result, (*keys, "expression"), self.names)

    def limit(self, piece: values.Branch, of: str, last: bool, limits: list[float], keys: Path) -> Scalar:
        """The condition of one piece; ``limits`` are the values of the limits so far."""
        if last or piece.below is None:
            if last != (piece.below is None):
                message = "the last piece has no 'below'" if last else "only the last piece has no 'below'"
                self.element.fail(message, "it applies beyond the last limit", keys)
            return sympy.true
        below = self.element.scalar(piece.below, self.kind.variables[of], (*keys, "below"))
        limits.append(self.element.value(below))
        if limits[-1] <= limits[-2]:
            self.element.fail("the limits of the pieces do not rise", "sort the pieces by 'below'", (*keys, "below"))
        return sympy.StrictLessThan(variable(of), below, evaluate=False)

    def table(self, law: values.Table, keys: Path) -> Scalar:
        inner = (*keys, "table")
        others = [name for name in law.table if name != "value"]
        if len(others) not in (1, 2) or "value" not in law.table:
            message = "a table has the list of a variable, or of two, and 'value'"
            self.element.fail(message, "for example {length: [0, 1], value: [0, 100]}", inner)
            return FAILED
        unknown = [name for name in others if name not in self.kind.variables]
        for name in unknown:
            hint = f"variables: {', '.join(self.kind.variables)}"
            self.element.fail(f"'{name}' is not a variable of this law", hint, (*inner, name), at_key=True)
        if unknown:
            return FAILED
        lists = [self.column(law.table[of], self.kind.variables[of], (*inner, of)) for of in others]
        if len(others) == 2:
            return self.surface(law, others, lists, inner)
        y = self.column(law.table["value"], self.kind.result, (*inner, "value"), self.ordinate)
        return self.curve(law, others[0], lists[0], y, inner) if self.is_curve(others[0], lists[0], y, inner) else FAILED

    def curve(self, law: values.Table, of: str, x: list[float], y: list[Scalar], keys: Path) -> Scalar:
        through = polyline if law.interpolation == "linear" else monotone_cubic
        return self.fitting(lambda: through(variable(of), x, y), of, keys)

    def surface(self, law: values.Table, of: list[str], lists: list[list[float]], keys: Path) -> Scalar:
        """The surface of a table of two variables, a row of values for each of the first one."""
        (x, y), rows = lists, law.table["value"]
        read = [
            self.column(row, self.kind.result, (*keys, "value", i), self.ordinate) if isinstance(row, tuple) else []
            for i, row in enumerate(rows)
        ]
        if len(rows) != len(x) or any(len(row) != len(y) for row in read) or min(len(x), len(y)) < 2:
            message = f"the table has {len(x)} of {of[0]} and {len(y)} of {of[1]}, and needs as many rows of as many values, two or more"
            self.element.fail(message, f"give a list of values for each {of[0]}: value: [[...], [...]]", (*keys, "value"))
            return FAILED
        rising = [self.rises(name, numbers, keys) for name, numbers in zip(of, lists, strict=True)]
        if not all(rising) or not self.are_finite((*x, *y, *(number for row in read for number in row))):
            return FAILED
        u, v = map(variable, of)
        return self.fitting(lambda: surface(u, x, v, y, read, is_linear=law.interpolation == "linear"), of[0], keys)

    def fitting(self, draw: Callable[[], Scalar], of: str, keys: Path) -> Scalar:
        """The expression of a curve whose numbers fit floats."""
        try:
            curve = draw()
        except ArithmeticError:
            curve = sympy.oo
        if has_finite_numbers(curve):
            return curve
        self.element.fail("the curve through the table is too steep for numbers", f"take {of} farther apart, or smaller values", keys)
        return FAILED

    def ordinate(self, value: int | float | str, dimension: Dimension | None, keys: Path) -> Scalar:
        """A value of a table: a float, or an expression over parameters; it may be tunable."""
        found = self.element.scalar(value, dimension, keys)
        return found if getattr(found, "free_symbols", ()) else self.element.value(found)

    def are_finite(self, numbers: Iterable[Scalar]) -> bool:
        """Return whether numbers and expressions have been read."""
        return all(math.isfinite(x) if isinstance(x, float) else not x.has(FAILED) for x in numbers)

    def column(
        self, numbers: tuple[Any, ...], dimension: Dimension | None, keys: Path, read: Callable[..., Any] | None = None
    ) -> list[Any]:  # fmt: skip
        """The numbers of a list, each as ``read`` has it; the dimension of a file's column, which all its numbers have, is checked once."""
        first = numbers[0] if numbers else None
        if isinstance(first, Quantity) and dimension not in (None, first.dimension):
            self.element.fail(f"{field_name(keys)} needs {described(dimension)}, got {described(first.dimension)}", "", keys)
            return [math.nan] * len(numbers)
        for index in (index for index, number in enumerate(numbers) if isinstance(number, tuple)):
            self.element.fail("a list stands where a table of one variable has a number", "give one value for each", (*keys, index))
            return [math.nan] * len(numbers)
        return [(read or self.element.number)(value, dimension, (*keys, index)) for index, value in enumerate(numbers)]

    def is_curve(self, of: str, x: list[float], y: list[Scalar], keys: Path) -> bool:
        """Return whether a table's lists make a curve; note their faults."""
        if len(x) != len(y) or len(x) < 2:
            message = f"the table has {len(x)} of {of} and {len(y)} of value"
            self.element.fail(message, "give as many of both, two or more", keys)
            return False
        return self.rises(of, x, keys) and self.are_finite((*x, *y))

    def rises(self, of: str, x: list[float], keys: Path) -> bool:
        """Return whether the numbers of a variable rise; note the first that does not."""
        for index, (a, b) in enumerate(pairwise(x), start=1):
            if b <= a:
                self.element.fail(f"the table's {of} does not rise", "sort the table", (*keys, of, index))
                return False
        return True

    def spring(self, law: values.SpringDamper, keys: Path) -> Scalar:
        """Linear spring and damper: tension along a line, or the restoring force of a joint."""
        for name, free, other, sign in _SPRINGS:
            if name in self.kind.variables:
                return self.linear(law, name, free, other, keys) * sign + self.preload(law, free, keys)
        self.element.fail("stiffness and damping belong to a point_spring or a joint_force", "write an expression", keys)
        return FAILED

    def linear(self, law: values.SpringDamper, name: str, free: str, other: str, keys: Path) -> Scalar:
        """stiffness (x - free) + damping rate."""
        rest = getattr(law, free)
        if getattr(law, other) is not None or (rest is None and law.preload is None and law.stiffness != 0):
            self.element.fail(f"a spring of this kind needs {free}", f"write {free}: {DRAWN} for what is drawn, or a preload", keys)
        stiffness = self.element.scalar(law.stiffness, self.kind.per(name), (*keys, "stiffness"))
        damping = self.element.scalar(law.damping, self.kind.per("rate"), (*keys, "damping"))
        is_drawn = law.preload is not None or (rest == DRAWN and DRAWN not in self.names)
        origin = self.drawn if is_drawn else self.element.scalar(rest or 0, self.kind.variables[name], (*keys, free))
        return stiffness * (variable(name) - origin) + damping * variable("rate")

    def preload(self, law: values.SpringDamper, free: str, keys: Path) -> Scalar:
        """The force in the design position of a spring with a preload."""
        if law.preload is None:
            return sympy.Integer(0)
        if getattr(law, free) is not None:
            self.element.fail(f"preload is the force where the file draws it, and {free} says another", f"leave {free} away", (*keys, free))
        return self.element.scalar(law.preload, self.kind.result, (*keys, "preload"))

    def stop(self, law: values.OneSided, keys: Path) -> Scalar:
        """A soft stop on one side of a place; a force that separates two points is negative tension."""
        if _position(self.kind) is None:
            self.element.fail("a stop belongs to a force over length, travel or position", "write an expression", keys)
            return FAILED
        side = {"lower" if law.side == "below" else "upper": law.at}
        return soft_stops(self.element, self.kind, keys, law.stiffness, law.damping, **side)


def _position(kind: LawKind) -> str | None:
    """The variable that is the position of a force element."""
    return next((name for name in ("length", "travel", "position") if name in kind.variables), None)


def soft_stops(
    element: Element, kind: LawKind, keys: Path, stiffness: Any, damping: Any, *, lower: Any = None, upper: Any = None
) -> Scalar:
    """The law of one-sided springs and dampers below ``lower`` and above ``upper``, which never pull."""
    name = _position(kind)
    assert name is not None
    k = element.scalar(stiffness, kind.per(name), (*keys, "stiffness"))
    c = element.scalar(damping, kind.per("rate"), (*keys, "damping"))
    if element.value(k) <= 0:
        element.fail("the stiffness of a stop must be greater than zero", "", (*keys, "stiffness"))
    if element.value(c) < 0:
        element.fail("the damping of a stop must not be negative", "", (*keys, "damping"))
    branches: list[tuple[Scalar, Scalar]] = []
    for end, key, beyond, inward in (
        (lower, "lower", sympy.StrictLessThan, sympy.StrictGreaterThan),
        (upper, "upper", sympy.StrictGreaterThan, sympy.StrictLessThan),
    ):
        if end is not None:
            place = (*keys, key) if keys[-1] == "limits" else (*keys, "at")
            limit = element.scalar(end, kind.variables[name], place)
            force = k * (limit - variable(name)) - c * variable("rate")
            if force.has(FAILED):
                return FAILED
            met = beyond(variable(name), limit, evaluate=False)
            pushes = inward(force, 0, evaluate=False)
            branches.append((force, met if c == 0 else sympy.And(met, pushes, evaluate=False)))
    return choice(*branches, (sympy.Integer(0), sympy.true)) * (-1 if name == "length" else 1)
