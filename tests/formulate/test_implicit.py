"""The balance in relative coordinates against the recursion, which solves the same equations another way, and its tangent against
differences.

Multipliers of a vector equation, whose components stand in fixed axes, turn with nothing; the tangent lets them turn with what carries all
bodies of their loop.  The two differ by forces of the equations themselves, Phi_q^T times something, which the multipliers take up.  So
tangents are compared in the directions that the equations leave free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from cutjoint.analysis.closing import design_coordinates, retract
from cutjoint.analysis.natural import call
from cutjoint.formulate.implicit.equations import ImplicitEquations, formulate_implicit
from cutjoint.formulate.records import IndicatorPlace
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Scene
from cutjoint.program.interpret import interpret_blocks
from cutjoint.run.scenes import find_scene
from cutjoint.sparse.pattern import dense as full
from cutjoint.sparse.pattern import make_pattern, places
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS
from tests.formulate.test_natural import Hills
from tests.mechanisms import random_models
from tests.mechanisms.random_models import CLOSINGS, CUT_KINDS, TREE_KINDS, K
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import BlockMechanism

Array = np.ndarray
TIME_NOW = 0.37
DAMPING, STIFFNESS = 0.3, 0.2


@dataclass(frozen=True)
class System:
    """A system with the pattern of its tangent."""

    equations: ImplicitEquations
    roads: dict[str, Hills]

    def __getattr__(self, name: str) -> object:
        return getattr(self.equations.start, name)

    @property
    def n(self) -> int:
        return self.equations.start.speeds

    @property
    def m(self) -> int:
        return len(self.equations.equation_names)

    def call(self, function: str, **arrays: Array) -> dict[str, Array]:
        now = {
            "t": np.array([TIME_NOW]), "motion": np.array([1.0]), "penalty": np.array([0.0]),
            "parameters": np.array([p.value for p in self.equations.parameters]),
        }  # fmt: skip
        return call(self.equations, function, {**now, **arrays}, self.roads)

    def tangent(self, **arrays: Array) -> Array:
        found = self.equations.function("linearise").results
        entries = [tuple(map(int, name.removeprefix("tangent:").split(","))) for name in found if name.startswith("tangent:")]
        pattern = make_pattern(self.n, entries, symmetric=False)
        placed = System(self.equations.with_tangent(places(pattern)), self.roads)
        return full(pattern, placed.call("linearise", **arrays)["tangent"])

    def jacobian(self, q: Array) -> Array:
        if self.m == 0:
            return np.zeros((0, self.n))
        return np.broadcast_to(self.call("apply_jacobian_transposed", q=q, w=np.eye(self.m))["force"], (self.m, self.n))


def make_system(model: Model, scene: Scene) -> System:
    start = formulate_recursive(build_topology(model), scene, ())
    return System(formulate_implicit(start, ()), {name: Hills() for name in start.roads})


def moved(system: System, q: Array, delta: Array) -> Array:
    return retract(system.equations.start, np.broadcast_to(q, (*delta.shape[:-1], len(q))), delta)


def turns(system: System, delta: Array) -> Array:
    """As the runtime's ``ball_tangents``, from differences of the turn that belongs to a rotation vector."""
    found = []
    for c in system.equations.start.charts:
        if c.ball:
            theta = delta[c.v + c.scalars : c.v + c.scalars + 3]
            columns = [cayley(theta + h) @ cayley(theta - h).T for h in 1e-6 * np.eye(3)]
            found.append(np.array([[w[2, 1] - w[1, 2], w[0, 2] - w[2, 0], w[1, 0] - w[0, 1]] for w in columns]).T.ravel() / 4e-6)
    return np.concatenate([np.zeros(0), *found])


def cayley(theta: Array) -> Array:
    half = np.cross(np.eye(3), theta / 2)
    return np.linalg.solve(np.eye(3) - half, np.eye(3) + half)


def state(system: System, seed: int, moves: float = 0.3) -> dict[str, Array]:
    rng = np.random.default_rng(seed)
    return {
        "q": moved(system, design_coordinates(system.equations.start), moves * rng.standard_normal(system.n)),
        "delta": moves * rng.standard_normal(system.n), "v": rng.standard_normal(system.n), "vdot": rng.standard_normal(system.n),
        "lambda": 10 * rng.standard_normal(system.m),
    }  # fmt: skip


def balance(system: System, at: dict[str, Array], x: Array) -> Array:
    """The balance where the step's unknown differs by x."""
    pose = moved(system, at["q"], at["delta"] + STIFFNESS * x)
    arrays = {"q": pose, "v": at["v"] + DAMPING * x, "vdot": at["vdot"] + x, "lambda": at["lambda"]}
    return system.call("dynamic_residual", **arrays)["force_residual"]


def differences(system: System, at: dict[str, Array]) -> Array:
    """The tangent by differences of fourth order."""
    h = 1e-3
    up, down, far_up, far_down = balance(system, at, h * np.multiply.outer([1, -1, 2, -2], np.eye(system.n)))
    return np.asarray((8 * (up - down) - (far_up - far_down)).T / (12 * h))


def verify_tangent(system: System, seed: int, moves: float = 0.3) -> int:
    """The number of directions compared, where coordinates are about so far from the design."""
    at = state(system, seed, moves)
    pose = moved(system, at["q"], at["delta"])
    found = system.tangent(
        q=pose, v=at["v"], vdot=at["vdot"], weights=np.array([DAMPING, STIFFNESS, 0.0]),
        **{"lambda": at["lambda"], "weights.ball_tangents": turns(system, at["delta"])},
    )  # fmt: skip
    expected = differences(system, at)
    J = system.jacobian(pose)
    free = np.linalg.svd(J)[2][np.linalg.matrix_rank(J, tol=1e-9) :] if system.m else np.eye(system.n)
    assert free @ found == pytest.approx(free @ expected, abs=3e-8 * np.abs(expected).max())
    return len(free)


@pytest.mark.parametrize("is_reversed", [False, True])
@pytest.mark.parametrize("kind", TREE_KINDS)
def test_tangent_of_trees(kind: K, is_reversed: bool) -> None:
    """Every kind of joint, seen from either end."""
    system = make_system(random_models.tree_with(kind, is_reversed, 3), random_models.scene())
    assert verify_tangent(system, 1) == system.n > 0


@pytest.mark.parametrize("seed", range(6))
def test_tangent_of_random_trees(seed: int) -> None:
    """Branches, guides, forces of all kinds."""
    system = make_system(random_models.random_tree(seed), random_models.scene())
    assert verify_tangent(system, seed) == system.n


@pytest.mark.parametrize("closing", CLOSINGS)
@pytest.mark.parametrize("kind", CUT_KINDS)
def test_tangent_of_loops(kind: K, closing: str) -> None:
    """Every kind of cut joint, within a branch, between roots, to a parent, between guided bodies."""
    verify_tangent(make_system(random_models.loop_with(kind, closing, 5), random_models.scene()), 2)


@pytest.mark.parametrize("closing", CLOSINGS)
def test_penalty_of_loops(closing: str) -> None:
    """constraint J^T J, by the rates of the residual at unit speeds; roots that float have poles of their own."""
    for model in (random_models.loop_with(K.SPHERICAL, closing, 5), random_models.loop_with(K.REVOLUTE, closing, 6)):
        system = make_system(model, random_models.scene())
        at = state(system, 2)
        pose, tangents = moved(system, at["q"], at["delta"]), turns(system, at["delta"])
        arrays = {"q": pose, "v": at["v"], "vdot": at["vdot"], "lambda": at["lambda"], "weights.ball_tangents": tangents}
        with_penalty, without = (system.tangent(weights=np.array([0.0, 0.0, w]), **arrays) for w in (3.0, 0.0))
        rest, *rates = (system.call("constraint_residual", q=pose, v=v)["rate"] for v in (np.zeros(system.n), *np.eye(system.n)))
        J, T, balls = np.array(rates).T - rest[:, np.newaxis], np.eye(system.n), iter(tangents.reshape(-1, 3, 3))
        for c in system.equations.start.charts:
            if c.ball:
                T[c.v + c.scalars : c.v + c.scalars + 3, c.v + c.scalars : c.v + c.scalars + 3] = next(balls)
        assert np.abs(J).max() > 0.1
        assert with_penalty - without == pytest.approx(3 * J.T @ J @ T, abs=1e-9 * np.abs(J).max() ** 2)


@pytest.mark.parametrize("seed", range(6))
def test_tangent_of_random_loops(seed: int) -> None:
    """Nested and coupled loops, massless links."""
    verify_tangent(make_system(random_models.random_loops(seed), random_models.scene()), seed)


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_tangent_with_gears(seed: int, bent: bool) -> None:
    """Gears in trees and beside loops."""
    for model in (random_models.random_tree(seed), random_models.random_loops(seed)):
        verify_tangent(make_system(random_models.with_gears(model, seed, bent=bent), random_models.scene()), seed)


@pytest.mark.parametrize("seed", range(3))
def test_tangent_with_contacts(seed: int) -> None:
    """Normals of cylinders turn with the way to the ball."""
    for model in (random_models.random_tree(seed), random_models.random_loops(seed)):
        verify_tangent(make_system(random_models.with_contacts(model, seed), random_models.scene()), seed)


@pytest.mark.parametrize("seed", range(3))
def test_tangent_with_ball_springs(seed: int) -> None:
    """Rotation vectors of any length up to half a turn."""
    for model in (random_models.random_tree(seed), random_models.random_loops(seed)):
        verify_tangent(make_system(random_models.with_ball_springs(model, seed), random_models.scene()), seed)


@pytest.mark.parametrize(("name", "scene"), [("iltis", "simul1s"), ("slider_crank", None), ("flyball", None)])
def test_tangent_of_models(name: str, scene: str | None) -> None:
    """The vehicle on hills, with tyres and bumpers."""
    model = read_model(MODELS / f"{name}.yaml")
    assert verify_tangent(make_system(model, find_scene(model, scene)), 4) > 0


@pytest.mark.parametrize("seed", range(4))
def test_balance_vanishes_where_the_recursion_says(seed: int) -> None:
    """Accelerations and multipliers of the recursion leave no balance, and no Phidd."""
    model, scene = random_models.random_loops(seed), random_models.scene()
    system = make_system(model, scene)
    at = state(system, seed)
    J, zero = system.jacobian(at["q"]), np.zeros(system.n)
    M = system.tangent(
        q=at["q"], v=at["v"], vdot=zero, weights=np.zeros(3), **{"lambda": np.zeros(system.m), "weights.ball_tangents": turns(system, zero)}
    )
    bias = system.call("dynamic_residual", q=at["q"], v=at["v"], vdot=zero, **{"lambda": np.zeros(system.m)})["force_residual"]
    drift = system.call("constraint_residual", q=at["q"], v=at["v"], vdot=zero)["curvature"]
    saddle = np.block([[M, J.T], [J, np.zeros((system.m, system.m))]])
    solution = np.linalg.lstsq(saddle, -np.concatenate([bias, drift]), rcond=1e-12)[0]
    vdot, multipliers = solution[: system.n], solution[system.n :]
    oracle = BlockMechanism(build_topology(model), scene, outputs=(), roads=system.roads, parameters=None)
    exact, guess = Numerics(penalty=1e4, damping_ratio=0.0, frequency=0.0), np.zeros(system.m)
    for _ in range(60):
        found = oracle.solve(Instant(q=at["q"], v=at["v"], t=TIME_NOW), guess, exact)
        guess = guess + found.correction
    assert vdot == pytest.approx(found.vdot, rel=1e-6, abs=1e-6 * np.abs(found.vdot).max())
    assert system.call("dynamic_residual", q=at["q"], v=at["v"], vdot=vdot, **{"lambda": multipliers})["force_residual"] == pytest.approx(
        zero, abs=1e-8 * np.abs(bias).max()
    )


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "iltis"])
def test_stretch_and_pull_are_one_matrix(name: str) -> None:
    """Phi_q x and Phi_q^T w, and Phi itself by differences along the loops' speeds where the loops are closed."""
    model = read_model(MODELS / f"{name}.yaml")
    system = make_system(model, find_scene(model, next(iter(model.scenes))))
    q = design_coordinates(system.equations.start)
    J = system.jacobian(q)
    stretched = system.call("apply_jacobian", q=q, vdot=np.eye(system.n))["change"]
    assert pytest.approx(J, abs=1e-12) == np.broadcast_to(stretched, (system.n, system.m)).T
    zero, h = np.zeros(system.n), 1e-5
    for e in np.eye(system.n):
        near, back = (system.call("constraint_residual", q=moved(system, q, s * h * e), v=zero, vdot=zero)["residual"] for s in (1, -1))
        assert (near - back) / (2 * h) == pytest.approx(J @ e, abs=1e-7)


def test_newton_converges_quadratically() -> None:
    """Of the trapezoidal rule's equations with their multipliers as unknowns, on the slider-crank at a long step: each error is of the
    order of the square of the last."""
    model = read_model(MODELS / "slider_crank.yaml")
    system = make_system(model, find_scene(model, None))
    dt, n, m = 0.2, system.n, system.m
    q = design_coordinates(system.equations.start)
    free = np.linalg.svd(system.jacobian(q))[2][-1]
    at = {"q": q, "v": 6 * free / np.abs(free).max(), "vdot": np.zeros(n)}
    x, multipliers, iterates = np.zeros(n), np.zeros(m), []
    for _ in range(8):
        delta = dt * at["v"] + dt**2 / 4 * (at["vdot"] + x)
        pose, v = moved(system, at["q"], delta), at["v"] + dt / 2 * (at["vdot"] + x)
        balance = system.call("dynamic_residual", q=pose, v=v, vdot=x, **{"lambda": multipliers})
        T = system.tangent(q=pose, v=v, vdot=x, weights=np.array([dt / 2, dt**2 / 4, 0.0]), **{
            "lambda": multipliers, "weights.ball_tangents": turns(system, delta),
        })  # fmt: skip
        J = system.jacobian(pose)
        saddle = np.block([[T, J.T], [J, np.zeros((m, m))]])
        right = -np.concatenate([balance["force_residual"], balance["residual"] / (dt**2 / 4)])
        step = np.linalg.lstsq(saddle, right, rcond=1e-13)[0]
        x, multipliers = x + step[:n], multipliers + step[n:]
        iterates.append(x)
    errors = [float(np.abs(i - iterates[-1]).max()) for i in iterates[:5]]
    orders = [np.log(c / b) / np.log(b / a) for a, b, c in zip(errors, errors[1:], errors[2:], strict=False) if c > 1e-11]
    assert errors[0] > 1e-3
    assert len(orders) >= 2, errors
    assert all(order > 1.7 for order in orders), errors


def test_events_are_those_of_the_recursion() -> None:
    """Both have equal places in the model, and equal values in any state, though found in other blocks."""
    model = read_model(MODELS / "iltis.yaml")
    scene = find_scene(model, "simul1s")
    system = make_system(model, scene)
    oracle = BlockMechanism(build_topology(model), scene, outputs=(), roads=system.roads, parameters=None)
    rng = np.random.default_rng(1)
    q = moved(system, design_coordinates(system.equations.start), 0.1 * rng.standard_normal(system.n))
    v = rng.standard_normal(system.n)
    results = oracle.results("events")
    inputs = oracle.inputs(Instant(q=q, v=v, t=TIME_NOW), np.zeros(system.m), Numerics(penalty=1.0, damping_ratio=1.0, frequency=1.0))
    values = interpret_blocks(results.values(), inputs, oracle.roads)
    expected = [values[results[f"value:{i}"]].item() for i in range(len(results))]
    found = np.ravel(system.call("events", q=q, v=v)["value"])

    def named(places: Sequence[IndicatorPlace], values: Sequence[float]) -> list[tuple[str, str, str, float]]:
        return sorted((s.element, s.place, s.road, float(x)) for s, x in zip(places, values, strict=True))

    one, other = named(oracle.equations.indicators, expected), named(system.equations.indicators, found.tolist())
    assert [x[:3] for x in one] == [x[:3] for x in other]
    assert [x[3] for x in one] == pytest.approx([x[3] for x in other], rel=1e-9, abs=1e-9)
