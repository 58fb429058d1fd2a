"""Implicit rules of order 4 and 5 on the flyball governor, counted: what rules are chosen by.  Run it as `make stiff`.

The governor is a tree with four coordinates, so that its accelerations are a function of (q, v), which the interpreter of the block IR
evaluates for a Rosenbrock rule; `radau5` is the simulator's.  Evaluations do not count the differences of Jacobians.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from rich.console import Console
from rich.table import Table

from cutjoint.analysis.closing import design_coordinates, make_inputs
from cutjoint.compile.derivation import derive
from cutjoint.compile.pipeline import compile_model
from cutjoint.model.read import read_model
from cutjoint.program.interpret import Array, interpret_blocks
from cutjoint.run.simulation import simulate
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.problems import PROBLEMS
from cutjoint_bench.studies.provenance import provenance

#: Of the slider at the start, m.
HEIGHT = 0.5
TOLERANCES = (1e-3, 1e-4, 1e-5)
Rate = Callable[[Array], Array]


@dataclass
class Counted:
    """Work of a rule: ``steps`` that counted, ``evaluations`` of the rate, ``jacobians``, ``factorisations`` (a complex one is another)."""

    steps: int = 0
    evaluations: int = 0
    jacobians: int = 0
    factorisations: int = 0


def governor() -> tuple[Rate, Array, int]:
    """The rate of (q, v), columns side by side, the start, and where the slider's height is."""
    model = read_model(MODELS / "flyball.yaml")
    scene = model.scenes["govern"]
    equations = derive(model, scene, scene.outputs)
    blocks = [b for name, b in equations.function("evaluate").results.items() if name.startswith("vdot:")]
    n, v = equations.coordinates, np.zeros(equations.speeds)
    start = make_inputs(equations, design_coordinates(equations), v)
    names, speeds = equations.coordinate_names, equations.speed_names
    v[speeds.index("bearing.angle_rate")] = 2 * np.pi

    def rate(y: Array) -> Array:
        inputs = {**start, **make_inputs(equations, y[..., :n], y[..., n:])}
        inputs |= {"t": np.zeros((*y.shape[:-1], 1)), "motion": np.ones((*y.shape[:-1], 1))}
        values = interpret_blocks(blocks, inputs, {})
        return np.concatenate([y[..., n:], *(values[b][..., 0] for b in blocks)], axis=-1)

    return rate, np.concatenate([design_coordinates(equations), v]), names.index("slide.displacement")


def jacobian(rate: Rate, y: Array) -> Array:
    """By central differences, all columns at once."""
    h = 1e-6 * np.maximum(np.abs(y), 1e-2)
    moves = np.diag(h)
    found: Array = ((rate(y + moves) - rate(y - moves)) / (2 * h[:, None])).T
    return found


#: RODAS4, order 4(3), L-stable and stiffly accurate, for autonomous equations.  Source: Hairer, Wanner, Solving Ordinary Differential
#: Equations II (1996), section IV.7, and their program.  The last stage stands where the sum of those before is, and is the estimate.
GAMMA = 0.25
_FIFTH = (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950)
A = (
    (), (1.544,), (0.9466785280815826, 0.2557011698983284), (3.314825187068521, 2.896124015972201, 0.9986419139977817), _FIFTH,
    (*_FIFTH, 1.0),
)  # fmt: skip
C = (
    (), (-5.6688,), (-2.430093356833875, -0.2063599157091915), (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
    (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
)  # fmt: skip


def rosenbrock(rate: Rate, y: Array, times: Array, tolerance: float) -> tuple[Array, Counted]:
    """States at times, at which steps end, and the effort."""
    counted, states, h = Counted(), [y], 1e-4
    identity = np.eye(y.size)
    for t, until in pairwise(times):
        while until - t > 1e-12:
            h = min(h, until - t)
            J = jacobian(rate, y)
            counted.jacobians += 1
            while True:
                after, error = rosenbrock_step(rate, y, h, np.linalg.inv(identity / (GAMMA * h) - J))
                counted.factorisations += 1
                counted.evaluations += len(A)
                size = float(np.abs(error / (tolerance + tolerance * np.abs(y))).max())
                if size <= 1:
                    break
                h *= max(0.2, 0.9 * size**-0.25)
            t, y = t + h, after
            counted.steps += 1
            h *= min(5.0, 0.9 * max(size, 1e-8) ** -0.25)
        states.append(y)
    return np.array(states), counted


def rosenbrock_step(rate: Rate, y: Array, h: float, solve: Array) -> tuple[Array, Array]:
    """The state after a step and the estimate of its error."""
    g: list[Array] = []
    for a, c in zip(A, C, strict=True):
        at, pull = (y + sum((x * u for x, u in zip(row, g, strict=True)), np.zeros_like(y)) for row in (a, c))
        g.append(solve @ (rate(at) + (pull - y) / h))
    return at + g[-1], g[-1]


def main() -> None:
    """Print the table."""
    rate, start, slide = governor()
    problem = next(p for p in PROBLEMS if p.name == "A05")
    artifact = compile_model(MODELS / "flyball.yaml", method="recursive-newton")
    times = np.linspace(0, artifact.scene.end, 101)
    exact = problem.exact(times)[:, 0]
    table = Table("rule", "tolerance", "steps", "evaluations", "Jacobians", "factorisations", "largest error, m")

    def add(name: str, tolerance: float, took: Counted, error: float) -> None:
        counts = (took.steps, took.evaluations, took.jacobians, took.factorisations)
        table.add_row(name, f"{tolerance:g}", *map(str, counts), f"{error:.1e}")

    for tolerance in TOLERANCES:
        run = simulate(artifact, integrator="radau5", tolerance=tolerance)
        renewed = run.statistics.factorisations
        error = np.abs(np.interp(times, run.t, run["slider.z"]) - exact).max()
        add("radau5", tolerance, Counted(run.steps, run.evaluations, renewed, renewed), error)
        states, took = rosenbrock(rate, start, times, tolerance)
        add("RODAS4", tolerance, took, np.abs(states[:, slide] + HEIGHT - exact).max())
    console = Console(highlight=False, width=140)
    console.print(provenance(), markup=False)
    console.print(table)


if __name__ == "__main__":
    main()
