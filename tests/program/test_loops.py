"""Loops compute the values of the statements that they stand for, to the last bit, from their arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cutjoint.analysis.closing import make_inputs
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model_text
from cutjoint.program.loops import Argument, Input, Loop, Rolled, Stored, Table, roll
from cutjoint.program.records import LoweredFunction, Program
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology
from tests.compile_run.generated import random_states
from tests.mechanisms.chains import pendulums_in_a_row
from tests.mechanisms.four_bar import four_bar_text
from tests.oracles.scalars import interpret_scalar, interpret_scalars

CASES: dict[str, Callable[[int], str]] = {
    "four-bar": four_bar_text,
    "pendulums": pendulums_in_a_row,
    "balls": lambda n: pendulums_in_a_row(n, joint="spherical"),
    "masses": lambda n: pendulums_in_a_row(n, masses=True),
    "springs": lambda n: pendulums_in_a_row(n, stiffnesses=True, masses=True),
}
FUNCTIONS = ("evaluate", "constraint_residual", "project", "report")


def formulate(text: str) -> RecursiveEquations:
    model = read_model_text(text, "model.yaml")
    scene = find_scene(model, "swing")
    return formulate_recursive(build_topology(model), scene, scene.outputs)


def place_in(equations: RecursiveEquations) -> Callable[[str, int], tuple[str, int]]:
    def place(symbol: str, index: int) -> tuple[str, int]:
        slot = equations.slots.get(symbol)
        return (symbol, index) if slot is None else (slot.array, slot.offset + index)

    return place


@pytest.mark.parametrize("lanes", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_loops_compute_the_same(case: str, lanes: bool) -> None:
    equations = formulate(CASES[case](12))
    compare(equations, schedule_recursive(equations, lanes=lanes), place_in(equations))


def test_places_at_other_distances_are_no_loop_over_places() -> None:
    """Beyond the seventh element of each array there are two that nobody has."""
    equations = formulate(CASES["pendulums"](12))
    regular = place_in(equations)

    def place(symbol: str, index: int) -> tuple[str, int]:
        array, i = regular(symbol, index)
        return array, i + 2 * (i > 6)

    compare(equations, schedule_recursive(equations, lanes=False), place, least=0.0)


def compare(equations: RecursiveEquations, program: Program, place: Callable[[str, int], tuple[str, int]], least: float = 0.6) -> None:
    """Check functions with loops, which have a share of the statements of "evaluate", against those without."""
    state = random_states(equations, 1, seed=4)[0]
    inputs = make_inputs(equations, state.q, state.v) | {"numerics": np.array([1e4, 1.0, 10.0])}
    inputs |= {"t": np.array([0.5]), "motion": np.ones(1)}
    rng = np.random.default_rng(7)
    for slot in ("lambda", "violation", "vdot"):
        inputs |= {s: rng.normal(size=len(x.names)) for s, x in equations.slots.items() if s.startswith(f"{slot}:")}
    for name in FUNCTIONS:
        function = program.function(name)
        rolled = roll(program, function, place)
        if name == "evaluate":
            assert sum(loop.count * len(loop.body) for loop in rolled.loops) >= least * len(function.statements)
        expected = interpret_scalars(program.graph, [r.scalar for r in function.results], inputs, {})
        found = Machine(program, function, rolled, place, inputs).run()
        assert len(found) == len(function.results)
        for result in function.results:
            assert found[place(result.target, result.index)] == expected[result.scalar], (name, result)


class Machine:
    """Runs a function with loops as C++ would: an array has only what has been put into it."""

    def __init__(
        self, program: Program, function: LoweredFunction, rolled: Rolled, place: Callable[[str, int], tuple[str, int]],
        inputs: dict[str, np.ndarray],
    ) -> None:  # fmt: skip
        self.rolled = rolled
        self.place = place
        self.nodes = rolled.graph.nodes
        own = {n for n in function.statements if self.nodes[n].op not in ("symbol", "neg")}
        known = [n for n in program.graph.reachable([r.scalar for r in function.results]) if n not in own and self.nodes[n].op != "neg"]
        self.values: dict[int, Any] = interpret_scalars(program.graph, known, inputs, {})
        self.inputs = {place(*node.data): self.values[n] for n in known for node in [self.nodes[n]] if node.op == "symbol"}  # type: ignore[misc]
        rows = [(i, k, row) for i, loop in enumerate(rolled.loops) for k, row in enumerate(loop.iterations)]
        self.where = {n: (i, j, k) for i, k, row in rows for j, n in enumerate(row)}
        self.stored: dict[tuple[int, int], dict[int, Any]] = {}
        self.results: dict[tuple[str, int], Any] = {}

    def run(self) -> dict[tuple[str, int], Any]:
        for part in self.rolled.parts:
            if isinstance(part, int):
                self.loop(part, self.rolled.loops[part])
                continue
            for n in part:
                self.values[n] = interpret_scalar(self.nodes[n], [self.value(a, {}) for a in self.nodes[n].args], {}, {})
        for r in self.rolled.results:
            self.results[self.place(r.target, r.index)] = self.value(r.scalar, {})
        return self.results

    def loop(self, i: int, loop: Loop) -> None:
        for copy in loop.copies:
            self.keep(copy.loop, copy.statement, copy.place, self.value(copy.node, {}))
        tables = {n: [self.value(a, {}) for a in x.nodes] for n, x in loop.arguments.items() if isinstance(x, Table)}
        for k in range(loop.count):
            local = {n: self.argument(x, tables.get(n, []), k) for n, x in loop.arguments.items() if self.is_ready(x, k)}
            for j, n in enumerate(loop.body):
                local |= {m: self.argument(x, [], k) for m, x in loop.arguments.items() if m not in local and self.is_ready(x, k)}
                local[n] = interpret_scalar(self.nodes[n], [self.value(a, local) for a in self.nodes[n].args], {}, {})
                if j in loop.arrays:
                    self.keep(i, j, k, local[n])
            for store in loop.stores:
                self.results[store.array, store.step.at(k)] = self.value(store.node, local)

    def keep(self, loop: int, statement: int, place: int, value: Any) -> None:
        first, last = self.rolled.loops[loop].arrays[statement]
        assert first <= place <= last
        array = self.stored.setdefault((loop, statement), {})
        assert place not in array or np.array_equal(array[place], value)
        array[place] = value

    def is_ready(self, argument: Argument, k: int) -> bool:
        return not isinstance(argument, Stored) or argument.step.at(k) in self.stored.get((argument.loop, argument.statement), {})

    def argument(self, argument: Argument, table: list[Any], k: int) -> Any:
        match argument:
            case Input(array, step):
                return self.inputs[array, step.at(k)]
            case Stored(loop, statement, step):
                return self.stored[loop, statement][step.at(k)]
            case Table():
                return table[k]

    def value(self, a: int, local: dict[int, Any]) -> Any:
        """A scalar's value: of this iteration, from outside all loops, or from an array."""
        if a in local:
            return local[a]
        if self.nodes[a].op == "neg":
            return -self.value(self.nodes[a].args[0], local)
        if a in self.where:
            loop, statement, k = self.where[a]
            return self.stored[loop, statement][k]
        return self.values[a]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_code_of_a_chain_does_not_grow(name: str) -> None:
    """The N-four-bar has the same statements for any N; only counts and the last places are other numbers."""
    sizes = []
    for windows in (10, 30):
        equations = formulate(four_bar_text(windows))
        program = schedule_recursive(equations, lanes=True)
        rolled = roll(program, program.function(name), place_in(equations))
        single = sum(len(part) for part in rolled.parts if not isinstance(part, int))
        sizes.append((single, len(rolled.results), [len(loop.body) + len(loop.stores) for loop in rolled.loops]))
        assert all(abs(loop.count - windows) <= 1 for loop in rolled.loops)
    assert sizes[0] == sizes[1]


def test_few_repetitions_stay_as_they_are() -> None:
    equations = formulate(four_bar_text(4))
    program = schedule_recursive(equations, lanes=True)
    function = program.function("evaluate")
    rolled = roll(program, function, place_in(equations))
    assert rolled.loops == ()
    assert rolled.results == function.results
    assert rolled.parts == (tuple(n for n in function.statements if program.graph.nodes[n].op not in ("symbol", "neg")),)
