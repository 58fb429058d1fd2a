"""Laws of mechanics that the accelerations keep: momentum, energy, d'Alembert's constraints, and that no place is special.

Momenta, energy and their rates are the dense oracle's; the accelerations are the formulation's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy
from scipy.spatial.transform import Rotation

from cutjoint.elements.joints import JOINTS
from cutjoint.model.records import GROUND, Bushing, JointForce, Model, PointSpring
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.random_models import K, scene, variable, workshop
from tests.oracles.dense import Array, DenseMechanism, Instant, Motion, Numerics
from tests.oracles.evaluation import BlockMechanism, both

NUMERICS = Numerics(penalty=1e4, damping_ratio=1.0, frequency=10.0)
#: Seeds of loops without guides whose mechanisms keep some freedom.
MOBILE = (1, 3, 5, 7, 9, 11, 13, 15)


def mechanisms(model: Model) -> tuple[BlockMechanism, DenseMechanism]:
    return both(build_topology(model), scene())


def momentum_rates(dense: DenseMechanism, motion: Motion, vdot: Array) -> tuple[Array, Array, float]:
    """Rates of linear and angular momentum about the origin, and the largest part of either."""
    linear, angular, largest = np.zeros(3), np.zeros(3), 0.0
    for body in dense.model.bodies:
        mass, centre, own = dense.inertia_of(body)
        x, J, _, drift = motion.point(body.name, centre)
        W, w, w_drift = motion.spin(body.name)
        inertia = motion.R[body.name] @ own @ motion.R[body.name].T
        force = mass * (J @ vdot + drift)
        moment = np.cross(x, force) + inertia @ (W @ vdot + w_drift) + np.cross(w, inertia @ w)
        linear, angular = linear + force, angular + moment
        largest = np.max([largest, *np.abs(force), *np.abs(moment)])
    return linear, angular, largest


@pytest.mark.parametrize("seed", range(8))
def test_momentum_of_free_bodies_stays(seed: int) -> None:
    """Springs, joint forces and cut joints act within, on either body by the same wrench, whether or not the loops are closed."""
    blocks, dense = mechanisms(random_models.floating_loops(seed))
    rng = np.random.default_rng(seed)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    at = Instant(q=q, v=v, t=0.4)
    vdot = blocks.solve(at, 10 * rng.standard_normal(dense.m), NUMERICS).vdot
    linear, angular, largest = momentum_rates(dense, dense.motion(at), vdot)
    assert np.abs(linear).max() < 1e-10 * largest
    assert np.abs(angular).max() < 1e-10 * largest


def consistent(dense: DenseMechanism, rng: np.random.Generator) -> tuple[Instant, Array]:
    """A state near the design position that closes the loops, by Newton's method with least-norm steps; and the Jacobian there."""
    q = np.zeros(dense.nq)
    for x in dense.layout.values():
        if x.ball:
            q[x.q + x.scalars] = 1.0
    q = dense.retract(q, 0.2 * rng.standard_normal(dense.nv))
    v = rng.standard_normal(dense.nv)
    for _ in range(30):
        c = dense.closures(Instant(q=q, v=v))
        if np.abs(c.residual).max(initial=0.0) < 1e-13:
            break
        q = dense.retract(q, -np.linalg.pinv(c.jacobian, rcond=1e-6) @ c.residual)
    c = dense.closures(Instant(q=q, v=v))
    v = v - np.linalg.pinv(c.jacobian, rcond=1e-6) @ (c.jacobian @ v)
    at = Instant(q=q, v=v)
    closed = dense.closures(at)
    assert np.abs([*closed.residual, *closed.rate]).max() < 1e-11
    assert np.abs(v).max() > 0.1
    return at, closed.jacobian


def kinetic_energy(dense: DenseMechanism, at: Instant) -> float:
    motion, energy = dense.motion(at), 0.0
    for body in dense.model.bodies:
        mass, centre, own = dense.inertia_of(body)
        velocity, w = motion.point(body.name, centre)[2], motion.R[body.name].T @ motion.spin(body.name)[1]
        energy += (mass * velocity @ velocity + w @ own @ w) / 2
    return energy


def energy_rate(dense: DenseMechanism, at: Instant, vdot: Array, step: float = 1e-3) -> float:
    """The kinetic energy's rate along the motion, by differences of sixth order."""
    nodes = []
    for n in (1, 2, 3):
        after, before = (
            kinetic_energy(dense, Instant(q=dense.retract(at.q, h * at.v + h**2 / 2 * vdot), v=at.v + h * vdot))
            for h in (n * step, -n * step)
        )
        nodes.append(after - before)
    return (45 * nodes[0] - 9 * nodes[1] + nodes[2]) / (60 * step)


def stored(dense: DenseMechanism, at: Instant, stiffness: float) -> float:
    """The energy in a point spring of free length 0.5, a joint spring, a joint stop at 0.1 and a bushing."""
    spring, joint_spring, joint_stop, mount = dense.model.forces
    poses = dense.poses(at.q, at.t)
    q = at.q[dense.layout[joint_spring.joint].q + dense.coordinate(joint_spring)]
    depth = max(at.q[dense.layout[joint_stop.joint].q + dense.coordinate(joint_stop)] - 0.1, 0.0)
    weights = np.arange(1, 7)
    place = dense.bushing_place(mount, poses)
    return stiffness / 2 * float((dense.length(spring, poses) - 0.5) ** 2 + q**2 + depth**2 + weights @ place**2)


@pytest.mark.parametrize("seed", range(4))
def test_springs_and_bushings_keep_energy(seed: int) -> None:
    """Bodies gain what springs lose, at any angles.  The seeds' states have the stop met and free."""
    w = workshop(seed, "springs", gravity=False)
    w.grow(w.grow(w.grow(GROUND, K.CYLINDRICAL), K.UNIVERSAL), K.SPHERICAL)
    stiffness, position = 40, variable("position")
    common = {"active": True, "span": random_models.NOWHERE}
    axes = tuple(tuple(row) for row in np.linalg.qr(w.rng.standard_normal((3, 3)))[0] * 1.0)
    axes = (axes[0], axes[1], tuple(np.cross(axes[0], axes[1])))
    w.forces += [
        PointSpring(
            name="spring", base="body_0", follower="body_2", start=w.point(), end=w.point(),
            law=stiffness * (variable("length") - sympy.Float(0.5)), **common,
        ),
        JointForce(name="joint_spring", joint=w.joints[0].name, coordinate="angle", unit="rad", law=-stiffness * position, **common),
        JointForce(
            name="stop", joint=w.joints[1].name, coordinate="angle_2", unit="rad", **common,
            law=sympy.Piecewise((stiffness * (sympy.Float(0.1) - position), position > sympy.Float(0.1)), (0, True)),
        ),
        Bushing(
            name="mount", base="body_1", follower="body_2", point=w.point(), axes=axes, **common,
            laws=tuple(-stiffness * (k + 1) * position for k in range(6)),
        ),
    ]  # fmt: skip
    blocks, dense = mechanisms(w.model())
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, np.random.default_rng(seed))
    at = Instant(q=q, v=v)
    vdot = blocks.solve(at, np.zeros(0), NUMERICS).vdot
    h = 1e-5
    after, before = (stored(dense, Instant(q=dense.retract(q, s * h * v), v=v), stiffness) for s in (1, -1))
    gained, lost = energy_rate(dense, at, vdot), (before - after) / (2 * h)
    assert gained == pytest.approx(lost, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("seed", MOBILE)
def test_energy_changes_by_the_power_of_the_forces(seed: int) -> None:
    """Closed loops do no work, whatever their multipliers are."""
    blocks, dense = mechanisms(random_models.random_loops(seed))
    rng = np.random.default_rng(seed)
    at, _ = consistent(dense, rng)
    vdot = blocks.solve(at, 10 * rng.standard_normal(dense.m), NUMERICS).vdot
    motion = dense.motion(at)
    gravity = dense.vector(dense.model.gravity)
    weights = [dense.inertia_of(b)[0] * gravity @ motion.point(b.name, dense.inertia_of(b)[1])[2] for b in dense.model.bodies]
    powers = [*weights, *(dense.applied(at, motion) * at.v)]
    scale = sum(map(abs, powers)) + kinetic_energy(dense, at) * np.abs(vdot).max()
    assert energy_rate(dense, at, vdot) == pytest.approx(sum(powers), abs=1e-8 * scale)


@pytest.mark.parametrize("seed", MOBILE)
def test_augmented_update_ends_at_the_constrained_motion(seed: int) -> None:
    """Repeated corrections lead to accelerations that keep the loops closed and differ from free ones by constraint forces only."""
    blocks, dense = mechanisms(random_models.random_loops(seed))
    rng = np.random.default_rng(seed)
    at, J = consistent(dense, rng)
    stiff = replace(NUMERICS, penalty=1e6)
    multipliers = np.zeros(dense.m)
    for _ in range(30):
        solution = blocks.solve(at, multipliers, stiff)
        multipliers = multipliers + solution.correction
    vdot = blocks.solve(at, multipliers, stiff).vdot
    motion = dense.motion(at)
    M, bias = dense.inertia(motion)
    scale = np.abs(J.T @ multipliers).max() + np.abs(bias).max()
    assert np.abs(J @ vdot + dense.closures(at).drift).max() < 1e-7 * (1 + np.abs(vdot).max())
    unbalanced = M @ vdot + bias - dense.applied(at, motion) + J.T @ multipliers
    assert np.abs(unbalanced).max() < 1e-7 * scale


@pytest.mark.parametrize("seed", range(4))
def test_distance_driven_costs_no_digit(seed: int) -> None:
    """The pole travels with a free root: ten kilometres away the accelerations are the same numbers."""
    blocks, dense = mechanisms(random_models.floating_loops(seed, roots=1))
    rng = np.random.default_rng(seed)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    multipliers = 10 * rng.standard_normal(dense.m)
    root = dense.layout["joint_0"]
    far = q.copy()
    far[root.q : root.q + 2] += 1e4
    near_solution, far_solution = (blocks.solve(Instant(q=x, v=v), multipliers, NUMERICS) for x in (q, far))
    np.testing.assert_array_equal(far_solution.vdot, near_solution.vdot)
    np.testing.assert_array_equal(far_solution.correction, near_solution.correction)


@pytest.mark.parametrize("seed", range(4))
def test_turned_world_turns_nothing_within(seed: int) -> None:
    """Turning a floating mechanism as a whole leaves the accelerations in its joints as they are."""
    blocks, dense = mechanisms(random_models.floating_loops(seed, roots=1))
    rng = np.random.default_rng(seed)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    root = dense.layout["joint_0"]
    turned, speeds = q.copy(), v.copy()
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    attitude = Rotation.from_matrix(turn) * Rotation.from_quat(np.roll(q[root.q + 3 : root.q + 7], -1))
    turned[root.q + 3 : root.q + 7] = np.roll(attitude.as_quat(), 1)
    turned[root.q : root.q + 3] = turn @ q[root.q : root.q + 3]
    speeds[root.v : root.v + 3], speeds[root.v + 3 : root.v + 6] = turn @ v[root.v : root.v + 3], turn @ v[root.v + 3 : root.v + 6]
    none = np.zeros(dense.m)
    before, after = (blocks.solve(Instant(q=x, v=u), none, NUMERICS).vdot for x, u in ((q, v), (turned, speeds)))
    expected = before.copy()
    for part in (slice(root.v, root.v + 3), slice(root.v + 3, root.v + 6)):
        expected[part] = turn @ before[part]
    np.testing.assert_allclose(after, expected, rtol=0, atol=1e-10 * np.abs(before).max())


def bodies_motion(dense: DenseMechanism, motion: Motion) -> tuple[Array, Array, Array]:
    """Jacobian, velocity and drift of the centres of mass and of the angular velocities of all bodies, in a column."""
    parts = []
    for body in dense.model.bodies:
        _, J, velocity, drift = motion.point(body.name, dense.vector(body.centre_of_mass))
        parts += [(J, velocity, drift), motion.spin(body.name)]
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


@pytest.mark.parametrize("kind", [k for k in JOINTS if k not in (K.FREE, K.DISTANCE)])
def test_motion_does_not_depend_on_the_root(kind: str) -> None:
    """Two bodies on one joint move alike whichever of them the tree begins with; the joint is reversed in one of the trees."""
    w = workshop(0, f"root {kind}")
    one, other = w.body(), w.body()
    w.joint(K.FREE, GROUND, one)
    w.joint(kind, one, other)
    for _ in range(2):
        w.point_spring()
        w.axial_force()
        w.load()
    model = w.model()
    free, joint = model.joints
    swapped = replace(model, joints=(replace(free, follower=other), joint))
    (blocks, dense), (blocks_2, dense_2) = mechanisms(model), mechanisms(swapped)
    assert [t.reversed for t in dense_2.topology.tree] == [False, True]
    rng, none = np.random.default_rng(0), np.zeros(0)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    R, p = dense.poses(q, 0.0)[other]
    at = dense.vector(free.at)
    quaternion = np.roll(Rotation.from_matrix(R).as_quat(), 1)
    q_2 = np.concatenate([p + R @ at - at, quaternion, q[7:]])
    if JOINTS[kind].has_ball:
        q_2[-3:] *= -1
    motion, motion_2 = dense.motion(Instant(q=q, v=v)), dense_2.motion(Instant(q=q_2, v=0 * v))
    _, velocity, _ = bodies_motion(dense, motion)
    J_2 = bodies_motion(dense_2, motion_2)[0]
    v_2 = np.linalg.lstsq(J_2, velocity, rcond=None)[0]
    assert np.abs(J_2 @ v_2 - velocity).max() < 1e-12
    accelerations = []
    for mechanism, oracle, state in ((blocks, dense, Instant(q=q, v=v)), (blocks_2, dense_2, Instant(q=q_2, v=v_2))):
        J, _, drift = bodies_motion(oracle, oracle.motion(state))
        accelerations.append(J @ mechanism.solve(state, none, NUMERICS).vdot + drift)
    np.testing.assert_allclose(accelerations[1], accelerations[0], rtol=0, atol=1e-10 * np.abs(accelerations[0]).max())
    if dense.layout.get(joint.name) and not dense.layout[joint.name].ball:
        np.testing.assert_allclose(v_2[6:], v[6:], rtol=0, atol=1e-11)
