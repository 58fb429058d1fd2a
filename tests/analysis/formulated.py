"""Formulated models, and the dense oracle's view of their loops."""

from __future__ import annotations

import numpy as np

from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology
from tests.oracles.dense import Array, Closures, DenseMechanism, Instant


def formulated(model: Model | str) -> RecursiveEquations:
    """The equations of a model, or of its text, in its first scene."""
    if isinstance(model, str):
        model = read_model_text(model, "model.yaml")
    return formulate_recursive(build_topology(model), find_scene(model, next(iter(model.scenes), None)), ())


def dense_closures(equations: RecursiveEquations, q: Array) -> Closures:
    """Residual and Jacobian by the oracle, guides standing still."""
    dense = DenseMechanism(equations.topology, equations.scene)
    return dense.closures(Instant(q=q, v=np.zeros(dense.nv), motion=0.0))
