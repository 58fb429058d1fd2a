"""Trees against Pinocchio's articulated-body algorithm: both are O(N) recursions in double precision, so they agree to rounding.

Pinocchio lacks joints whose motions share a coordinate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy

from cutjoint.elements.joints import JOINTS
from cutjoint.model.records import BodyLoad, JointForce, JointKind, Model
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.random_models import NOWHERE, TREE_KINDS, scene
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import both
from tests.oracles.pinocchio_tree import PinocchioTree

PARAMETERS = {"size": 1.3}
NONE = Numerics(penalty=1.0, damping_ratio=1.0, frequency=1.0)


def with_wrenches(model: Model, rng: np.random.Generator) -> Model:
    """The model's joint forces, and on every body a force and a torque that the body carries along."""
    loads = []
    for body in model.bodies:
        for point in (tuple(sympy.Float(x) for x in rng.standard_normal(3)), None):
            kind = "torque" if point is None else "force"
            loads.append(
                BodyLoad(
                    name=f"{kind}_on_{body.name}", body=body.name, point=point, axes="body",
                    components=tuple(sympy.Float(x) for x in 5 * rng.standard_normal(3)), moving_only=False, active=True,
                    span=NOWHERE,
                )
            )  # fmt: skip
    return replace(model, forces=(*(f for f in model.forces if isinstance(f, JointForce)), *loads))


def compare(plain: Model, seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = with_wrenches(plain, rng)
    blocks, dense = both(build_topology(model), scene(), parameters=PARAMETERS)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    at = Instant(q=q, v=v)
    wrenches = {
        b.name: (dense.vector(load.point), dense.vector(load.components), dense.vector(torque.components))
        for b in model.bodies
        for load in model.forces if isinstance(load, BodyLoad) and load.name == f"force_on_{b.name}"
        for torque in model.forces if isinstance(torque, BodyLoad) and torque.name == f"torque_on_{b.name}"
    }  # fmt: skip
    joint_forces = np.zeros(dense.nv)
    for force in model.forces:
        if isinstance(force, JointForce):
            x, i = dense.layout[force.joint], dense.coordinate(force)
            joint_forces[x.v + i] += dense.law(force.law, "position rate", (q[x.q + i], v[x.v + i]), 0.0)
    expected = PinocchioTree(dense).accelerations(at, joint_forces, wrenches)
    found = blocks.solve(at, np.zeros(0), NONE).vdot
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("direction", ["normal", "reversed"])
@pytest.mark.parametrize("kind", [kind for kind in TREE_KINDS if not JOINTS[kind].shares_coordinates])
def test_tree_joint(kind: JointKind, direction: str) -> None:
    compare(random_models.tree_with(kind, direction == "reversed", 3), 3)


@pytest.mark.parametrize("seed", range(20, 32))
def test_random_tree(seed: int) -> None:
    compare(random_models.random_tree(seed, guides=False), seed)
