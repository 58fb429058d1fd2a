"""Program -> the data that the interpreter (runtime/include/cutjoint/interpreter/) executes instead of generated code.

All values are in one memory of doubles. Its first registers have an image: constants, arrays of arguments, and results of `load` and of the
beginning of a step. The values of the running call follow. Lanes stand side by side; conditions are 1 or 0.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from cutjoint.emit.factor_tables import table_items
from cutjoint.emit.simulator import describe
from cutjoint.emit.source import Source
from cutjoint.formulate.inputs import LAW_TIME
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.program.records import Program, Result
from cutjoint.program.scalars import Graph, Scalar
from cutjoint.sparse.plan import Plan

#: An operation with its number of lanes, its result's register, and those of its arguments; a lookup has the number of its road last.
Instruction: TypeAlias = tuple[str, int, int, tuple[int, ...]]

#: Sums fused with one product or two that nothing else uses; they are rounded as separate operations.
_FUSED = {"add": ("muladd", "muladd", "mulmuladd"), "sub": ("mulsub", "submul", "mulmulsub")}

#: Scalars that are not computed: they are in memory when a function begins, or in other lanes.
_PLACED = frozenset({"const", "lane_const", "symbol", "lane"})

_LATE = 1 << 40  #: the registers of values of calls begin here until the number of registers before them is known

#: Inputs of the program that are no columns of coordinates: the arrays where they stand.
_ARRAYS = {"numerics": "stabilisation", LAW_TIME: "t"}


def emit_interpreted(program: Program, equations: Equations, start: Program | None = None) -> tuple[Source, dict[str, Any]]:
    """The file for the interpreter, and the offsets in it: of a mechanism, or of a system with the mechanism that starts its runs."""
    if isinstance(equations, RecursiveEquations):
        driver, described = "recursive", describe_mechanism(program, equations)
    else:
        assert isinstance(equations, SystemEquations)
        assert start is not None
        assert equations.plan is not None
        driver = "lagrangian"
        described = {"start": describe_mechanism(start, equations.start), **_describe_system(program, equations, equations.plan)}
    text = json.dumps(described)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return Source(stem=equations.topology.model.name, files={"program.json": text}, digest=digest, driver=driver), described


def describe_mechanism(program: Program, equations: RecursiveEquations) -> dict[str, Any]:
    """The mechanism of a program for the interpreter."""
    q, v, m = equations.coordinates, equations.unknowns, len(equations.equation_names)
    arrays = {"q": q, "v": v, "vdot": v, "lambda": m, "violation": m, "stabilisation": 3, "penalties": max(len(equations.closures), 1)}
    arrays |= {"next_discrete": equations.discrete_states}
    return {"description": _description(equations), **_assemble(program, equations, arrays)}


def _describe_system(program: Program, equations: SystemEquations, plan: Plan) -> dict[str, Any]:
    names, pattern = equations.coordinate_names, plan.pattern
    q, v, m, tangents = len(names), equations.unknowns, len(equations.equation_names), 9 * sum(c.ball for c in equations.charts)
    arrays = {"q": q, "v": v, "vdot": v, "lambda": m, "w": m, "penalty": 1, "weights": 3, "weights.ball_tangents": tangents}
    arrays |= {"next_discrete": equations.discrete_states}
    arrays |= {"relative_q": equations.start.coordinates, "relative_v": equations.start.unknowns}
    about = {
        "method": equations.method, **_description(equations), "factors": plan.storage.length,
        "pattern": {"size": pattern.size, "symmetric": pattern.symmetric, "first": list(pattern.first), "row": list(pattern.row)},
    }  # fmt: skip
    tables = {name: [item for group in groups for item in group] for name, groups in table_items(plan).items()}
    return {"description": about, "tables": tables, **_assemble(program, equations, arrays)}


def _description(equations: RecursiveEquations | SystemEquations) -> dict[str, Any]:
    d: dict[str, Any] = describe(equations)
    return {
        "name": d["model"],
        "charts": [[c.q, c.v, c.scalars, c.ball, c.reversed] for c in d["charts"]],
        **{field: list(names) for field, names in d["name_lists"].items()},
        **{key: [[p["name"], p["unit"], float(p["value"])] for p in d[key]] for key in ("parameters", "inputs")},
        "roads": list(d["roads"]), "columns": [[c.name, c.unit] for c in d["columns"]], "cuts": d["cuts"],
        **{key: [list(x.values()) for x in d[key]] for key in ("guards", "domains", "indicators", "controllers")},
        "states": d["states"], "nominals": d["nominals"], "arm": d["arm"], "driven": d["driven"], "guides_jump": d["guides_jump"],
    }  # fmt: skip


def _assemble(program: Program, equations: Equations, arrays: Mapping[str, int]) -> dict[str, Any]:
    assembler, values = _Assembler(program, equations), equations.input_values
    arrays = {**arrays, "parameters": len(equations.parameters), "t": 1, "motion": 1, "input": values}
    if fits := equations.fits:
        arrays |= {"place": max(1 + len(fit.description()["start"]) for fit in fits), "series": sum(fit.length for fit in fits)}
    for name, length in arrays.items():
        assembler.arrays[name] = assembler._keep([0.0] * length)
    for name, nodes in (("load", program.loaded), ("begin_step", program.stepped)):
        assembler.assemble(name, nodes, (), early=True)
    for f in program.functions:
        assembler.assemble(f.name, f.statements, f.results)
    return {"inputs": values, **({"fits": [fit.description() for fit in fits]} if fits else {}), **assembler.finish()}


@dataclass
class _Assembler:
    """Gives registers to the scalars of a program, function after function."""

    program: Program
    equations: Equations
    arrays: dict[str, int] = field(default_factory=dict)
    _image: list[float] = field(default_factory=list)
    _constants: dict[tuple[float, ...], int] = field(default_factory=dict)
    _early: dict[int, int] = field(default_factory=dict)
    _late: dict[int, int] = field(default_factory=dict)
    _spread: dict[tuple[int, int], int] = field(default_factory=dict)
    _functions: dict[str, tuple[list[Instruction], dict[str, list[int]]]] = field(default_factory=dict)
    _top: int = 0
    _most: int = 0

    @property
    def _graph(self) -> Graph:
        return self.program.graph

    def assemble(self, name: str, nodes: Sequence[int], results: Sequence[Result], *, early: bool = False) -> None:
        """The instructions of a function and the registers of its results; the values of an ``early`` one stay."""
        self._late, self._spread, self._top = {}, {}, 0
        fused = set() if early else self._fuse(nodes, results)
        computed = [n for n in nodes if self._graph.nodes[n].op not in _PLACED and n not in fused]
        self._place(computed, early=early)
        code: list[Instruction] = []
        for n in computed:
            self._add(code, n, fused)
        self._functions[name] = code, self._placed(results)

    def finish(self) -> dict[str, Any]:
        """Functions and memory as data; the values of calls come after what has an image."""
        first = len(self._image) - _LATE
        operations: dict[tuple[str, int], int] = {}
        functions = {}
        for name, (instructions, results) in self._functions.items():
            code: list[int] = []
            for op, lanes, to, args in instructions:
                code.append(operations.setdefault((op, lanes), len(operations)))
                code += [x if x < _LATE else x + first for x in (to, *args)]
            placed = {array: [x if x < _LATE else x + first for x in registers] for array, registers in results.items()}
            functions[name] = {"code": code, "results": placed}
        return {
            "image": self._image, "registers": len(self._image) + self._most, "arrays": self.arrays,
            "operations": [list(x) for x in operations], "functions": functions,
        }  # fmt: skip

    def _placed(self, results: Sequence[Result]) -> dict[str, list[int]]:
        """The register of each element of the arrays that a function fills."""
        found: dict[str, dict[int, int]] = {}
        for r in results:
            array, index = self._element(r.target, r.index)
            found.setdefault(array, {})[index] = self._register(r.scalar)
        return {array: [elements[i] for i in range(len(elements))] for array, elements in found.items()}

    def _fuse(self, statements: Sequence[int], results: Sequence[Result]) -> set[int]:
        """The products that only one sum needs, which takes them as it is computed."""
        nodes, own = self._graph.nodes, set(statements)
        uses = Counter([*(a for n in statements for a in nodes[n].args), *(r.scalar for r in results)])
        return {
            a for n in statements if nodes[n].op in _FUSED for a in nodes[n].args
            if a in own and uses[a] == 1 and nodes[a].op == "mul" and nodes[a].lanes == nodes[n].lanes
        }  # fmt: skip

    def _place(self, computed: Sequence[int], *, early: bool) -> None:
        """Assign registers to scalars; a scalar of a gather is computed at its place there."""
        kept, nodes = self._early if early else self._late, self._graph.nodes
        own = set(computed)
        for n in sorted(computed, key=lambda n: nodes[n].op != "gather"):
            if n in kept:
                continue
            width = max(nodes[n].lanes, 1)
            kept[n] = self._keep([0.0] * width) if early else self._take(width)
            if nodes[n].op == "gather":
                kept |= {a: kept[n] + k for k, a in enumerate(nodes[n].args) if a in own and a not in kept}

    def _add(self, code: list[Instruction], n: int, fused: set[int]) -> None:
        node, to = self._graph.nodes[n], self._register(n)
        if node.op == "gather":
            code += [("copy", 1, to + k, (x,)) for k, x in enumerate(map(self._register, node.args)) if x != to + k]
            return
        args = [self._operand(code, a, node) for a in node.args if a not in fused]
        op, lanes = node.op, max(node.lanes, 1)
        if node.op in _FUSED and (products := [a for a in node.args if a in fused]):
            first = node.args[0] in fused
            op = _FUSED[node.op][2 if len(products) == 2 else 0 if first else 1]
            factors = [self._operand(code, x, node) for a in products for x in self._graph.nodes[a].args]
            args = [*factors, *args]
        elif node.op == "lane_sum":
            lanes = self._graph.nodes[node.args[0]].lanes
        elif node.op.startswith("road_"):
            args.append(self.equations.roads.index(str(node.data)))
        code.append((op, lanes, to, tuple(args)))

    def _operand(self, code: list[Instruction], a: int, user: Scalar) -> int:
        """The register of an argument; one that is the same in all lanes of its user is spread over these."""
        if not user.lanes or self._graph.nodes[a].lanes:
            return self._register(a)
        value = self._graph.value(a)
        if value is not None:
            return self._constant((value,) * user.lanes)
        if (a, user.lanes) not in self._spread:
            to = self._spread[a, user.lanes] = self._take(user.lanes)
            code.append(("spread", user.lanes, to, (self._register(a),)))
        return self._spread[a, user.lanes]

    def _register(self, n: int) -> int:
        node = self._graph.nodes[n]
        match node.op, node.data:
            case "const", float(value):
                return self._constant((value,))
            case "lane_const", tuple(numbers):
                return self._constant(numbers)
            case "lane", int(k):
                return self._register(node.args[0]) + k
            case "symbol", (str(symbol), int(index)):
                array, element = self._element(symbol, index)
                return self.arrays[array] + element
        return self._early[n] if n in self._early else self._late[n]

    def _element(self, symbol: str, index: int) -> tuple[str, int]:
        slot = self.equations.slots.get(symbol)
        return (_ARRAYS.get(symbol, symbol), index) if slot is None else (slot.array, slot.offset + index)

    def _constant(self, numbers: tuple[float, ...]) -> int:
        if numbers not in self._constants:
            self._constants[numbers] = self._keep(numbers)
        return self._constants[numbers]

    def _keep(self, values: Sequence[float]) -> int:
        """Registers with an image."""
        self._image += values
        return len(self._image) - len(values)

    def _take(self, count: int) -> int:
        self._top += count
        self._most = max(self._most, self._top)
        return _LATE + self._top - count
