"""Linearisations by interpretation, without a compiled simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cutjoint.analysis.linearisation import Linearisation
from cutjoint.analysis.linearise import Point, linearise
from cutjoint.analysis.natural import call
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.implicit.records import ImplicitEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.run.scenes import find_scene
from cutjoint.sparse.pattern import make_pattern
from cutjoint.sparse.tangent import places
from cutjoint.topology.build import build_topology

Array = np.ndarray


def implicit(model: Model | str, scene: Scene | None = None) -> ImplicitEquations:
    """The equations, with a place for each entry of their tangent."""
    if isinstance(model, str):
        model = read_model_text(model, "model.yaml")
    scene = scene or find_scene(model, next(iter(model.scenes), None))
    equations = formulate_implicit(formulate_recursive(build_topology(model), scene, ()), ())
    names = [name for name in equations.function("linearise").results if name.startswith("tangent:")]
    entries = [tuple(map(int, name.removeprefix("tangent:").split(","))) for name in names]
    return equations.with_tangent(places(make_pattern(equations.start.speeds, entries, symmetric=False)))


def evaluator(equations: ImplicitEquations) -> Any:
    """What `linearise` asks for, in the interpreter."""

    def arrays(point: Mapping[str, Any]) -> dict[str, Array]:
        given = {name: np.atleast_1d(np.asarray(value, float)) for name, value in point.items() if name != "weights"}
        turns = np.tile(np.eye(3).ravel(), sum(c.ball for c in equations.start.charts))
        weights = np.array([point["weights"][name] for name in ("damping", "stiffness", "constraint")])
        parameters = np.array([p.value for p in equations.parameters])
        return {**given, "weights": weights, "weights.turns": turns, "parameters": parameters}

    def evaluate(points: Sequence[Point]) -> list[dict[str, Array]]:
        results = []
        for at in map(arrays, points):
            n, m = equations.start.speeds, len(equations.equation_names)
            pulled = call(equations, "apply_jacobian_transposed", at)["force"] if m else np.zeros(n)
            rate = call(equations, "constraint_residual", at)["rate"] if m else np.zeros(0)
            balance = call(equations, "dynamic_residual", at)["force_residual"]
            tangent = call(equations, "linearise", at)["tangent"]
            results.append({"tangent": tangent, "force": pulled, "rate": rate, "force_residual": balance})
        return results

    return evaluate


def linearised(equations: ImplicitEquations, q: Array, v: Array, *, at_rest: bool) -> Linearisation:
    """About coordinates and speeds that close the loops, with the accelerations and multipliers that belong to them."""
    evaluate, n, m = evaluator(equations), equations.start.speeds, len(equations.equation_names)
    state = {"t": 0.0, "q": q, "v": v, "vdot": np.zeros(n), "lambda": np.zeros(m)}
    of = linearise(equations, state, evaluate, at_rest=at_rest)
    moving = {**state, "motion": 0.0 if at_rest else 1.0, "penalty": 0.0}
    arrays = {name: np.atleast_1d(np.asarray(x, float)) for name, x in moving.items()}
    arrays["parameters"] = np.array([p.value for p in equations.parameters])
    bias = call(equations, "dynamic_residual", arrays)["force_residual"]
    drift = call(equations, "constraint_residual", arrays)["curvature"] if m else np.zeros(0)
    saddle = np.block([[of.M, of.J.T], [of.J, np.zeros((m, m))]])
    solution = np.linalg.lstsq(saddle, -np.concatenate([bias, drift]), rcond=1e-12)[0]
    return linearise(equations, {**state, "vdot": solution[:n], "lambda": solution[n:]}, evaluate, at_rest=at_rest)
