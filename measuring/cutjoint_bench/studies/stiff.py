"""Implicit rules of order 4 and 5 on the flyball governor, counted: what `sdirk4` was chosen by.  Run it as `make stiff`.

The governor is a tree with four coordinates, so that its accelerations are a function of (q, v), which the interpreter of the block IR
evaluates for SciPy's Radau IIA and for a Rosenbrock rule; `sdirk4` is the simulator's.  Evaluations do not count the differences of
Jacobians.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

from cutjoint.analysis.closing import design_coordinates, make_inputs
from cutjoint.compile.pipeline import compile_model, derive
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
    """Work of a rule: ``steps`` that counted, ``evaluations`` of the rate, ``jacobians``, ``factorisations`` (a complex one is four)."""

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


#: Shampine's parameters of the rule of Kaps and Rentrop, order 4(3), of whose four stages two share an evaluation.
#: Source: ACM Transactions on Mathematical Software 8 (1982) 93-113.
GAMMA = 0.5
A = ((), (2.0,), (48 / 25, 6 / 25))
C = ((), (-8.0,), (372 / 25, 12 / 5), (-112 / 125, -54 / 125, -2 / 5))
B, E = (19 / 9, 1 / 2, 25 / 108, 125 / 108), (17 / 54, 7 / 36, 0.0, 125 / 108)


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
                counted.evaluations += 3
                size = float(np.abs(error / (tolerance + tolerance * np.abs(y))).max())
                if size <= 1:
                    break
                h *= max(0.2, 0.9 * size ** (-1 / 3))
            t, y = t + h, after
            counted.steps += 1
            h *= min(5.0, 0.9 * max(size, 1e-8) ** -0.25)
        states.append(y)
    return np.array(states), counted


def rosenbrock_step(rate: Rate, y: Array, h: float, solve: Array) -> tuple[Array, Array]:
    """The state after a step and the estimate of its error."""
    g: list[Array] = []
    for i in range(4):
        if i < 3:
            f = rate(y + sum((a * x for a, x in zip(A[i], g, strict=True)), np.zeros_like(y)))
        g.append(solve @ (f + sum((c / h * x for c, x in zip(C[i], g, strict=True)), np.zeros_like(y))))
    return y + sum(b * x for b, x in zip(B, g, strict=True)), np.asarray(sum(e * x for e, x in zip(E, g, strict=True)))


def radau(rate: Rate, y: Array, times: Array, tolerance: float) -> tuple[Array, Counted]:
    """Radau IIA of SciPy, whose steps do not end at the times; each of its factorisations is a real and a complex one."""
    found = solve_ivp(lambda _, x: rate(x), (times[0], times[-1]), y, "Radau", dense_output=True, rtol=tolerance, atol=tolerance,
                      jac=lambda _, x: jacobian(rate, x), first_step=1e-4)  # fmt: skip
    took = Counted(steps=found.t.size - 1, evaluations=found.nfev, jacobians=found.njev, factorisations=5 * found.nlu // 2)
    return found.sol(times).T, took


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
        run = simulate(artifact, integrator="sdirk4", tolerance=tolerance)
        renewed = run.effort.factorisations
        error = np.abs(np.interp(times, run.t, run["slider.z"]) - exact).max()
        add("sdirk4", tolerance, Counted(run.steps, run.evaluations, renewed, renewed), error)
        for name, rule in (("Rosenbrock 4(3)", rosenbrock), ("Radau IIA, order 5", radau)):
            states, took = rule(rate, start, times, tolerance)
            add(name, tolerance, took, np.abs(states[:, slide] + HEIGHT - exact).max())
    console = Console(highlight=False, width=140)
    console.print(provenance(), markup=False)
    console.print(table)


if __name__ == "__main__":
    main()
