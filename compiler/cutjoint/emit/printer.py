"""Scalars -> C++ or C expressions and statements."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import copysign, isfinite
from types import MappingProxyType

from cutjoint.model.expressions.functions import PREFIX
from cutjoint.ops import CONDITIONS, OPERATIONS, fact
from cutjoint.package.errors import MissingPartialsError
from cutjoint.program.blocks import SUPPLIED, SURFACE, SuppliedCall, surface_lookup
from cutjoint.program.scalars import Graph, Scalar

_SUM, _PRODUCT, _UNARY, _ATOM = 1, 2, 3, 4

LONGEST = 180  #: an expression longer than this gets a name of its own


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How a language writes constants, members of a class (by record and name), functions, and lookups of a road (by name and number).
    Whether a host ``gives_roads``, which may have a surface."""

    constant: str = "Real({})"
    negative: str = "Real({})"
    member: str = "{}_.{}"
    functions: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    road: str = "roads_[{0}].{2}({3})"
    gives_roads: bool = True


CPP = Dialect()
C99 = Dialect(
    constant="{}", negative="({})", member="self->{}.{}", functions=MappingProxyType({"abs": "fabs", "where": "choose"}),
    road="road_{2}({1}, {3})", gives_roads=False,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Statement:
    """``const type name = expression;`` in one section; without a type, name is an element of an array."""

    type: str
    name: str
    expression: str
    section: int


@dataclass(kw_only=True)
class Printer:
    """Prints the statements of one function.

    ``names`` are the identifiers of scalars; ``known`` the expressions of those that exist before the function's own statements.
    ``prefixes`` begin the names of a section's shared scalars, ``used_names`` are names that they must not take;
    ``roads`` names the roads of tyres.  ``conditions`` is the type of conditions without lanes: "bool", or "Mask" where a real may be
    that of several instances.  ``elements`` are the places of those that arrays keep, besides their names if they have some.  ``stores``
    are places of results, and the scalars that go there, which are stored where the scalar without its sign is found.  A ``dialect``
    other than that of C++ has no lanes.
    """

    graph: Graph
    names: Mapping[int, str]
    known: Mapping[int, str]
    prefixes: Sequence[str]
    used_names: frozenset[str]
    roads: Mapping[str, str]
    conditions: str = "bool"
    elements: Mapping[int, str] = field(default_factory=dict)
    stores: Mapping[int, Sequence[tuple[str, int]]] = field(default_factory=dict)
    dialect: Dialect = CPP
    _texts: dict[int, tuple[str, int]] = field(default_factory=dict)
    _counters: dict[str, int] = field(default_factory=dict)
    _calls: dict[str, str] = field(default_factory=dict)  # names of the results of functions that have several, by their calls

    def statements(self, nodes: Sequence[int], uses: Mapping[int, int]) -> list[Statement]:
        """One statement for every named or repeatedly used scalar, the others inside them; ``uses`` as `count_uses` has them."""
        printed: list[Statement] = []
        for n in nodes:
            node = self.graph.nodes[n]
            if n in self.known:
                continue
            text, level = self._expression(n)
            if node.op.startswith(SUPPLIED) and not (call := SuppliedCall.read(node.op)).is_plain:
                if text not in self._calls:
                    self._calls[text] = self._auxiliary(node.section)
                    printed.append(Statement(type="auto", name=self._calls[text], expression=text, section=node.section))
                at = call.result if call.by is None else call.result * (len(node.args) - call.memory) + call.by
                text, level = f"{self._calls[text]}[{at}]", _ATOM
            place = self.elements.get(n)
            if node.op == "neg" or (place is None and n not in self.names and uses[n] < 2 and len(text) < LONGEST):
                self._texts[n] = (text, level)
                printed += self._stored(n)
                continue
            name = self.names.get(n) or place or self._auxiliary(node.section)
            printed.append(Statement(type="" if name == place else self._type(node), name=name, expression=text, section=node.section))
            if place is not None and name != place:
                printed.append(Statement(type="", name=place, expression=name, section=node.section))
            self._texts[n] = (name, _ATOM)
            printed += self._stored(n)
        return printed

    def _stored(self, n: int) -> list[Statement]:
        section = self.graph.nodes[n].section
        return [Statement(type="", name=place, expression=self.text(x), section=section) for place, x in self.stores.get(n, ())]

    def count_uses(self, nodes: Sequence[int], results: Sequence[int]) -> dict[int, int]:
        """The number of uses of each of the nodes, as an argument of others or as a result."""
        uses = dict.fromkeys(nodes, 0)
        for n in nodes:
            for a in self.graph.nodes[n].args:
                if a in uses:
                    uses[a] += 1
        for n in results:
            if n in uses:
                uses[n] += 1
        for n in reversed(nodes):  # a negation is printed wherever it is used
            node = self.graph.nodes[n]
            if node.op == "neg" and node.args[0] in uses:
                uses[node.args[0]] += uses[n] - 1
        return uses

    def _auxiliary(self, section: int) -> str:
        """A name for a shared scalar without a name of the formulation."""
        prefix = self.prefixes[section]
        used_names = True
        while used_names:
            self._counters[prefix] = self._counters.get(prefix, 0) + 1
            name = f"{prefix}_{self._counters[prefix]}"
            used_names = name in self.used_names
        return name

    def text(self, n: int, level: int = 0) -> str:
        """A scalar as an operand that binds at least as tightly as ``level``."""
        text, precedence = self._atom(n)
        return f"({text})" if precedence < level else text

    def _atom(self, n: int) -> tuple[str, int]:
        if n in self._texts:
            return self._texts[n]
        if n in self.known:
            return self.known[n], _ATOM
        node = self.graph.nodes[n]
        if node.op == "const":
            return real(node.data, self.dialect), _ATOM
        if node.op == "lane_const":
            assert isinstance(node.data, tuple)
            return f"{lanes_type(node.lanes)}{{{', '.join(map(real, node.data))}}}", _ATOM
        return self._expression(n)

    def _expression(self, n: int) -> tuple[str, int]:
        node = self.graph.nodes[n]
        a = node.args
        match node.op:
            case "neg":
                return f"-{self.text(a[0], _UNARY)}", _UNARY
            case "add":
                return f"{self.text(a[0], _SUM)} + {self.text(a[1], _PRODUCT)}", _SUM
            case "sub":
                return f"{self.text(a[0], _SUM)} - {self.text(a[1], _PRODUCT)}", _SUM
            case "mul":
                return f"{self.text(a[0], _PRODUCT)}*{self.text(a[1], _UNARY)}", _PRODUCT
            case "div":
                return f"{self.text(a[0], _PRODUCT)}/{self.text(a[1], _UNARY)}", _PRODUCT
            case "gather":
                return f"{lanes_type(node.lanes)}{{{', '.join(self.text(x) for x in a)}}}", _ATOM
            case "lane":
                return f"{self.text(a[0], _ATOM)}[{node.data}]", _ATOM
            case "lane_sum":
                return f"sum({self.text(a[0])})", _ATOM
        return (self._call_in_lanes(n) if node.lanes else self._call(n)), _ATOM

    def _call(self, n: int) -> str:
        node = self.graph.nodes[n]
        a = node.args
        arguments = ", ".join(self.text(x) for x in a)
        if node.op.startswith("road_"):
            road, lookup = str(node.data), node.op
            if node.op.startswith(SURFACE):
                lookup, by = surface_lookup(node.op)
                if not self.dialect.gives_roads:  # level ground, of full friction
                    return self.dialect.constant.format(float(node.op == "road_friction"))
                arguments += f", {by.count('x')}, {by.count('y')}"
            return self.dialect.road.format(self.roads[road], list(self.roads).index(road), lookup.removeprefix("road_"), arguments)
        if node.op.startswith(SUPPLIED):
            return _supplied(SuppliedCall.read(node.op), "Real", arguments)
        row = OPERATIONS[node.op]
        if row.infix:
            sign = row.infix if self.conditions == "bool" else row.infix_of_lanes
            return f"({f' {sign} '.join(self.text(x, _SUM) for x in a)})"
        if node.op == "not":
            condition = self.text(a[0], _ATOM)
            return f"(!{condition})" if self.conditions == "bool" else f"({condition} == {self.conditions}())"
        assert node.op == "where" or fact(node.op, "standard")
        return f"{self.dialect.functions.get(node.op, node.op)}({arguments})"

    def _call_in_lanes(self, n: int) -> str:
        """A call whose uniform arguments are spread over the lanes."""
        node = self.graph.nodes[n]
        kind = lanes_type(node.lanes)
        arguments = [self.text(x) for x in node.args]
        for i, x in enumerate(node.args):
            if not self.graph.nodes[x].lanes:
                is_condition = self.graph.nodes[x].op in CONDITIONS
                arguments[i] = f"{kind}::mask({arguments[i]})" if is_condition else f"{kind}({arguments[i]})"
        if node.op.startswith(SUPPLIED):
            return _supplied(SuppliedCall.read(node.op), kind, ", ".join(arguments))
        if sign := OPERATIONS[node.op].infix_of_lanes:
            return f"({f' {sign} '.join(arguments)})"
        return f"(~{arguments[0]})" if node.op == "not" else f"{node.op}({', '.join(arguments)})"

    def _type(self, node: Scalar) -> str:
        if node.op in CONDITIONS:
            return "auto" if node.lanes else self.conditions
        return lanes_type(node.lanes)


def _supplied(call: SuppliedCall, kind: str, arguments: str) -> str:
    """A call of a user's function, or of its partial derivative, for a number type; it has all results if the function is not plain.
    Raises MissingPartialsError: it has no partial derivatives."""
    if call.by is not None and not call.has_partials:
        raise MissingPartialsError(call.name)
    verb = "supplied" if call.by is None else "supplied_partial"
    sizes = ""
    if not call.results:
        verb, sizes = "updated_memory", f", {call.memory}"
    elif not call.is_plain:
        verb, sizes = "supplied_results" if call.by is None else "supplied_partials", f", {call.results}, {call.memory}"
    by = [str(call.by)] if call.by is not None and call.is_plain else []
    return f"{verb}<{kind}{sizes}>({', '.join([PREFIX + call.name, *by, f'{{{arguments}}}'])})"


def real(value: object, dialect: Dialect = CPP) -> str:
    """A constant, by the fewest digits that determine it.  Folding lets no other than finite ones come here."""
    assert isinstance(value, float)
    assert isfinite(value)
    return (dialect.negative if copysign(1.0, value) < 0 else dialect.constant).format(repr(value))


def kept_type(node: Scalar, conditions: str) -> str:
    """The C++ type of a member that holds a scalar."""
    if node.op in CONDITIONS:
        return f"{lanes_type(node.lanes)}::Mask" if node.lanes else conditions
    return lanes_type(node.lanes)


def lanes_type(lanes: int) -> str:
    """The C++ type of a scalar with lanes; plain reals have none."""
    return f"Lanes{lanes}" if lanes else "Real"
