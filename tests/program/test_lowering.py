"""Lowering keeps values: the scalar program of a model gives what its blocks give, and its stages can be run in turn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.formulate.inputs import INPUTS, LAW_TIME, LAW_VALUES
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Output, Scene, Tyre
from cutjoint.ops import OPERATIONS
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.records import Program
from cutjoint.program.schedule import schedule
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.random_models import NOWHERE, scene
from tests.oracles.dense import Array, Instant, Numerics
from tests.oracles.evaluation import BlockMechanism, both
from tests.oracles.scalars import interpret_scalars
from tests.oracles.tyre import Flat

MODELS = Path(__file__).parents[2] / "models"
NUMERICS = Numerics(penalty=1e3, damping_ratio=0.7, frequency=5.0)

RANDOM = {
    **{f"tree-{seed}": (random_models.random_tree, seed) for seed in range(4)},
    **{f"loops-{seed}": (random_models.random_loops, seed) for seed in range(6)},
    **{f"chosen-{seed}": (random_models.chosen_loops, seed) for seed in range(2)},
}


def body_outputs(model: Model) -> tuple[Output, ...]:
    quantities = ("x", "vy", "az", "wx", "roll", "pitch", "yaw")
    return tuple(Output(element=b.name, quantity=q, span=NOWHERE) for b in model.bodies for q in quantities)


class Tried:
    """A model at a random state: its program, and the inputs, blocks and values of every result."""

    def __init__(self, model: Model, chosen: Scene, seed: int, spread: float) -> None:
        roads = {f.name: Flat() for f in model.forces if isinstance(f, Tyre)}
        blocks, dense = both(build_topology(model), chosen, outputs=body_outputs(model), roads=roads)
        rng = np.random.default_rng(seed)
        q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
        if spread:
            q = np.zeros(dense.nq)
            for x in dense.layout.values():
                if x.ball:
                    q[x.q + x.scalars] = 1.0
            q = dense.retract(q, spread * rng.standard_normal(dense.nv))
        at, multipliers = Instant(q=q, v=v, t=0.37), 10 * rng.standard_normal(dense.m)
        self.blocks: BlockMechanism = blocks
        self.roads = roads
        self.condition = dense.solve(at, multipliers, NUMERICS).condition
        self.inputs = blocks.inputs(at, multipliers, NUMERICS, rng.standard_normal(dense.nv), rng.standard_normal(dense.m))
        self.inputs[LAW_TIME] = np.array([at.t])
        functions = blocks.equations.functions
        self.program: Program = schedule(blocks.equations.builder, [(f.name, f.results) for f in functions])
        results = [b for f in functions for b in f.results.values()]
        self.values = interpret_blocks(results, self.inputs, roads)

    def expected(self, function: str) -> Array:
        """The function's scalars in the order of its results, from the blocks."""
        return np.concatenate([np.zeros(0), *(self.values[b][:, 0] for b in self.blocks.results(function).values())])


@pytest.fixture(scope="module", params=[*RANDOM, "iltis", "four_bar"])
def tried(request: pytest.FixtureRequest) -> Tried:
    if request.param == "iltis":
        model = read_model(MODELS / "iltis.yaml")
        return Tried(model, model.scenes["simul1s"], 0, 0.02)
    if request.param == "four_bar":
        model = read_model(MODELS / "four_bar.yaml")
        return Tried(model, model.scenes["swing"], 0, 0.3)
    generate, seed = RANDOM[request.param]
    return Tried(generate(seed), scene(), seed, 0.0)


def largest(x: Array) -> float:
    return float(np.max(np.abs(x), initial=0.0))


@pytest.mark.parametrize("function", ["evaluate", "constraint_residual", "report", "project"])
def test_scalars_give_what_blocks_give(tried: Tried, function: str) -> None:
    """Both eliminate without pivoting, in another order of operations: they differ by rounding times the system's condition."""
    lowered = tried.program.function(function)
    assert [(r.target, r.index) for r in lowered.results] == [
        (name, i) for name, block in tried.blocks.results(function).items() for i in range(block.shape[0])
    ]
    values = interpret_scalars(tried.program.graph, [r.scalar for r in lowered.results], tried.inputs, tried.roads)
    found, expected = np.array([values[r.scalar] for r in lowered.results]), tried.expected(function)
    bound = 1e-12 if function in ("constraint_residual", "report") else 1e-12 + 50 * np.finfo(float).eps * tried.condition
    assert largest(found - expected) <= bound * max(largest(expected), 1.0)


def test_stages_run_in_turn(tried: Tried) -> None:
    """Loading needs parameters, the beginning of a step these and time, a function what was kept and its own statements."""
    program, graph = tried.program, tried.program.graph
    known = {n: node.data for n, node in enumerate(graph.nodes) if node.op == "const"}
    run(tried, program.loaded, known, {"parameters", "numerics"})
    run(tried, program.stepped, known, {"t", "motion", INPUTS, LAW_VALUES})
    kept = {n: value for n, value in known.items() if n in program.stored or graph.nodes[n].op == "const"}
    for n, node in enumerate(graph.nodes):  # the negation of what is kept is written out where it is read
        if node.op == "neg" and node.args[0] in kept:
            kept[n] = -kept[node.args[0]]
    for function in program.functions:
        values = dict(kept)
        run(tried, function.statements, values, set(tried.inputs) - {"parameters", "numerics", "t", "motion", INPUTS, LAW_VALUES})
        direct = interpret_scalars(graph, [r.scalar for r in function.results], tried.inputs, tried.roads)
        assert [values[r.scalar] for r in function.results] == [direct[r.scalar] for r in function.results]


def run(tried: Tried, statements: tuple[int, ...], values: dict[int, float], symbols: set[str]) -> None:
    """Evaluate statements in order from what is known; a symbol must be one of those that the stage may read."""
    for n in statements:
        node = tried.program.graph.nodes[n]
        if node.op == "symbol":
            name, index = node.data
            assert name in symbols
            values[n] = float(tried.inputs[name][index])
        elif node.op in ("road_height", "road_slope"):
            road = tried.roads[node.data]
            look_up = road.height if node.op == "road_height" else road.slope
            values[n] = look_up(*(values[a] for a in node.args))
        else:
            with np.errstate(all="ignore"):
                values[n] = float(OPERATIONS[node.op].numpy(*(values[a] for a in node.args)))


def test_a_node_is_known_no_earlier_than_its_arguments(tried: Tried) -> None:
    nodes = tried.program.graph.nodes
    assert all(nodes[a].binding <= node.binding for node in nodes for a in node.args)
    assert all(a < n for n, node in enumerate(nodes) for a in node.args)


def test_equal_nodes_are_one(tried: Tried) -> None:
    keys = [(node.op, node.args, node.data) for node in tried.program.graph.nodes]
    assert len(set(keys)) == len(keys)


def test_lowering_depends_on_the_model_alone() -> None:
    """Two derivations of one model give equal programs."""
    model = random_models.random_loops(1)
    programs = []
    for _ in range(2):
        blocks, _ = both(build_topology(model), scene())
        programs.append(schedule(blocks.equations.builder, [(f.name, f.results) for f in blocks.equations.functions]))
    first, second = programs
    assert [(n.op, n.args, n.data) for n in first.graph.nodes] == [(n.op, n.args, n.data) for n in second.graph.nodes]
    assert first.functions == second.functions
