"""The dependencies of an output at the start, and while a host integrates.

At a communication point an output is that of the last step, and follows from nothing else.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from cutjoint.formulate.inputs import INPUT_ORDERS, INPUTS
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.program.blocks import Block

_PARAMETERS = "parameters"


@dataclass(frozen=True, kw_only=True)
class LeafSymbols:
    """The symbols that blocks follow from: numbers of inputs and of parameters, and the names of all others."""

    inputs: frozenset[int] = field(default_factory=frozenset)
    parameters: frozenset[int] = field(default_factory=frozenset)
    symbols: frozenset[str] = field(default_factory=frozenset)

    def __or__(self, other: "LeafSymbols") -> "LeafSymbols":
        return LeafSymbols(
            inputs=self.inputs | other.inputs, parameters=self.parameters | other.parameters, symbols=self.symbols | other.symbols
        )

    def has(self, *prefixes: str) -> bool:
        """Return whether a symbol begins with one of these."""
        return any(symbol.startswith(prefixes) for symbol in self.symbols)


def find_leaves(blocks: Iterable[Block]) -> LeafSymbols:
    """The symbols that any of the blocks follows from."""
    inputs, parameters, symbols = set(), set(), set()
    waiting, seen = list(blocks), set()
    while waiting:
        block = waiting.pop()
        if block in seen:
            continue
        seen.add(block)
        of = block.args[0] if block.op == "take" else block
        rows = range(*block.data[0]) if block.op == "take" else range(block.shape[0])  # type: ignore[index]
        if of.op != "symbol":
            waiting += block.args
        elif of.data == INPUTS:
            inputs |= {row // len(INPUT_ORDERS) for row in rows}
        elif of.data == _PARAMETERS:
            parameters |= set(rows)
        else:
            symbols.add(str(of.data))
    return LeafSymbols(inputs=frozenset(inputs), parameters=frozenset(parameters), symbols=frozenset(symbols))


@dataclass(frozen=True, kw_only=True)
class StartDependencies:
    """The dependencies of an output at the start: numbers of inputs and parameters, and names of given coordinates and speeds.

    ``by_settings`` tells that settings of the steps count too.
    """

    leaves: LeafSymbols
    by_settings: bool


def find_dependencies(equations: RecursiveEquations, seeds: Iterable[str]) -> tuple[StartDependencies, ...]:
    """The dependencies of each column; ``seeds`` are the names of the coordinates and speeds that the start gives."""
    names = ("evaluate", "constraint_residual")
    solving = find_leaves(block for name in names for block in equations.function(name).results.values())
    solved, report = replace(solving, symbols=frozenset(seeds)), equations.function("report").results
    return tuple(_of_column(equations, find_leaves([report[f"column:{c.name}"]]), solved) for c in equations.columns)


def _of_column(equations: RecursiveEquations, leaves: LeafSymbols, solved: LeafSymbols) -> StartDependencies:
    """The dependencies of a column: all of the start's equations if it needs a result of them, else the given values of its own joints."""
    closes = bool(equations.closures) or equations.scene.pose == "equilibrium"
    is_solved = leaves.has("vdot:", "lambda:", *(("q:", "v:") if closes else ()))
    free = frozenset(name for name in solved.symbols if leaves.has(*(f"{a}:{name.rpartition('.')[0]}" for a in "qv")))
    direct = replace(leaves, symbols=free)
    return StartDependencies(leaves=direct | solved if is_solved else direct, by_settings=is_solved)


@dataclass(frozen=True, kw_only=True)
class Dependencies:
    """The dependencies of a value while a host integrates: numbers of inputs, independent coordinates, their rates, time."""

    inputs: frozenset[int]
    positions: bool
    rates: bool
    time: bool


def find_column_dependencies(equations: RecursiveEquations) -> tuple[Dependencies, tuple[Dependencies, ...]]:
    """The dependencies of accelerations, and of each column."""
    names = ("evaluate", "constraint_residual")
    solving = find_leaves(block for name in names for block in equations.function(name).results.values())
    report = equations.function("report").results
    columns = (find_leaves([report[f"column:{c.name}"]]) for c in equations.columns)
    accelerations = Dependencies(inputs=solving.inputs, positions=True, rates=True, time="t" in solving.symbols)
    return accelerations, tuple(_column_dependencies(direct, solving) for direct in columns)


def _column_dependencies(direct: LeafSymbols, solving: LeafSymbols) -> Dependencies:
    """A column follows from all that accelerations do where it needs these; all speeds of loops follow from places too."""
    is_solved = direct.has("vdot:", "lambda:")
    rates = is_solved or direct.has("v:")
    leaves = direct | solving if is_solved else direct
    return Dependencies(inputs=leaves.inputs, positions=rates or direct.has("q:"), rates=rates, time="t" in leaves.symbols)
