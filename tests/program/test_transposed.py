"""Transposed functions, interpreted: weighed sums of results change along arguments as differences of the scalars say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.formulate.implicit.equations import formulate_residual
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.transposed import Derived, linearise_residual, transpose
from cutjoint.methods import METHODS, Loops
from cutjoint.program.blocks import FUNCTIONS, BindingTime
from cutjoint.program.elimination import adjoint, derivatives
from cutjoint.program.lower import call_scalar
from cutjoint.program.records import Program
from cutjoint.program.scalars import Graph
from cutjoint.run.scenes import load_model, with_loops
from cutjoint.run.settings import find_closure
from tests.conftest import MODELS
from tests.oracles.scalars import interpret_scalars

#: Functions by numbers at which they have derivatives.
_PLACES = {name: [0.3, 0.4][:arity] for name, arity in FUNCTIONS.items() if arity < 3 and not name.startswith("road_")}


class Ground:
    """A road with derivatives, for which nothing else is known."""

    def height(self, x: float, y: float) -> float:
        return 0.1 * np.sin(x)

    def slope(self, x: float, y: float) -> float:
        return 0.1 * np.cos(x)

    def height_dx(self, x: float, y: float) -> float:
        return 0.1 * np.cos(x)

    def slope_dx(self, x: float, y: float) -> float:
        return -0.1 * np.sin(x)


@pytest.mark.parametrize("function", [f for f in _PLACES if f not in ("lt", "le", "and", "or", "not")])
def test_each_function_has_its_derivatives(function: str) -> None:
    graph = Graph()
    numbers = _PLACES[function]
    args = tuple(graph.symbol("x", i, BindingTime.ITERATION) for i in range(len(numbers)))
    y, weight = call_scalar(graph, function, args), graph.symbol("w", 0, BindingTime.ITERATION)
    found = adjoint(graph, {y: weight}, set(args))
    inputs = {"x": np.array(numbers), "w": np.array([1.7])}

    def value(x: np.ndarray) -> float:
        return 1.7 * float(interpret_scalars(graph, [y], {"x": x}, {})[y])

    for i, a in enumerate(args):
        step = 1e-4 * np.eye(len(args))[i]
        ends = [value(inputs["x"] + way * step) for way in (-2, -1, 1, 2)]
        slope = interpret_scalars(graph, [found[a]], inputs, {})[found[a]]
        assert slope == pytest.approx((ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / 12e-4, rel=1e-10)


def test_lanes_are_gathered_summed_and_taken() -> None:
    """f = sum over lanes of x u + 3 x_1, u the same in both lanes."""
    graph = Graph()
    a, b, u = (graph.symbol("x", i, BindingTime.ITERATION) for i in range(3))
    lanes = graph.gather((a, b))
    f = graph.add(graph.lane_sum(graph.mul(lanes, u)), graph.mul(graph.const(3.0), graph.lane(graph.mul(lanes, lanes), 1)))
    found = adjoint(graph, {f: graph.const(1.0)}, {a, b, u})
    gradients = interpret_scalars(graph, list(found.values()), {"x": np.array([2.0, 5.0, 7.0])}, {})
    assert [gradients[found[n]] for n in (a, b, u)] == [7.0, 7.0 + 30.0, 7.0]


@pytest.mark.parametrize(("model", "scene", "tunable", "share"), [
    ("pendulum", None, ["*.mass"], 1e-9), ("press", None, ["*.mass", "A.z"], 1e-9), ("four_bar", None, ["*.mass"], 1e-9),
    ("axle", "bump", ["*.mass"], 1e-8), ("iltis", "simul1", ["*.mass"], 1e-7),
])  # fmt: skip
def test_models(model: str, scene: str | None, tunable: list[str], share: float) -> None:
    generated = generate(*(given := load_model(MODELS / f"{model}.yaml", scene, tunable)), given[1].outputs)
    transposed = transpose(generated.equations, generated.program)  # type: ignore[arg-type]
    inputs = _drawn(transposed.program, [p.value for p in generated.equations.parameters])
    roads = dict.fromkeys(generated.equations.roads, Ground())
    for name in ("report", *(("constraint_residual", "project") if generated.equations.equation_names else ("evaluate",))):
        _compare(name, generated.program, transposed, inputs, roads, share)


def test_a_quantity_that_two_outputs_report_has_both_weights() -> None:
    read, scene = load_model(MODELS / "pendulum.yaml", None, ["*.mass"])
    outputs = [*scene.outputs, replace(scene.outputs[0], name="again")]
    generated = generate(read, scene, outputs)
    results = generated.program.function("report").results
    assert len({r.scalar for r in results}) < len(results)
    transposed = transpose(generated.equations, generated.program)  # type: ignore[arg-type]
    inputs = _drawn(transposed.program, [p.value for p in generated.equations.parameters])
    _compare("report", generated.program, transposed, inputs, {}, 1e-9)


def _drawn(program: Program, parameters: list[float]) -> dict[str, np.ndarray]:
    """Inputs at random, quaternions near that of the design position."""
    draw, inputs = np.random.default_rng(0), dict[str, np.ndarray]()
    symbols = [node.data for node in program.graph.nodes if node.op == "symbol"]
    for symbol, index in symbols:  # type: ignore[misc]
        inputs.setdefault(symbol, np.zeros(1)).resize(max(index + 1, len(inputs[symbol])), refcheck=False)
    for symbol, numbers in inputs.items():
        numbers[:] = 0.3 * draw.normal(size=len(numbers))
        if symbol.startswith("q:") and len(numbers) >= 4:
            numbers[-4:] = 1.0, 0.1, 0.2, -0.1
        if symbol in ("penalties", "numerics"):
            numbers[:] = 1.0 + np.abs(numbers)
    return {**inputs, "parameters": np.array(parameters)}


def _compare(
    name: str, program: Program, transposed: Derived, inputs: dict[str, np.ndarray], roads: dict[str, Ground], share: float
) -> None:  # fmt: skip
    draw, results = np.random.default_rng(1), program.function(name).results
    ways = {
        symbol: (0.1 * numbers if symbol == "parameters" else 1.0) * draw.normal(size=len(numbers))
        for symbol, numbers in inputs.items() if symbol == "parameters" or symbol.startswith(("q:", "v:", "vdot:", "lambda:", "violation:"))
    }  # fmt: skip

    def value(way: float) -> float:
        moved = {symbol: numbers + way * 1e-4 * ways.get(symbol, 0.0) for symbol, numbers in inputs.items()}
        found = interpret_scalars(program.graph, [r.scalar for r in results], moved, roads)  # type: ignore[arg-type]
        return sum(inputs[f"by_{r.target}"][r.index] * found[r.scalar] for r in results)

    derivatives_of = partial(_slopes, transposed, inputs, roads)
    ends = [value(way) for way in (-2, -1, 1, 2)]
    by_loaded, along = np.zeros(transposed.loaded), 0.0
    for (symbol, index), slope in derivatives_of(f"{name}_transposed").items():
        if symbol == "loaded":
            by_loaded[index] += slope
        elif symbol in ways:
            along += slope * ways[symbol][index]
    for (symbol, index), slope in derivatives_of("load_transposed", by_loaded=by_loaded).items():
        along += slope * ways[symbol][index]
    assert along == pytest.approx((ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / 12e-4, rel=share)


def _slopes(
    transposed: Derived, inputs: dict[str, np.ndarray], roads: dict[str, Ground], function: str, **more: np.ndarray
) -> dict[tuple[str, int], float]:  # fmt: skip
    results = transposed.program.function(function).results
    found = interpret_scalars(transposed.program.graph, [r.scalar for r in results], {**inputs, **more}, roads)  # type: ignore[arg-type]
    lanes = ((r, k, x) for r in results for k, x in enumerate(np.atleast_1d(found[r.scalar])))
    return {(r.target.removeprefix("by_"), r.index + k): float(x) for r, k, x in lanes}


def test_derivatives_by_elimination_are_those_of_adjoints() -> None:
    """Of results that numbers reach by lanes that are gathered, summed, taken and spread; a choice keeps out what has no value there."""
    graph = Graph()
    x = [graph.symbol("x", i, BindingTime.ITERATION) for i in range(6)]
    lanes, others = graph.gather(tuple(x[:3])), graph.gather((x[3], x[4], graph.const(2.0)))
    product, root = graph.mul(lanes, x[5]), graph.call("sqrt", (graph.sub(x[4], x[3]),))
    middle = graph.mul(graph.lane_sum(graph.mul(product, others)), graph.lane(graph.call("sin", (lanes,)), 1))
    again = graph.mul(graph.gather((middle, x[0], graph.lane(others, 0))), graph.add(lanes, middle))
    chosen = graph.call("where", (graph.call("lt", (x[4], x[3])), middle, graph.mul(root, root)))
    results = [graph.lane(again, 0), graph.lane(again, 2), graph.lane_sum(again), middle, chosen, graph.const(1.0)]
    targets = {*x, lanes}
    found = derivatives(graph, results, targets)
    wanted = [adjoint(graph, {y: graph.const(1.0)}, targets) for y in results]
    for x_4, place in ((1.5, range(6)), (1.1, [0, 1, 2, 3, 3])):
        at = {"x": np.array([0.3, 0.5, -0.7, 1.3, x_4, 0.9])}
        for mine, other in zip(found, (wanted[i] for i in place), strict=False):
            known = interpret_scalars(graph, [*mine.values(), *other.values()], at, {})
            for n in targets:
                both = [np.broadcast_to(known[by[n]] if n in by else 0.0, max(graph.nodes[n].lanes, 1)) for by in (mine, other)]
                assert both[0] == pytest.approx(both[1], rel=1e-13, abs=1e-15)


#: Functions of x, y and a weight k with infinitely steep roots of squares; with their derivatives by all three at 3, 4, 2.
_LENGTHS: dict[str, tuple[str, Callable[..., Any]]] = {
    "length": ("sqrt", lambda g, xx, yy, k: g.add(xx, yy)),
    "power": ("pow", lambda g, xx, yy, k: g.add(xx, yy)),
    "weighed": ("sqrt", lambda g, xx, yy, k: g.add(xx, g.mul(g.const(2.0), yy))),
    "power of weighed": ("pow", lambda g, xx, yy, k: g.add(g.mul(g.const(0.2), xx), yy)),
    "a third": ("sqrt", lambda g, xx, yy, k: g.div(g.add(xx, yy), g.const(3.0))),
    "by a parameter": ("sqrt", lambda g, xx, yy, k: g.add(xx, g.mul(k, yy))),
    "over a parameter": ("sqrt", lambda g, xx, yy, k: g.div(g.add(xx, yy), k)),
    "all by a parameter": ("sqrt", lambda g, xx, yy, k: g.mul(g.add(xx, yy), k)),
    "root of a root": ("sqrt", lambda g, xx, yy, k: g.mul(g.const(3.0), g.call("sqrt", (g.add(xx, yy),)))),
}


def _length(name: str) -> tuple[Graph, list[int], int]:
    graph = Graph()
    x, y, k = (graph.symbol("x", i, BindingTime.ITERATION) for i in range(3))
    function, inner = _LENGTHS[name]
    squares = inner(graph, graph.mul(x, x), graph.mul(y, y), k)
    return graph, [x, y, k], graph.call(function, (squares,) if function == "sqrt" else (squares, graph.const(0.75)))


def _gradients(graph: Graph, f: int, by: list[int], at: list[float]) -> list[list[float]]:
    """By elimination and by adjoints."""
    both = derivatives(graph, [f], by)[0], adjoint(graph, {f: graph.const(1.0)}, by)
    known = interpret_scalars(graph, [n for found in both for n in found.values()], {"x": np.array(at)}, {})
    return [[float(known[found[n]]) if n in found else 0.0 for n in by] for found in both]


@pytest.mark.parametrize("name", _LENGTHS)
def test_a_function_of_a_sum_of_squares_has_no_derivative_at_zero(name: str) -> None:
    """There a root is infinitely steep, and its argument changes with nothing; elsewhere derivatives are those of differences."""
    graph, by, length = _length(name)
    f = graph.sub(length, by[0])
    for found in _gradients(graph, f, by, [0.0, 0.0, 2.0]):
        assert found == [-1.0, 0.0, 0.0]
    at = np.array([3.0, 4.0, 2.0])
    ends = [[interpret_scalars(graph, [f], {"x": at + way * 1e-3 * axis}, {})[f] for way in (-2, -1, 1, 2)] for axis in np.eye(3)]
    wanted = [(a - 8 * b + 8 * c - d) / 12e-3 for a, b, c, d in ends]
    for found in _gradients(graph, f, by, list(at)):
        assert found == pytest.approx(wanted, abs=1e-10)


@pytest.mark.parametrize("name", ["by a parameter", "all by a parameter"])
def test_a_weight_of_zero_has_an_infinite_derivative(name: str) -> None:
    """Where the squares are not zero but the root is, which guards that see the weighed sum would take for zero."""
    graph, by, length = _length(name)
    for found in _gradients(graph, length, by, [0.0, 4.0, 0.0]):
        assert not np.isfinite(found[2])


def test_products_of_equal_factors_are_squares_in_any_order() -> None:
    graph = Graph()
    x, y, k = by = [graph.symbol("x", i, BindingTime.ITERATION) for i in range(3)]
    f = graph.call("sqrt", (graph.add(graph.mul(graph.mul(k, x), x), graph.mul(graph.mul(graph.const(2.0), y), y)),))
    assert _gradients(graph, f, by, [0.0, 0.0, 2.0]) == [[0.0] * 3] * 2


def test_lanes_of_lengths_have_no_derivatives_at_zero() -> None:
    """Of which one is zero; weights by lane leave none out, and a sum with other terms is no sum of squares."""
    graph = Graph()
    by = [graph.symbol("x", i, BindingTime.ITERATION) for i in range(4)]
    first, second = graph.gather((by[0], by[1])), graph.gather((by[2], by[3]))
    squares = graph.add(graph.mul(first, first), graph.mul(graph.lane_const([2.0, 3.0]), graph.mul(second, second)))
    f = graph.lane_sum(graph.call("sqrt", (squares,)))
    for found in _gradients(graph, f, by, [0.0, 1.0, 0.0, 4.0]):
        assert found == pytest.approx([0.0, 1 / 7, 0.0, 12 / 7], rel=1e-14)
    other = graph.call("sqrt", (graph.add(graph.mul(by[0], by[0]), by[1]),))
    for found in _gradients(graph, other, by, [0.0] * 4):
        assert not np.isfinite(found[1])


@pytest.mark.parametrize(("model", "scene", "loops"), [
    ("pendulum", None, Loops.EXACT), ("press", None, Loops.EMBEDDED), ("iltis", "simul1", Loops.EMBEDDED),
    ("press", None, Loops.EXACT), ("iltis", "simul1", Loops.EXACT), ("six_bar", None, Loops.EXACT),
])  # fmt: skip
def test_the_balance_of_forces(model: str, scene: str | None, loops: Loops) -> None:
    """Nothing is left of it at the accelerations of the recursion and corrected multipliers, of loops what their penalties let give way,
    and it changes along all that it follows from as differences say, of a guide by its law along the time too."""
    read, chosen = load_model(MODELS / f"{model}.yaml", scene, ["*.mass"])
    generated = generate(read, with_loops(chosen, loops), chosen.outputs)
    closure = find_closure(chosen.numerics, METHODS["recursive"]).name
    balance = formulate_residual(generated.equations, closure)  # type: ignore[arg-type]
    program = schedule_recursive(balance, lanes=True)
    derived = linearise_residual(balance, program)
    parameters = [p.value for p in balance.parameters]
    inputs = _drawn(generated.program, parameters) | _drawn(program, parameters)
    for symbol, numbers in inputs.items():
        if symbol == "penalties":
            numbers[:] = 1e5  # of which three passes leave rounding
        if symbol.startswith("q:") and len(numbers) >= 4:
            numbers[-4:] /= np.linalg.norm(numbers[-4:])
    roads = dict.fromkeys(balance.roads, Ground())
    results, of_motion = program.function("residual_of_forces").results, generated.program.function("evaluate").results
    forces = len(balance.speed_names)
    rows = {r.target: balance.slots[r.target].offset + (forces if r.target.startswith("curvature") else 0) for r in results}
    places = [rows[r.target] + r.index for r in results]

    def left(way: float, ways: dict[str, np.ndarray]) -> np.ndarray:
        moved = {symbol: numbers + way * ways.get(symbol, 0.0) for symbol, numbers in inputs.items()}
        found = interpret_scalars(program.graph, [r.scalar for r in results], moved, roads)  # type: ignore[arg-type]
        return np.array([found[r.scalar] for r in results])

    still = left(0.0, {})
    motion = interpret_scalars(generated.program.graph, [r.scalar for r in of_motion], inputs, roads)  # type: ignore[arg-type]
    errors = np.zeros(len(still))
    for r in of_motion:
        symbol, name = r.target.split(":")
        if symbol == "vdot":
            inputs[r.target][r.index] = motion[r.scalar]
        else:
            inputs[f"lambda:{name}"][r.index] += motion[r.scalar]
            errors[rows[f"curvature:{name}"] + r.index] = motion[r.scalar] / inputs["numerics"][0] if "numerics" in inputs else 0.0
    assert left(0.0, {}) == pytest.approx(errors[places], abs=1e-10 * np.abs(still).max())

    draw = np.random.default_rng(2)
    ways = {symbol: 1e-4 * draw.normal(size=len(numbers)) for symbol, numbers in inputs.items() if symbol in ("parameters", *balance.slots)}
    ways["parameters"] = ways["parameters"] * inputs["parameters"]
    moves = any(f.name == "residual_by_time" for f in derived.equations.functions)
    assert moves == (model == "six_bar")
    ways |= {"t": np.array([1e-4])} if moves else {}

    def of(function: str, way: float = 0.0) -> dict[tuple[str, int], float]:
        moved = {**inputs, "parameters": inputs["parameters"] + way * ways["parameters"]}
        return _slopes(derived, moved, roads, function)

    loaded = _fourth_order([of("loaded_values", way) for way in (-2, -1, 1, 2)])
    given = 3 * len(balance.inputs) + balance.discrete_states
    sizes = {"q": balance.coordinates, "v": forces, "input": given, "loaded": derived.loaded, "vdot": forces}
    columns = {name: np.zeros(size) for name, size in {**sizes, "lambda": len(balance.equation_names)}.items()}
    columns["loaded"][:] = [loaded["loaded", i] for i in range(derived.loaded)]
    for symbol, slot in balance.slots.items():
        if slot.array in columns and symbol in ways:
            columns[slot.array][slot.offset : slot.offset + len(ways[symbol])] = ways[symbol]
    numbers, found = np.concatenate(list(columns.values())), of("residual_jacobian")
    entries = ((row, column) for row, of_row in enumerate(derived.columns) for column in of_row)
    along = np.zeros(len(still))
    for i, (row, column) in zip(derived.places, entries, strict=True):
        along[row] += found["entry", i] * numbers[column]
    for (_, row), derivative in of("residual_by_time").items() if moves else ():
        along[row] += derivative * ways["t"][0]
    differences = _fourth_order([dict(enumerate(left(way, ways))) for way in (-2, -1, 1, 2)])
    wanted = np.array([differences[i] for i in range(len(still))])
    assert along[places] == pytest.approx(wanted, abs=1e-8 * np.abs(wanted).max())


def _fourth_order(ends: list[dict[Any, float]]) -> dict[Any, float]:
    """The derivatives of numbers at -2, -1, 1 and 2."""
    return {place: (ends[0][place] - 8 * ends[1][place] + 8 * ends[2][place] - ends[3][place]) / 12 for place in ends[0]}
