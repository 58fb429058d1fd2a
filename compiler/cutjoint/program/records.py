"""The record of a lowered program."""

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.program.blocks import Block, Label, Section
from cutjoint.program.lower import Elements
from cutjoint.program.scalars import FREE, Graph


@dataclass(frozen=True, kw_only=True)
class Result:
    """The place of one scalar of a function's result: element ``index`` of ``target``."""

    target: str
    index: int
    scalar: int


@dataclass(frozen=True, kw_only=True)
class LoweredFunction:
    """A function as scalars: ``statements`` are its nodes of iteration time, arguments first."""

    name: str
    results: tuple[Result, ...]
    statements: tuple[int, ...]

    def __repr__(self) -> str:
        return f"<LoweredFunction {self.name}: {len(self.statements)} statements, {len(self.results)} results>"


@dataclass(frozen=True, kw_only=True)
class Program:
    """All functions on one graph. ``loaded`` and ``stepped`` are the nodes computed when parameters are loaded and when a step begins;
    ``stored`` are those of them that later code reads. ``labels`` names blocks as the formulation did, in the order in which names are
    given. With ``lanes``, equal operations may be computed side by side."""

    graph: Graph
    sections: tuple[Section, ...]
    elements: Mapping[Block, Elements]
    labels: Mapping[Block, Label]
    functions: tuple[LoweredFunction, ...]
    loaded: tuple[int, ...]
    stepped: tuple[int, ...]
    stored: frozenset[int]
    lanes: bool = False

    def __repr__(self) -> str:
        operations = ", ".join(f"{f.name} {self.operations(f.name)}" for f in self.functions)
        return f"<Program of {len(self.graph.nodes)} scalars{', with lanes' if self.lanes else ''}: operations {operations}>"

    def function(self, name: str) -> LoweredFunction:
        """A function by name."""
        return next(f for f in self.functions if f.name == name)

    def operations(self, name: str) -> int:
        """Operations of one call, counted in each lane.
        Every addition, multiplication, division, comparison, choice, root or transcendental counts one."""
        return sum(self._weight(n) for n in self.function(name).statements)

    def instructions(self, name: str) -> int:
        """Instructions of one call: its operations with all lanes of a scalar counted once."""
        return sum(1 for n in self.function(name).statements if self.graph.nodes[n].op not in FREE)

    def _weight(self, n: int) -> int:
        node = self.graph.nodes[n]
        if node.op == "lane_sum":
            return self.graph.nodes[node.args[0]].lanes - 1
        return 0 if node.op in FREE else max(node.lanes, 1)
