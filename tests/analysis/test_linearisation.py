"""Linearised equations against differences of the dense oracle's accelerations, which share no code with the tangent."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.analysis.closing import close_loops, evaluate_closures, evaluate_guided_rates, explore, retract
from cutjoint.analysis.linearise import Linearisation, NoMassError, ReducedSystem, _balancing, reduce_system
from cutjoint.formulate.implicit.equations import ImplicitEquations
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.read import read_model
from cutjoint.run.scenes import find_scene
from tests.analysis.linearised import Array, implicit, linearised
from tests.conftest import MODELS, with_heavy
from tests.mechanisms import random_models
from tests.mechanisms.random_models import K
from tests.oracles.dense import DenseMechanism, Instant

#: Central differences of fourth order.
WEIGHTS = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
#: Small enough that no law of the random models goes over to another formula on the way.
H = 1e-4


def moving(start: RecursiveEquations, q: Array, seed: int) -> Array:
    """Random speeds that keep the loops closed, guides moving."""
    _, J = evaluate_closures(start, q)
    v = np.random.default_rng(seed).standard_normal(start.speeds)
    return np.asarray(v - np.linalg.lstsq(J, J @ v + evaluate_guided_rates(start, q, 0.0), rcond=1e-9)[0]) if len(J) else v


def displaced(start: RecursiveEquations, q: Array, v: Array, dz: Array, dw: Array, of: Linearisation, N: Array) -> tuple[Array, Array]:
    """A pose that closes the loops beside q, displaced by N dz to first order, and speeds that keep them closed, with w changed by dw."""
    found = close_loops(start, retract(start, q, N @ dz))
    assert found is not None
    pose, J = found
    rate = J @ v + evaluate_guided_rates(start, pose, 0.0)
    right = np.concatenate([-rate, dw])
    return pose, np.asarray(v + np.linalg.lstsq(np.vstack([J, N.T @ of.M]), right, rcond=1e-9)[0])


def change(start: RecursiveEquations, q: Array, beside: Array) -> Array:
    """x of beside = q (+) x, to first order: of a quaternion, twice the vector of the turn from one to the other."""
    x = np.zeros(start.speeds)
    for c in start.charts:
        ball = c.q + c.scalars
        x[c.v : c.v + c.scalars] = beside[c.q : ball] - q[c.q : ball]
        if c.ball:
            (s, *a), (r, *b) = q[ball : ball + 4], beside[ball : ball + 4]
            x[c.v + c.scalars : c.v + c.scalars + 3] = 2 * (s * np.array(b) - r * np.array(a) - np.cross(b, a))
    return x


def tangent(dense: DenseMechanism, start: RecursiveEquations, q: Array, v: Array, pose: Array, speeds: Array, N: Array, M: Array) -> Array:
    """The rates of (z, w): that of z by following both motions for a moment, that of w from the accelerations."""
    tau = 1e-4
    ahead, behind = (change(start, retract(start, q, s * tau * v), retract(start, pose, s * tau * speeds)) for s in (1, -1))
    vdot = dense.solve_exactly(Instant(q=pose, v=speeds))[0]
    return np.concatenate([N.T @ M @ (ahead - behind) / (2 * tau), N.T @ M @ vdot])


def verify(equations: ImplicitEquations, seed: int) -> ReducedSystem:
    start = equations.start
    q = explore(start)[-1].q
    v = moving(start, q, seed)
    of = linearised(equations, q, v, at_rest=False)
    system, dense = reduce_system(of), DenseMechanism(equations.topology, equations.scene)
    N, n = system.basis, system.basis.shape[1]
    assert pytest.approx(np.eye(n), abs=1e-9) == N.T @ of.M @ N
    assert pytest.approx(np.zeros((len(of.J), n)), abs=1e-8 * np.abs(N).max()) == of.J @ N
    columns = []
    for e in np.eye(2 * n):
        size = H / np.abs(N @ e[:n]).max() if e[:n].any() else H / np.abs(N @ e[n:]).max()
        beside = [displaced(start, q, v, k * size * e[:n], k * size * e[n:], of, N) for k in WEIGHTS]
        rates = [tangent(dense, start, q, v, *at, N, of.M) for at in beside]
        columns.append(sum(w * r for w, r in zip(WEIGHTS.values(), rates, strict=True)) / size)
    expected = np.array(columns).T
    assert system.first_order[:n] == pytest.approx(expected[:n], abs=1e-7 * np.abs(expected[:n]).max())
    assert system.first_order[n:] == pytest.approx(expected[n:], abs=1e-7 * np.abs(expected[n:]).max())
    return system


@pytest.mark.parametrize("kind", with_heavy([K.SPHERICAL, K.FREE], K.FREE))
def test_trees_in_motion(kind: K) -> None:
    """Turning balls, springs and dampers of all kinds."""
    verify(implicit(random_models.tree_with(kind, False, 3), random_models.scene()), 1)


@pytest.mark.parametrize("seed", with_heavy([1, 7], 1))
def test_loops_in_motion(seed: int) -> None:
    """Nested and coupled loops with balls, guides, massless links, and equations that follow from others."""
    verify(implicit(random_models.random_loops(seed), random_models.scene()), seed)


CUTS = (("branch", K.SPHERICAL), ("floating", K.UNIVERSAL), ("guided", K.SPHERICAL))


@pytest.mark.parametrize(("closing", "kind"), with_heavy(CUTS, ("floating", K.UNIVERSAL)))
def test_cut_joints_in_motion(closing: str, kind: K) -> None:
    """Within a branch, between free bodies, between guided bodies."""
    verify(implicit(random_models.loop_with(kind, closing, 5), random_models.scene()), 2)


@pytest.mark.heavy
def test_vehicle_in_motion() -> None:
    """Tyres that slip and roll, on a flat road."""
    model = read_model(MODELS / "iltis.yaml")
    verify(implicit(model, find_scene(model, "simul1s")), 4)


def test_what_moves_no_mass_is_named() -> None:
    of = Linearisation(
        names=("a.angle", "b.angle"), M=np.diag([1.0, 0.0]), C=np.zeros((2, 2)), K=np.eye(2), W=np.zeros((2, 2)),
        J=np.zeros((0, 2)), G=np.zeros((0, 2)), q=np.zeros(2), at_rest=True,
    )  # fmt: skip
    with pytest.raises(NoMassError, match=r"'b\.angle' can move without moving a mass"):
        reduce_system(of)


def test_equations_that_a_pose_makes_redundant_but_for_its_gap_have_small_multipliers() -> None:
    """Of a loop that is closed to 1e-12 m, a direction that moves freely is one that the equations seem to hold by as much."""
    rng = np.random.default_rng(3)
    held, gap = rng.standard_normal((4, 6)), 1e-12 * rng.standard_normal((2, 6))
    J = np.concatenate([held, held[:2] + held[2:] + gap])
    exact = np.concatenate([held, held[:2] + held[2:]])
    force = exact.T @ rng.standard_normal(6) + 1e-9 * rng.standard_normal(6)
    np.testing.assert_allclose(_balancing(J, -force), np.linalg.pinv(exact.T, rcond=1e-6) @ force, atol=1e-6)
