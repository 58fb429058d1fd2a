"""Program -> views: the data that the templates print."""

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from textwrap import wrap
from types import MappingProxyType

from cutjoint.emit.loops import LoopText, index, read_by_loops, write_loops
from cutjoint.emit.names import MACROS, common_name, identifier, name_scalars, road_names, unique
from cutjoint.emit.printer import CPP, Dialect, Printer, Statement, kept_type, lanes_type
from cutjoint.formulate.inputs import DISCRETE_STATES, INPUTS, LAW_TIME, LAW_VALUES
from cutjoint.formulate.records import Equations
from cutjoint.ops import STANDARD
from cutjoint.program.blocks import BindingTime, Section
from cutjoint.program.loops import TO, Rolled, roll
from cutjoint.program.records import LoweredFunction, Program, Result
from cutjoint.program.scalars import Graph

_NOTE = "  // "  #: the beginning of a statement's comment
LINE = 110  #: characters of a line of a generated expression
#: A longer function (statements) is compiled in parts of about the second number: the time of GCC's combiner is quadratic.
LONG, PART = 4000, 1000
_STORED_EARLY = frozenset({"residual_jacobian"})  #: functions with so many results that each is stored as soon as it is computed
_ENDS_EARLY = {"energy": ("vdot == v", "for the power")}  #: functions that may end behind the first result: when, what the rest is for
#: Symbols whose elements are members of a record among the arguments.
_MEMBERS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "numerics": ("stabilisation", ("penalty", "damping_ratio", "frequency")),
    "weights": ("weights", ("damping", "stiffness", "constraint")),
}


@dataclass(frozen=True, kw_only=True)
class SectionView:
    """One body, joint, cut joint or force of a generated function; with a number it begins that ``part`` of a long one.
    Inside a loop the first section has the lines that ``opening`` it take, the last ``closes`` it."""

    part: int
    title: str
    notes: tuple[str, ...]
    statements: tuple[Statement, ...]
    opening: tuple[str, ...] = ()
    indent: str = ""
    closes: bool = False


@dataclass(frozen=True, kw_only=True)
class FunctionView:
    """A generated function. ``declaration`` names all arguments, ``signature`` those that it uses, ``instance`` is the same for a build's
    precision. ``arrays`` declares the arrays of its loops, ``calls`` are the functions of namespace std that it calls."""

    declaration: str
    signature: str
    instance: str
    calls: tuple[str, ...]
    arrays: tuple[str, ...]
    sections: tuple[SectionView, ...]
    results: tuple[str, ...]


class Viewer:
    """Makes the views of one program; ``conditions`` is the type of those without lanes."""

    def __init__(self, program: Program, equations: Equations, conditions: str = "bool", dialect: Dialect = CPP) -> None:
        self._program = program
        self._dialect = dialect
        self._conditions = conditions
        self._equations = equations
        self._names = name_scalars(program)
        self._locals = self._local_names()
        self._roads = road_names(equations.roads)
        self._inputs = self._input_names()
        self._stored = self._kept_names()
        self._rolled = {f.name: roll(program, _first_result_first(program.graph, f), self._place) for f in program.functions}

    def _input_names(self) -> dict[int, str]:
        names = {}
        for n, node in enumerate(self._program.graph.nodes):
            if node.op == "symbol":
                assert isinstance(node.data, tuple)
                names[n] = self._input(*node.data)
        return names

    def _local_names(self) -> dict[int, str]:
        slots = self._equations.slots
        names: dict[int, str] = {}
        used_names = {name for name in self._names.values() if not name.startswith("vdot_")}  # of another function
        for n, node in enumerate(self._program.graph.nodes):
            if node.op == "symbol" and isinstance(node.data, tuple) and node.data[0] in slots:
                symbol, index = node.data
                slot, element = slots[symbol], symbol.partition(":")[2]
                names[n] = unique(identifier(f"{slot.array}_{element}_{slot.names[index]}"), used_names)
        return names

    def _input(self, symbol: str, index: int) -> str:
        if symbol in self._equations.slots:
            slot = self._equations.slots[symbol]
            return f"{slot.array}[{slot.offset + index}]"
        if symbol in _MEMBERS:
            return f"{_MEMBERS[symbol][0]}.{_MEMBERS[symbol][1][index]}"
        if symbol == "penalties":
            return f"stabilisation.penalties[{index}]"
        if symbol == LAW_TIME:
            return "t"
        return f"parameters[{index}]" if symbol == "parameters" else symbol

    def _kept_names(self) -> dict[int, str]:
        """Members with the values of earlier stages."""
        stored: dict[int, str] = {}
        used_names = set(self._names.values())
        for n in sorted(self._program.stored):
            stored[n] = self._names.get(n) or unique(self._parameter_name(n) or f"value_{len(stored) + 1}", used_names)
        return stored

    def _parameter_name(self, n: int) -> str:
        node = self._program.graph.nodes[n]
        if node.op != "symbol":
            return ""
        assert isinstance(node.data, tuple)
        symbol, index = node.data
        if symbol in _MEMBERS:
            return _MEMBERS[symbol][1][index]
        if symbol in (INPUTS, DISCRETE_STATES, LAW_VALUES):
            return identifier(self._equations.slots[symbol].names[index])
        if symbol == "penalties":
            return f"penalty_{self._equations.topology.closing[index].name.replace('.', '_')}"
        if symbol in self._equations.slots:  # a coefficient
            return identifier(f"c_{symbol.partition(':')[2]}_{index}")
        return f"p_{identifier(self._equations.parameters[index].name)}" if symbol == "parameters" else f"{symbol}_now"

    def members(self, binding: BindingTime) -> tuple[tuple[str, str], ...]:
        """Type and name of the stored values of one stage."""
        nodes = self._program.graph.nodes
        return tuple((kept_type(nodes[n], self._conditions), name) for n, name in self._stored.items() if nodes[n].binding is binding)

    def lane_types(self) -> tuple[tuple[str, int], ...]:
        """The types with lanes that the program uses, and their number of lanes."""
        widths = {node.lanes for node in self._program.graph.nodes} | {x.lanes for r in self._rolled.values() for x in r.loops}
        return tuple((lanes_type(n), n) for n in sorted(widths - {0}))

    def _member(self, n: int) -> str:
        loaded = self._program.graph.nodes[n].binding is BindingTime.PARAM
        return self._dialect.member.format("loaded" if loaded else "step", self._stored[n])

    def load(self) -> FunctionView:
        """The stage of parameters."""
        keeping = ("roads_ = roads;",) if self._roads and self._dialect.gives_roads else ()
        arguments = (*self._equations.load_arguments, *(["const Real* series"] if self._equations.fits else []))
        return self._early(self.load_name, arguments, self._program.loaded, BindingTime.PARAM, dict(self._inputs), keeping)

    @property
    def load_name(self) -> str:
        """The function that loads parameters; with fitted loops, the one that the class calls with their coefficients."""
        return "load_values" if self._equations.fits else "load"

    @property
    def step_name(self) -> str:
        """The function that begins a step; with inputs, the one that the class calls with the array of these."""
        return "start_step" if self._equations.input_values else "begin_step"

    def step(self) -> FunctionView:
        """The stage of time, and of inputs where there are some."""
        known = {**self._inputs, **self._known(BindingTime.PARAM)}
        arguments = ("Real t", "Real motion", *(["const Real* input"] if self._equations.input_values else []))
        return self._early(self.step_name, arguments, self._program.stepped, BindingTime.STEP, known, ())

    def _known(self, latest: BindingTime) -> dict[int, str]:
        nodes = self._program.graph.nodes
        return {n: self._member(n) for n in self._stored if nodes[n].binding <= latest}

    def _early(
        self, name: str, arguments: tuple[str, ...], nodes: Sequence[int], binding: BindingTime, known: Mapping[int, str],
        extra: tuple[str, ...],
    ) -> FunctionView:  # fmt: skip
        stored = [n for n in self._stored if self._program.graph.nodes[n].binding is binding]
        printer = self._printer(known, self._program.graph, self._program.sections, self._names, self._used_names())
        sections = self._sections(printer.statements(nodes, printer.count_uses(nodes, stored)), self._program.sections)
        results = [f"{self._member(n)} = {printer.text(n)};" for n in stored]
        return self._view(name, arguments, _in_parts(sections), [*results, *extra], ())

    def function(self, name: str) -> FunctionView:
        """One of the functions that a step calls."""
        function, rolled = self._program.function(name), self._rolled[name]
        used_names = self._used_names()
        loops = write_loops(rolled, self._names, [_prefix(s) for s in rolled.sections], used_names, self._conditions)
        known = {**self._inputs, **self._locals, **self._known(BindingTime.STEP), **loops.known}
        printer = self._printer(known, rolled.graph, rolled.sections, {**self._names, **loops.names}, used_names, loops.elements)
        sections: list[SectionView] = []
        single = [n for part in rolled.parts if not isinstance(part, int) for n in part]
        early, late = self._early_and_late(name, rolled, single)
        printer.stores = early
        read = read_by_loops(rolled)
        nodes = {*single, *(n for n in function.statements if rolled.graph.nodes[n].op in ("neg", "symbol"))}
        uses = printer.count_uses(sorted(nodes), [*(r.scalar for r in rolled.results), *read, *read])
        used = [n for n in function.statements if n in self._locals and uses[n]]
        before = [Statement(type="Real", name=self._locals[n], expression=self._inputs[n], section=0) for n in used]
        for part in rolled.parts:
            if isinstance(part, int):
                sections += self._sections(before, rolled.sections) + self._loop(part, rolled, loops, printer)
                before = []
            else:
                before += printer.statements(part, uses)
        sections += self._sections(before, rolled.sections)
        if name in _ENDS_EARLY:
            sections = _with_end(sections, {place for stores in early.values() for place, _ in stores}, *_ENDS_EARLY[name])
        results = [f"{self._target(r, rolled.graph)} = {printer.text(r.scalar)};{self._note(r)}" for r in late]
        results += _stores(rolled, loops, printer)
        return self._view(name, self._equations.function(name).arguments, _in_parts(sections), results, loops.arrays)

    def _early_and_late(
        self, name: str, rolled: Rolled, single: Sequence[int]
    ) -> tuple[Mapping[int, Sequence[tuple[str, int]]], Sequence[Result]]:  # fmt: skip
        """Results that are stored where their unsigned scalars are computed, by these, and those stored at the end of a function."""
        early: defaultdict[int, list[tuple[str, int]]] = defaultdict(list)
        most = len(rolled.results) if name in _STORED_EARLY else 1 if name in _ENDS_EARLY else 0  # the first alone ends a function
        late, found = [], set(single)
        for i, r in enumerate(rolled.results):
            if i < most and (bare := rolled.graph.signless(r.scalar)) in found:
                early[bare].append((self._target(r, rolled.graph), r.scalar))
            else:
                late.append(r)
        return early, late

    def _loop(self, i: int, rolled: Rolled, loops: LoopText, printer: Printer) -> list[SectionView]:
        """The sections of a loop's body; none where it only stores results."""
        loop = rolled.loops[i]
        nodes = rolled.graph.nodes
        uses = printer.count_uses([*loop.body, *{a for n in loop.body for a in nodes[n].args if nodes[a].op == "neg"}], [])
        views = self._sections(printer.statements(loop.body, uses), rolled.sections)
        views = [replace(v, indent="  ") for v in views]
        if views:
            views[0] = replace(views[0], opening=loops.opening(i, loop, printer))
            views[-1] = replace(views[-1], closes=True)
        return views

    def _printer(
        self, known: Mapping[int, str], graph: Graph, sections: Sequence[Section], names: Mapping[int, str], used_names: set[str],
        elements: Mapping[int, str] = MappingProxyType({}),
    ) -> Printer:  # fmt: skip
        prefixes = [_prefix(s) for s in sections]
        return Printer(
            graph=graph, names=names, known=known, prefixes=prefixes, used_names=frozenset(used_names), roads=self._roads,
            conditions=self._conditions, elements=elements, dialect=self._dialect,
        )  # fmt: skip

    def _used_names(self) -> set[str]:
        return {*self._names.values(), *self._locals.values(), *self._roads.values(), *MACROS}

    def _place(self, symbol: str, index: int) -> tuple[str, int]:
        if symbol in self._equations.slots:
            slot = self._equations.slots[symbol]
            return slot.array, slot.offset + index
        return self._input(symbol, index), 0

    def _target(self, result: Result, graph: Graph) -> str:
        array, index = self._place(result.target, result.index)
        lanes = graph.nodes[result.scalar].lanes
        return f"row<{lanes_type(lanes)}>({array} + {index})" if lanes else f"{array}[{index}]"

    def _note(self, result: Result) -> str:
        slot, element = self._equations.slots.get(result.target), result.target.partition(":")[2]
        name = slot.names[result.index] if slot else ""
        if name == result.target:  # an entry of a matrix, by row and column
            name = element
        text = name if name.startswith(element) or not name else f"{element}.{name}"
        return f"{_NOTE}{on_one_line(text)}" if text else ""

    def _view(
        self, name: str, arguments: tuple[str, ...], sections: Sequence[SectionView], results: Sequence[str], arrays: tuple[str, ...]
    ) -> FunctionView:  # fmt: skip
        lines = (r.partition(_NOTE)[0] for r in results)
        stored = (y.name for s in sections for y in s.statements if not y.type)
        text = "\n".join([*(x for s in sections for x in (*s.opening, *(y.expression for y in s.statements))), *stored, *lines])
        const = "" if name in ("load", "load_values", "begin_step", "start_step") else " const"
        used = [a if _mentions(text, a.rpartition(" ")[2]) else a.rpartition(" ")[0] for a in arguments]
        return FunctionView(
            declaration=f"{name}({', '.join(arguments)}){const}", signature=f"{name}({', '.join(used)}){const}",
            instance=f"{name}({', '.join(a.replace('Real', 'Precision') for a in arguments)}){const}",
            calls=tuple(f for f in sorted(STANDARD) if _mentions(text, f)),
            arrays=arrays, sections=tuple(sections), results=tuple(results),
        )  # fmt: skip

    def _sections(self, statements: Sequence[Statement], sections: Sequence[Section]) -> list[SectionView]:
        views: list[SectionView] = []
        for number, group in groupby(statements, key=lambda s: s.section):
            broken = ((s, wrap(s.expression, LINE, break_long_words=False, break_on_hyphens=False)) for s in group)
            section, lines = sections[number], tuple(replace(s, expression="\n      ".join(parts)) for s, parts in broken)
            notes = tuple(on_one_line(x) for x in (section.equation, section.source) if x)
            views.append(SectionView(part=0, title=section.title, notes=notes, statements=lines))
        return views


def _first_result_first(graph: Graph, function: LoweredFunction) -> LoweredFunction:
    """The function, if it may end early, with the statements in front that its first result needs."""
    needed = set(graph.reachable([r.scalar for r in function.results[:1]])) if function.name in _ENDS_EARLY else set()
    return replace(function, statements=tuple(sorted(function.statements, key=lambda n: n not in needed)))


def _with_end(sections: Sequence[SectionView], stores: Collection[str], condition: str, purpose: str) -> list[SectionView]:
    """Sections of a function that ends behind one of its stored results under a condition; later headings say what they are for."""
    views: list[SectionView] = []
    title = "{}"
    for section in sections:
        ends = [replace(s, expression=f"{s.expression}; if ({condition}) return") if s.name in stores else s for s in section.statements]
        views.append(replace(section, statements=tuple(ends), title=title.format(section.title)))
        title = title if tuple(ends) == section.statements else f"{{}}, {purpose}"
    return views


def _in_parts(sections: Sequence[SectionView]) -> list[SectionView]:
    """The sections of a long function with the beginnings of its parts marked."""
    if sum(len(s.statements) for s in sections) <= LONG:
        return list(sections)
    views: list[SectionView] = []
    before = parts = 0
    for section in sections:
        begins = before // PART > parts and not section.indent
        parts = before // PART if begins else parts
        views.append(replace(section, part=parts if begins else 0))
        before += len(section.statements)
    return views


def _stores(rolled: Rolled, loops: LoopText, printer: Printer) -> list[str]:
    lines: list[str] = []
    for i, loop in enumerate(rolled.loops):
        if loop.stores:
            stores = (f"  {s.array}[{index(s.step)}] = {printer.text(s.node)};" for s in loop.stores)
            lines += [*loops.opening(i, loop, printer), *stores, "}"]
    return lines


def on_one_line(text: str) -> str:
    """Text that stays inside its comment: a file's name may have any character."""
    return "".join(c if c.isprintable() and c != "\\" else "?" for c in text)


def _prefix(section: Section) -> str:
    """The beginning of names in a section for scalars without better names."""
    first, _, last = section.element.partition(TO)
    return identifier((common_name(first, last) if last else first) or section.stage)


def _mentions(text: str, name: str) -> bool:
    padded = f" {text} "
    start = padded.find(name)
    while start != -1:
        before, after = padded[start - 1], padded[start + len(name)]
        if not (before.isalnum() or before in "_.") and not (after.isalnum() or after == "_"):
            return True
        start = padded.find(name, start + 1)
    return False
