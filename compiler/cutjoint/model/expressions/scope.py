"""The meaning of names while elements are read, in the model or in one instance of a submodel."""

import math
from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import sympy

from cutjoint.model.document import element_parts as joint_parts
from cutjoint.model.document.source import Path, Source, field_name
from cutjoint.model.document.values import LOST
from cutjoint.model.errors import Problems, nearest, worded
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.functions import SuppliedCall
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.parse import READERS, Names, dimension_beside_units, read_term, variable
from cutjoint.model.expressions.tunable import TunableNumbers, number_name
from cutjoint.model.expressions.units import ACCELERATION, INERTIA, LENGTH, MASS, Dimension, described
from cutjoint.model.names import VARIABLES
from cutjoint.model.records import GROUND, Scalar, Span, SuppliedFunction, Vector

FAILED = sympy.nan  #: stands for a value that could not be read; its problem is reported, and checks skip it
FAILED_TERM = Term(FAILED)
#: The largest masses, lengths, inertias and accelerations in SI: products and squares of these stay far below the largest float.
LARGEST = 1e50
_BOUNDED = frozenset((MASS, LENGTH, INERTIA, ACCELERATION))
UNKNOWN = ""  #: stands for a body that does not exist; its problem is reported


@dataclass(frozen=True)
class Directory:
    """All bodies and joints of the model by full name, known before any of them is read.
    ``broken`` names elements and instances that could not be read; references to them are not reported again. ``signals`` are the states
    and signals of the model itself, and ``points`` its points, which submodels do not see."""

    bodies: frozenset[str]
    joints: Mapping[str, joint_parts.Joint]
    broken: frozenset[str]
    signals: frozenset[str] = frozenset()
    points: frozenset[str] = frozenset()

    def misses(self, name: str) -> bool:
        """Return whether ``name`` is, or belongs to, an element that could not be read."""
        return name.endswith(LOST) or name in self.broken or name.split(".")[0] in self.broken


@dataclass(frozen=True)
class Scope:
    """The surroundings in which elements are read: the model itself (empty ``prefix``) or one instance of a submodel.

    * ``path``: leads to the elements in the document; ``names``: symbols of expressions; ``values``: parameters' values by symbol
    * ``moving``: symbols of parameters that may change with time; ``settled``: values of those that never change
    * ``connectors``: local body names to full ones; ``instance_points``: points that the instance gives; ``tunables``: makes parameters of
      numbers
    * ``own``, ``read``: quantities of the scope; finds a quantity; ``terms``: those of signals, once their dimensions are known
    * ``functions``: supplied by the user, for what reads quantities
    * ``sensed``: symbols of quantities that an instance gives to its submodel; ``mirrors``: axes of its mirror and of those around it
    * ``sampled``: expressions that read quantities may also read accelerations and reactions, since they act only afterwards

    Names in expressions: `constants` (masses, points, starts): parameters that do not move. `timed` (guides, a scene's inputs): ``t`` and
    all parameters. `reading` (laws, rates, signals, controllers): these, the law's variables and quantities by "element.quantity".
    """

    source: Source
    problems: Problems
    directory: Directory
    names: Mapping[str, Term]
    values: MutableMapping[Scalar, float]
    moving: frozenset[Scalar] = frozenset()
    settled: Mapping[Scalar, Scalar] = field(default_factory=dict)
    path: Path = ()
    prefix: str = ""
    connectors: Mapping[str, str] = field(default_factory=dict)
    points: Mapping[str, Vector] = field(default_factory=dict)
    instance_points: Mapping[str, Vector] = field(default_factory=dict)
    tunables: TunableNumbers = field(default_factory=TunableNumbers)
    own: frozenset[str] = frozenset()
    read: "Callable[[Scope, str], Term] | None" = None
    terms: Mapping[str, Term] = field(default_factory=dict)
    sensed: frozenset[Scalar] = frozenset()
    sampled: bool = False
    mirrors: tuple[str, ...] = ()
    functions: Mapping[str, SuppliedFunction] = field(default_factory=dict)

    def full(self, name: str) -> str:
        """The full name of an element of this scope."""
        return self.connectors.get(name, self.prefix + name)

    def broken(self, section: str) -> list[str]:
        """The names of a section's elements that could not be read, of all where it has another name: they may be meant."""
        part: Any = self.source.data
        for key in (*self.path, section):
            part = part.get(key) if isinstance(part, dict) else None
        names = [self.prefix + str(name) for name in part] if isinstance(part, dict) else sorted(self.directory.broken)
        return [name.removeprefix(self.prefix) for name in names if name in self.directory.broken and name.startswith(self.prefix)]

    def constants(self) -> dict[str, Term]:
        """The parameters that do not change with time."""
        return {name: term for name, term in self.names.items() if not self.moves(term)}

    def moves(self, term: Term) -> bool:
        """Return whether a term changes with time: it follows from inputs or quantities."""
        symbols = term.value.free_symbols
        return not (self.moving.isdisjoint(symbols) and self.sensed.isdisjoint(symbols))

    def timed(self) -> dict[str, Term]:
        """The time and the parameters, without those that follow from quantities."""
        known = {name: term for name, term in self.names.items() if self.sensed.isdisjoint(term.value.free_symbols)}
        return {**known, "t": Term(variable("t"))}

    def reading(self, *variables: str, units: Mapping[str, Dimension | None] | None = None) -> Mapping[str, Term]:
        """The variables, whose dimension fits everywhere, all parameters, and the quantities of elements; no name that would be two.
        Variables may come with ``units``, of which notes are made."""
        variables = (*variables, *(units or ()))
        terms = {**self.names, **{name: Term(variable(name)) for name in variables}}
        terms = {name: term for name, term in terms.items() if name not in variables or name not in self.names}
        return terms if self.read is None else Names(terms, self.own, partial(self.read, self), self.functions, units or {})


@dataclass(frozen=True)
class Element:
    """One element while it is read: turns its fields, named by their keys inside the element, into expressions and reports errors."""

    scope: Scope
    label: str
    name: str
    path: Path

    @property
    def span(self) -> Span:
        """The place of the element's name."""
        return self.scope.source.key_span(self.path)

    def fail(self, message: str, hint: str = "", keys: Path = (), *, at_key: bool = False) -> None:
        """Note a problem of the field at ``keys``: of its value, or of its name when ``at_key``."""
        source, path = self.scope.source, (*self.path, *keys)
        place = source.key_span(path) if at_key or not keys else source.value_span(path)
        self.scope.problems.add(place, self.label, message, hint)

    def term(self, value: int | float | str, keys: Path, names: Mapping[str, Term]) -> Term:
        """A number or expression over ``names``; a failed term when it is wrong."""
        if value == LOST:
            return FAILED_TERM
        try:
            return read_term(value, names)
        except ExpressionError as error:
            message, hint = self._explained(error, names)
            if keys[:1] == ("with",) and message == "unknown symbol 't'":
                hint = "give the name of an input (binding: input), whose law over t a scene has"
            if keys[:1] == ("law",) and message.startswith("the input "):
                hint += ", or write the law as an expression over its variables, in which inputs may stand"
            self.fail(worded(field_name(keys), message), hint, keys)
            return FAILED_TERM

    def _explained(self, error: ExpressionError, names: Mapping[str, Term]) -> tuple[str, str]:
        """Message and hint; a parameter that is known elsewhere is named as such."""
        for name in self.scope.own:
            if error.message == f"unknown symbol '{name}'":
                return f"the quantity '{name}' cannot be used here", READERS
        for name in self.scope.functions:
            if error.message == f"unknown function '{name}'":
                return f"the function '{name}' cannot be called here", READERS.replace("have", "call")
        for name in self.scope.names.keys() - names.keys():
            if error.message == f"unknown symbol '{name}'" and isinstance(names, Names) and name in VARIABLES:
                return f"'{name}' is a variable of this law and a parameter", f"call the parameter by another name, such as '{name}_0'"
            if error.message == f"unknown symbol '{name}'":
                takes_parameters = names or not self.scope.constants()
                if takes_parameters and self.scope.moves(self.scope.names[name]):
                    remedy = "" if not self.scope.prefix else ", or give the submodel a value that does not change with time"
                    return f"the input '{name}' cannot be used here, it may change with time", f"use binding: param{remedy}"
                return f"the parameter '{name}' cannot be used here", "write a number"
        for name in self.scope.directory.signals if self.scope.prefix else ():
            if error.message == f"unknown symbol '{name}'":
                return f"'{name}' is the model's, and a submodel does not see it", f"give it as a parameter: parameters: [..., {name}]"
        return error.message, error.hint

    def scalar(
        self, value: int | float | str, expected: Dimension | None, keys: Path, names: Mapping[str, Term] | None = None, *,
        in_triple: bool = False, term: Term | None = None,
    ) -> Scalar:  # fmt: skip
        """A number or expression of dimension ``expected`` (None for any). ``names`` are the symbols it may use, by default all parameters
        that do not change with time; then a number may be tunable. ``in_triple`` is whether the last key is that of a component.
        ``term`` is what ``value`` was read as already."""
        term = term or self.term(value, keys, self.scope.constants() if names is None else names)
        if expected is not None and term.dimension not in (None, expected):
            is_tonne = names is not None and "t" in names and str(value).replace(" ", "").endswith("*t")
            hint = "beside a unit 't' is the tonne: write the law in SI numbers, such as 0.02*t" if is_tonne else ""
            self.fail(worded(field_name(keys), f"needs {described(expected)}, got {described(term.dimension)}"), hint, keys)
            return FAILED
        if term.value is not FAILED and (fault := _mixed_units(value, expected, names)):
            remedy = "correct a unit, or multiply by a number, which fits everywhere"
            span = self.scope.source.value_span((*self.path, *keys))
            self.scope.problems.note(span, f"{self.label}: {worded(field_name(keys), fault)}; {remedy}")
        has_value = not term.value.has(FAILED, SuppliedCall) and term.value.free_symbols <= self.scope.values.keys()
        if has_value and not math.isfinite(self.value(term.value)):
            self.fail(worded(field_name(keys), "has no finite value"), "", keys)
            return FAILED
        if expected in _BOUNDED and abs(self.value(term.value)) > LARGEST:
            self.fail(worded(field_name(keys), f"is larger than {LARGEST:g} in SI units"), "mind its unit", keys)
            return FAILED
        return term.value if names is not None else self.tunable(term, expected, keys, in_triple=in_triple).value

    def tunable(self, term: Term, expected: Dimension | None, keys: Path, *, in_triple: bool = False, is_argument: bool = False) -> Term:
        """The parameter that a number of the file is tunable as, else the term itself; an argument of an instance has its name alone."""
        path = (*self.path, *keys)
        if path not in self.scope.source.values:  # nothing stands there
            return term
        name = number_name(self.name, keys[1:] if is_argument else keys, in_triple=in_triple)
        span, is_default = self.scope.source.value_span(path), is_argument and keys[0] == "defaults"
        return self.scope.tunables.tunable(name, term, expected, span, self.scope.values, is_default=is_default)

    def settle(self, vector: Vector) -> Vector:
        """A vector with the numbers of all parameters that never change."""
        x, y, z = (component.xreplace(self.scope.settled) for component in vector)
        return (x, y, z)

    def number(self, value: int | float | str, expected: Dimension | None, keys: Path) -> float:
        """A number that depends on no parameter; NaN when it is wrong."""
        expression = self.scalar(value, expected, keys, {})
        return self.value(expression)

    def positive(self, value: float, keys: Path) -> float:
        """A number that is noted as wrong unless it is above zero; NaN has been noted before."""
        if not (math.isnan(value) or value > 0):
            self.fail(f"{keys[-1]} must be greater than zero", "", keys)
        return value

    def value(self, expression: Scalar) -> float:
        """The value of an expression at the parameters' values."""
        return evaluate(expression, self.scope.values)

    def triple(
        self, values: tuple[int | float | str, ...], expected: Dimension | None, keys: Path, names: Mapping[str, Term] | None = None
    ) -> Vector:
        """Three components of dimension ``expected``."""
        a, b, c = (self.scalar(value, expected, (*keys, index), names, in_triple=True) for index, value in enumerate(values))
        return (a, b, c)

    def body(self, name: str, keys: Path) -> str:
        """The full name of a body, :data:`UNKNOWN` when there is none."""
        full = name if name == GROUND else self.scope.full(name)
        directory = self.scope.directory
        if full in directory.bodies or full == GROUND or self.scope.connectors.get(name) == UNKNOWN:
            return full
        if self.scope.prefix and name in directory.bodies:
            remedy = "name a connector of the submodel, and connect it in each instance"
            self.fail(f"the body '{name}' is outside the submodel", remedy, keys)
        elif not directory.misses(full):
            self.fail(f"unknown body '{name}'", nearest(name, self._known_bodies(), "bodies here"), keys)
        return UNKNOWN

    def two_bodies(self, names: tuple[str, ...]) -> tuple[str, str]:
        """The full names of the two bodies under ``bodies``."""
        base, follower = (self.body(name, ("bodies", index)) for index, name in enumerate(names))
        if base == follower != UNKNOWN:
            self.fail(f"joins the body '{base}' to itself", "name two bodies", ("bodies",))
        return base, follower

    def _known_bodies(self) -> list[str]:
        prefix = self.scope.prefix
        bodies = [name.removeprefix(prefix) for name in self.scope.directory.bodies if name.startswith(prefix)]
        return [GROUND, *self.scope.connectors, *bodies, *self.scope.broken("bodies")]

    def joint(self, name: str, keys: Path) -> tuple[str, joint_parts.Joint | None]:
        """The full name of a joint, and its part of the document."""
        full = self.scope.prefix + name
        directory = self.scope.directory
        if full not in directory.joints and not directory.misses(full):
            prefix = self.scope.prefix
            joints = [known.removeprefix(prefix) for known in directory.joints if known.startswith(prefix)]
            self.fail(f"unknown joint '{name}'", nearest(name, [*joints, *self.scope.broken("joints")], "joints here"), keys)
        return full, directory.joints.get(full)


def _mixed_units(value: int | float | str, expected: Dimension | None, names: Mapping[str, Term] | None) -> str:
    """What is wrong with the dimensions of a law whose variables stand beside units; bare numbers fit everywhere."""
    try:
        found = None if names is None else dimension_beside_units(value, names)
    except ExpressionError as error:
        return error.message
    return "" if found is None or expected in (None, found) else f"needs {described(expected)}, got {described(found)}"


def element(scope: Scope, kind: str, section: str, name: str) -> Element:
    """The element ``name`` of a section of the document, such as "bodies"."""
    full = scope.prefix + name
    return Element(scope, f"{kind} '{full}'", full, (*scope.path, section, name))
