"""Transposed functions, interpreted: weighed sums of results change along arguments as differences of the scalars say."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.formulate.transposed import Transposed, transpose
from cutjoint.program.blocks import FUNCTIONS, BindingTime
from cutjoint.program.differentiate import adjoint
from cutjoint.program.interpret import interpret_scalars
from cutjoint.program.lower import call_scalar
from cutjoint.program.records import Program
from cutjoint.program.scalars import Graph
from cutjoint.run.scenes import take_model
from tests.conftest import MODELS

#: Functions by numbers at which they have derivatives.
_PLACES = {name: [0.3, 0.4][:arity] for name, arity in FUNCTIONS.items() if arity < 3 and not name.startswith("road_")}


class Ground:
    """A road with slopes, for which nothing else is known."""

    def height(self, x: float, y: float) -> float:
        return 0.1 * np.sin(x)

    def slope(self, x: float, y: float) -> float:
        return 0.1 * np.cos(x)

    def height_dx(self, x: float, y: float) -> float:
        return 0.1 * np.cos(x)

    def slope_dx(self, x: float, y: float) -> float:
        return -0.1 * np.sin(x)


@pytest.mark.parametrize("function", [f for f in _PLACES if f not in ("lt", "le", "and", "or", "not")])
def test_each_function_has_its_slopes(function: str) -> None:
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
    slopes = interpret_scalars(graph, list(found.values()), {"x": np.array([2.0, 5.0, 7.0])}, {})
    assert [slopes[found[n]] for n in (a, b, u)] == [7.0, 7.0 + 30.0, 7.0]


@pytest.mark.parametrize(("model", "scene", "opened", "share"), [
    ("pendulum", None, ["*.mass"], 1e-9), ("press", None, ["*.mass", "A.z"], 1e-9), ("four_bar", None, ["*.mass"], 1e-9),
    ("axle", "bump", ["*.mass"], 1e-8), ("iltis", "simul1", ["*.mass"], 1e-7),
])  # fmt: skip
def test_models(model: str, scene: str | None, opened: list[str], share: float) -> None:
    generated = generate(*(given := take_model(MODELS / f"{model}.yaml", scene, opened)), given[1].outputs)
    transposed = transpose(generated.equations, generated.program)  # type: ignore[arg-type]
    inputs = _drawn(transposed.program, [p.value for p in generated.equations.parameters])
    roads = dict.fromkeys(generated.equations.roads, Ground())
    for name in ("evaluate", "report", *(("constraint_residual", "project") if generated.equations.equation_names else ())):
        _compare(name, generated.program, transposed, inputs, roads, share)


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
    name: str, program: Program, transposed: Transposed, inputs: dict[str, np.ndarray], roads: dict[str, Ground], share: float
) -> None:  # fmt: skip
    draw, results = np.random.default_rng(1), program.function(name).results
    ways = {
        symbol: (0.1 * numbers if symbol == "parameters" else 1.0) * draw.normal(size=len(numbers))
        for symbol, numbers in inputs.items() if symbol == "parameters" or symbol.startswith(("q:", "v:", "vdot:", "lambda:", "gap:"))
    }  # fmt: skip

    def value(way: float) -> float:
        moved = {symbol: numbers + way * 1e-4 * ways.get(symbol, 0.0) for symbol, numbers in inputs.items()}
        found = interpret_scalars(program.graph, [r.scalar for r in results], moved, roads)  # type: ignore[arg-type]
        return sum(inputs[f"by_{r.target}"][r.index] * found[r.scalar] for r in results)

    slopes = partial(_slopes, transposed, inputs, roads)
    ends = [value(way) for way in (-2, -1, 1, 2)]
    by_loaded, along = np.zeros(transposed.loaded), 0.0
    for function in (f.name for f in transposed.program.functions if f.name in (f"{name}_transposed", f"{name}_summed")):
        for (symbol, index), slope in slopes(function).items():
            if symbol == "loaded":
                by_loaded[index] += slope
            elif symbol in ways:
                along += slope * ways[symbol][index]
    for (symbol, index), slope in slopes("load_transposed", by_loaded=by_loaded).items():
        along += slope * ways[symbol][index]
    assert along == pytest.approx((ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / 12e-4, rel=share)


def _slopes(
    transposed: Transposed, inputs: dict[str, np.ndarray], roads: dict[str, Ground], function: str, **more: np.ndarray
) -> dict[tuple[str, int], float]:  # fmt: skip
    results = transposed.program.function(function).results
    found = interpret_scalars(transposed.program.graph, [r.scalar for r in results], {**inputs, **more}, roads)  # type: ignore[arg-type]
    return {(r.target.removeprefix("by_"), r.index): found[r.scalar] for r in results}
