"""Kinetic energy and power: against numerical derivatives of the dense oracle's energy, and formulation against formulation."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from cutjoint.analysis.natural import call
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.model.records import JointKind, Model, Tyre
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.random_models import GUIDABLE, TIME, TREE_KINDS, scene, workshop
from tests.oracles.dense import Array, DenseMechanism, Instant, Numerics
from tests.oracles.evaluation import BlockMechanism, both
from tests.oracles.tyre import Flat

EXACT = Numerics(penalty=1e5, damping_ratio=0.0, frequency=0.0)
SCENE = scene({"drive": 0.1 + sympy.sin(2 * TIME) / 5})
NOW = 0.37


def energy_of(dense: DenseMechanism, at: Instant) -> float:
    motion, energy = dense.motion(at), 0.0
    for body in dense.model.bodies:
        mass, centre, own = dense.inertia_of(body)
        velocity, w = motion.point(body.name, centre)[2], motion.R[body.name].T @ motion.spin(body.name)[1]
        energy += (mass * velocity @ velocity + w @ own @ w) / 2
    return energy


def rate_of_energy(dense: DenseMechanism, at: Instant, vdot: Array) -> float:
    """The rate of energy along the motion, guides included, by differences of sixth order with steps that change speeds little."""
    rate, step = 0.0, 1e-3 / max(1.0, np.abs(vdot).max() / 10)
    for n, weight in ((1, 45), (2, -9), (3, 1)):
        for h in (n * step, -n * step):
            moved = Instant(q=dense.retract(at.q, h * at.v + h**2 / 2 * vdot), v=at.v + h * vdot, t=at.t + h)
            rate += np.sign(h) * weight * energy_of(dense, moved) / (60 * step)
    return rate


def closed(dense: DenseMechanism, q: Array, v: Array) -> Instant:
    """The nearest state at the present time that closes the loops, with speeds that keep them closed."""
    for _ in range(40):
        c = dense.closures(Instant(q=q, v=v, t=NOW))
        q = dense.retract(q, -np.linalg.pinv(c.jacobian, rcond=1e-8) @ c.residual)
    c = dense.closures(Instant(q=q, v=v, t=NOW))
    v = v - np.linalg.pinv(c.jacobian, rcond=1e-8) @ c.rate
    assert np.abs(dense.closures(Instant(q=q, v=v, t=NOW)).residual).max(initial=0.0) < 1e-10
    return Instant(q=q, v=v, t=NOW)


def solved(blocks: BlockMechanism, at: Instant) -> tuple[Array, Array]:
    """Accelerations and multipliers, the augmented iteration carried to its end."""
    multipliers = np.zeros(len(blocks.equations.equation_names))
    for _ in range(100):
        solution = blocks.solve(at, multipliers, EXACT)
        multipliers = multipliers + solution.correction
    return solution.vdot, multipliers


def verify(model: Model, seed: int, spread: float = 0.5) -> float:
    """Energy and power of both formulations in relative coordinates are those of the oracle; the power is returned."""
    roads = {f.name: Flat() for f in model.forces if isinstance(f, Tyre)}
    blocks, dense = both(build_topology(model), SCENE, roads=roads)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, np.random.default_rng(seed))
    at = closed(dense, q if not dense.m else dense.retract(design(dense), spread * v), v)
    vdot, multipliers = solved(blocks, at)
    expected = (energy_of(dense, at), rate_of_energy(dense, at, vdot))
    arrays = {"q": at.q, "v": at.v, "vdot": vdot, "lambda": multipliers, "t": np.array([at.t]), "motion": np.ones(1)}
    system = formulate_implicit(blocks.equations, ())
    for found in (list(blocks.energy(at, vdot, multipliers, EXACT).values()), call(system, "energy", arrays, roads)["energy"]):
        assert found[0] == pytest.approx(expected[0], rel=1e-11)
        assert found[1] == pytest.approx(expected[1], rel=1e-6, abs=1e-8 * max(1.0, np.abs(at.v).max() * np.abs(vdot).max()))
    return expected[1]


def design(dense: DenseMechanism) -> Array:
    """The coordinates of the design position."""
    q = np.zeros(dense.nq)
    for x in dense.layout.values():
        if x.ball:
            q[x.q + x.scalars] = 1.0
    return q


@pytest.mark.parametrize("kind", TREE_KINDS)
def test_trees(kind: JointKind) -> None:
    """Each kind of joint under weight, springs, dampers, loads, bushings and forces on its coordinates."""
    for seed, is_reversed in enumerate((False, True)):
        assert abs(verify(random_models.tree_with(kind, is_reversed, seed), seed)) > 1e-3


@pytest.mark.parametrize("kind", GUIDABLE)
def test_guided_joints(kind: JointKind) -> None:
    """Energy that a guide brings in, with another guide and free joints before and behind it."""
    w = workshop(0, f"guided {kind}")
    w.grow(w.guided(w.guided(w.grow("ground"), kind), kind))
    w.load_all()
    verify(w.model(), 0)


@pytest.mark.parametrize("seed", [1, 3, 4, 6])
def test_loops(seed: int) -> None:
    """Guides in loops too, of even seeds; multipliers carry their share."""
    verify(random_models.random_loops(seed), seed, spread=0.1)


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_gears(seed: int, bent: bool) -> None:
    """Teeth at guided joints too."""
    verify(random_models.with_gears(random_models.random_tree(seed), seed, bent=bent), seed)
