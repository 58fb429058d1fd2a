"""Loops of a function -> the names of their kept scalars, and C++ texts of their bodies' arguments."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cutjoint.emit.names import common_name, identifier, unique
from cutjoint.emit.printer import Printer, kept_type, lanes_type
from cutjoint.program.loops import Input, Loop, Rolled, Step, Stored, Table
from cutjoint.program.scalars import Graph


@dataclass(frozen=True, kw_only=True)
class LoopText:
    """The loops of one function in C++. ``arrays`` are declarations, ``known`` the texts of computed scalars and of the bodies' arguments,
    ``elements`` the texts of the bodies' scalars that arrays keep, ``names`` of their others. By the number of a loop, ``tables`` has the
    name and nodes of each table, ``copies`` the copies before it, ``fronts`` the first lines of its body."""

    arrays: tuple[str, ...]
    known: Mapping[int, str]
    elements: Mapping[int, str]
    names: Mapping[int, str]
    tables: tuple[tuple[tuple[str, tuple[int, ...]], ...], ...]
    copies: tuple[tuple[tuple[str, int], ...], ...]
    fronts: tuple[tuple[str, ...], ...]

    def opening(self, i: int, loop: Loop, printer: Printer) -> tuple[str, ...]:
        """The lines before the body of a loop."""
        copies = (f"{element} = {printer.text(n)};" for element, n in self.copies[i])
        tables = (_table(name, nodes, printer) for name, nodes in self.tables[i])
        return *copies, *tables, *_heading(loop), *self.fronts[i]


def write_loops(rolled: Rolled, names: Mapping[int, str], prefixes: Sequence[str], used_names: set[str], conditions: str) -> LoopText:
    """Name the kept scalars of a function's loops.
    ``names`` are those of its scalars, ``prefixes`` begin names of a section's others; ``used_names`` are in use, new ones are put in."""
    declared: list[str] = []
    known: dict[int, str] = {}
    elements: dict[int, str] = {}
    named: dict[int, str] = {}
    arrays: dict[tuple[int, int], tuple[str, int]] = {}
    for i, loop in enumerate(rolled.loops):
        for j, n in enumerate(loop.body):
            node = rolled.graph.nodes[n]
            name = common_name(*(names.get(nodes[j], "") for nodes in (loop.iterations[0], loop.iterations[-1])))
            if j in loop.arrays:
                first, last = loop.arrays[j]
                array = unique(name or f"{prefixes[node.section]}_stored", used_names)
                arrays[i, j] = array, -first
                kind = "Real" if loop.lanes else kept_type(node, conditions)
                declared.append(f"{kind} {array}[{last - first + 1}];")
                known |= {nodes[j]: f"{array}[{k - first}]" for k, nodes in enumerate(loop.iterations)}
                elements[n] = f"{array}[{index(Step(-first, 1))}]"
                if loop.lanes:
                    elements[n] = f"row<{lanes_type(loop.lanes)}>(&{elements[n]})"
                    named[n] = unique(f"{array}_k", used_names)
            elif name:
                named[n] = unique(name, used_names)
    tables, fronts = [], []
    for loop in rolled.loops:
        front_names, front_lines = [], []
        uses = Counter(rolled.graph.signless(a) for n in loop.body for a in rolled.graph.nodes[n].args)
        for n, argument in loop.arguments.items():
            match argument:
                case Input(array, step):
                    pass
                case Stored(number, statement, stored):
                    array, front = arrays[number, statement]
                    step = Step(stored.first + front, stored.stride)
                case Table(nodes):
                    array, step = unique("given", used_names), Step(0, 1)
                    front_names.append((array, nodes))
            known[n] = f"{array}[{index(step)}]"
            if loop.lanes:
                kind = lanes_type(loop.lanes)
                known[n] = f"strided<{kind}, {step.stride}>(&{known[n]})"
                if uses[n] > 1:
                    name = unique(f"{identifier(array)}_k", used_names)
                    front_lines.append(f"  const {kind} {name} = {known[n]};")
                    known[n] = name
        tables.append(tuple(front_names))
        fronts.append(tuple(front_lines))
    copies = tuple(
        tuple((f"{name}[{c.place + front}]", c.node) for c in loop.copies for name, front in [arrays[c.loop, c.statement]])
        for loop in rolled.loops
    )
    return LoopText(
        arrays=tuple(declared), known=known, elements=elements, names=named, tables=tuple(tables), copies=copies, fronts=tuple(fronts),
    )  # fmt: skip


def _heading(loop: Loop) -> tuple[str, ...]:
    """The line that opens a loop; with lanes the last iterations may repeat some before, with the same values."""
    if not loop.lanes:
        return (f"for (int k = 0; k < {loop.count}; ++k) {{",)
    last = loop.count - loop.lanes
    if loop.count % loop.lanes == 0:
        return (f"for (int k = 0; k < {loop.count}; k += {loop.lanes}) {{",)
    return f"for (int first = 0; first < {loop.count}; first += {loop.lanes}) {{", f"  const int k = first < {last} ? first : {last};"


def index(step: Step) -> str:
    """The index of iteration k, without spaces, so that no line breaks there."""
    first, stride = step
    if stride == 0:
        return str(first)
    scaled = "k" if abs(stride) == 1 else f"{abs(stride)}*k"
    if stride < 0:
        return f"{first}-{scaled}"
    return f"{scaled}{first:+d}" if first else scaled


def _table(name: str, nodes: Sequence[int], printer: Printer) -> str:
    storage = "static const" if all(printer.graph.value(n) is not None for n in nodes) else "const"
    kind = kept_type(printer.graph.nodes[nodes[0]], printer.conditions)
    return f"{storage} {kind} {name}[] = {{{', '.join(printer.text(n) for n in nodes)}}};"


def read_by_loops(rolled: Rolled) -> list[int]:
    """Values from outside that bodies read directly, and those of tables and copies."""
    graph: Graph = rolled.graph
    found = [a for loop in rolled.loops for n in loop.body for a in graph.nodes[n].args]
    found += [s.node for loop in rolled.loops for s in loop.stores] + [c.node for loop in rolled.loops for c in loop.copies]
    found += [n for loop in rolled.loops for argument in loop.arguments.values() if isinstance(argument, Table) for n in argument.nodes]
    return [graph.signless(n) for n in found]
