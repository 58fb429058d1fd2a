"""Linearisations by interpretation, without a compiled simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cutjoint.analysis.linearise import Linearisation, Point, linearise
from cutjoint.analysis.natural import call
from cutjoint.formulate.implicit.equations import ImplicitEquations, formulate_implicit
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology

Array = np.ndarray


def implicit(model: Model | str, scene: Scene | None = None) -> ImplicitEquations:
    """The equations of a model in a scene, the first otherwise."""
    if isinstance(model, str):
        model = read_model_text(model, "model.yaml")
    scene = scene or find_scene(model, next(iter(model.scenes), None))
    return formulate_implicit(formulate_recursive(build_topology(model), scene, ()), ())


def linearised(equations: ImplicitEquations, q: Array, v: Array, *, at_rest: bool) -> Linearisation:
    """About coordinates and speeds that close the loops, with the accelerations that belong to them."""
    n, m = equations.start.speeds, len(equations.equation_names)
    at = Point(t=0.0, q=q, v=v, vdot=np.zeros(n), parameters=np.array([p.value for p in equations.parameters]))
    of = linearise(equations, at, at_rest=at_rest)
    arrays = {"q": q, "v": v, "motion": np.full(1, 0.0 if at_rest else 1.0), "penalty": np.zeros(1)}
    bias = call(equations, "dynamic_residual", arrays)["force_residual"]
    drift = call(equations, "constraint_residual", arrays)["curvature"] if m else np.zeros(0)
    saddle = np.block([[of.M, of.J.T], [of.J, np.zeros((m, m))]])
    solution = np.linalg.lstsq(saddle, -np.concatenate([bias, drift]), rcond=1e-12)[0]
    return linearise(equations, replace(at, vdot=solution[:n]), at_rest=at_rest)
