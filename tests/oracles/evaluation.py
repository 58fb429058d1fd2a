"""The formulation under test, evaluated from its blocks, in the dense oracle's terms."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cutjoint.analysis.closing import evaluate_scene_inputs
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.records import Output, Scene
from cutjoint.program.blocks import Block
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.records import Topology
from tests.oracles.dense import Array, DenseMechanism, Instant, Numerics, Solution
from tests.oracles.tyre import Flat


class BlockMechanism:
    """The recursive formulation of a model in a scene; blocks are interpreted, nothing is lowered."""

    def __init__(
        self, topology: Topology, scene: Scene, *, outputs: tuple[Output, ...] = (),
        parameters: Mapping[str, float] | None = None, roads: Mapping[str, Flat] | None = None, closure: str = "penalty",
    ) -> None:  # fmt: skip
        self.equations: RecursiveEquations = formulate_recursive(topology, scene, outputs, closure=closure)
        self.roads = roads or {}
        given = parameters or {}
        self.parameters = np.array([given.get(p.name, p.value) for p in self.equations.parameters])

    def results(self, function: str) -> Mapping[str, Block]:
        """The result blocks of a function."""
        return next(f.results for f in self.equations.functions if f.name == function)

    def inputs(
        self, at: Instant, multipliers: Array, numerics: Numerics, vdot: Array | None = None, gap: Array | None = None
    ) -> dict[str, Array]:  # fmt: skip
        """The columns of the program's inputs by symbol name."""
        columns = {
            **evaluate_scene_inputs(self.equations, self.parameters, at.t),
            "t": np.array([at.t]), "motion": np.array([at.motion]), "parameters": self.parameters,
            "numerics": np.array([numerics.penalty, numerics.damping_ratio, numerics.frequency]),
            "penalties": np.full(max(len(self.equations.closures), 1), numerics.penalty),
        }  # fmt: skip
        for chart in self.equations.charts:
            v = slice(chart.v, chart.v + len(chart.speed_names))
            columns[f"q:{chart.joint}"] = at.q[chart.q : chart.q + chart.scalars + 4 * chart.ball]
            columns[f"v:{chart.joint}"] = at.v[v]
            if vdot is not None:
                columns[f"vdot:{chart.joint}"] = vdot[v]
        for closure in self.equations.closures:
            rows = slice(closure.first, closure.first + len(closure.names))
            columns[f"lambda:{closure.joint}"] = multipliers[rows]
            if gap is not None:
                columns[f"violation:{closure.joint}"] = gap[rows]
        return columns

    def solve(self, at: Instant, multipliers: Array, numerics: Numerics) -> Solution:
        """Accelerations, correction, residual and rate."""
        results = {**self.results("evaluate"), **self.results("constraint_residual")}
        values = interpret_blocks(results.values(), self.inputs(at, multipliers, numerics), self.roads)

        def column(quantity: str, names: list[str]) -> Array:
            return np.concatenate([np.zeros(0), *(values[results[f"{quantity}:{name}"]].ravel() for name in names)])

        closures = [c.joint for c in self.equations.closures]
        return Solution(
            vdot=column("vdot", [c.joint for c in self.equations.charts]), correction=column("correction", closures),
            residual=column("residual", closures), rate=column("rate", closures), condition=np.nan,
        )  # fmt: skip

    def project(self, at: Instant, gap: Array, numerics: Numerics) -> Array:
        """The step that closes a gap of the cut joints."""
        results = self.results("project")
        values = interpret_blocks(results.values(), self.inputs(at, np.zeros(len(gap)), numerics, gap=gap), self.roads)
        return np.concatenate([np.zeros(0), *(values[results[f"dz:{c.joint}"]].ravel() for c in self.equations.charts)])

    def report(self, at: Instant, vdot: Array, multipliers: Array, numerics: Numerics) -> dict[str, float]:
        """The reported quantities by column name."""
        results = self.results("report")
        values = interpret_blocks(results.values(), self.inputs(at, multipliers, numerics, vdot), self.roads)
        return {name.removeprefix("column:"): float(values[block][0, 0]) for name, block in results.items()}

    def energy(self, at: Instant, vdot: Array, multipliers: Array, numerics: Numerics) -> dict[str, float]:
        """Kinetic energy and power by name."""
        results = self.results("energy")
        values = interpret_blocks(results.values(), self.inputs(at, multipliers, numerics, vdot), self.roads)
        return {name.removeprefix("energy:"): float(values[block][0, 0]) for name, block in results.items()}


def both(
    topology: Topology, scene: Scene, *, outputs: tuple[Output, ...] = (), parameters: Mapping[str, float] | None = None,
    roads: Mapping[str, Flat] | None = None, closure: str = "penalty",
) -> tuple[BlockMechanism, DenseMechanism]:  # fmt: skip
    """The formulation and the oracle of one model, which agree in the layout of q, v and the equations."""
    blocks = BlockMechanism(topology, scene, outputs=outputs, parameters=parameters, roads=roads, closure=closure)
    dense = DenseMechanism(topology, scene, parameters=parameters, roads=roads, axes=blocks.equations.axes)
    charts = {c.joint: (c.q, c.v, c.scalars, c.ball) for c in blocks.equations.charts}
    assert charts == {name: (x.q, x.v, x.scalars, x.ball) for name, x in dense.layout.items()}
    closures = {c.joint: (c.first, len(c.names)) for c in blocks.equations.closures}
    assert closures == {name: (x.start, x.stop - x.start) for name, x in dense.equations.items()}
    return blocks, dense
