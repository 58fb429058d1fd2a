"""The closures "proximal" and "solved" against the exact solution of the constrained equations, which has no penalty and takes singular
values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Scene, Tyre
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology
from tests.formulate.test_against_dense import PARAMETERS, SCENE, Slope, near_design, relative_error
from tests.mechanisms import random_models
from tests.mechanisms.random_models import K
from tests.oracles.dense import Array, DenseMechanism, Instant, Numerics
from tests.oracles.evaluation import BlockMechanism, both

MODELS = Path(__file__).parents[2] / "models"

#: About 1e5 times the masses that the cut joints feel: leaves eleven digits to rounding, and a share of 1e-10 of what multipliers are off.
LIGHT = {"four_bar": 3e4, "slider_crank": 1e5, "iltis": 1e6}


def numerics(penalty: float) -> Numerics:
    return Numerics(penalty=penalty, damping_ratio=1.0, frequency=10.0)


def closed(dense: DenseMechanism, rng: np.random.Generator) -> Instant:
    """A state near the design position that closes the loops, with speeds that keep them closed."""
    q, t = near_design(dense, rng, 0.05), 0.3

    def across(rows: Array, jacobian: Array) -> Array:
        return np.linalg.pinv(jacobian, rcond=1e-9) @ rows

    for _ in range(20):
        c = dense.closures(Instant(q=q, v=np.zeros(dense.nv), t=t))
        q = dense.retract(q, -across(c.residual, c.jacobian))
    v = 0.5 * rng.standard_normal(dense.nv)
    c = dense.closures(Instant(q=q, v=v, t=t))
    return Instant(q=q, v=v - across(c.rate, c.jacobian), t=t)


def in_scene(name: str, closure: str) -> tuple[BlockMechanism, DenseMechanism]:
    model = read_model(MODELS / f"{name}.yaml")
    scene: Scene = find_scene(model, {"iltis": "simul1", "four_bar": "swing"}.get(name))
    roads = {f.name: Slope() for f in model.forces if isinstance(f, Tyre)}
    return both(build_topology(model), scene, roads=roads, closure=closure)


def errors(blocks: BlockMechanism, dense: DenseMechanism, at: Instant, penalty: float, evaluations: int) -> list[float]:
    """The errors of the accelerations by evaluations that correct the multipliers, none known to begin with."""
    exact, multipliers, found = dense.solve_exactly(at)[0], np.zeros(dense.m), []
    for _ in range(evaluations):
        solution = blocks.solve(at, multipliers, numerics(penalty))
        multipliers = multipliers + solution.correction
        found.append(relative_error(solution.vdot, exact, 1.0))
    return found


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", LIGHT)
def test_accelerations_are_those_without_a_penalty(name: str, seed: int) -> None:
    """From no multipliers to 1e-7, then to 1e-10.

    Equations of the four-bar and the Iltis depend on each other, links of the latter have no mass.
    """
    blocks, dense = in_scene(name, "proximal")
    cold, warm = errors(blocks, dense, closed(dense, np.random.default_rng(seed)), LIGHT[name], 2)
    assert cold < 1e-7
    assert warm < 1e-10


@pytest.mark.parametrize("name", LIGHT)
def test_multipliers_balance_the_forces(name: str) -> None:
    blocks, dense = in_scene(name, "proximal")
    at, multipliers = closed(dense, np.random.default_rng(0)), np.zeros(dense.m)
    for _ in range(2):
        multipliers = multipliers + blocks.solve(at, multipliers, numerics(LIGHT[name])).correction
    pull = dense.closures(at).jacobian.T @ multipliers
    assert relative_error(pull, dense.solve_exactly(at)[1], 1.0) < 1e-9


@pytest.mark.parametrize("name", LIGHT)
def test_one_evaluation_solves_for_the_multipliers(name: str) -> None:
    """From no multipliers to 1e-10 at once; of equations that depend on each other it finds the smallest multipliers.

    All penalties are the same here, so that none weighs more than another.
    """
    blocks, dense = in_scene(name, "solved")
    at = closed(dense, np.random.default_rng(0))
    solution = blocks.solve(at, np.zeros(dense.m), numerics(LIGHT[name]))
    vdot, pull = dense.solve_exactly(at)
    jacobian = dense.closures(at).jacobian
    assert relative_error(solution.vdot, vdot, 1.0) < 1e-10
    assert relative_error(solution.correction, np.linalg.pinv(jacobian.T, rcond=1e-9) @ pull, 1.0) < 1e-6


@pytest.mark.parametrize("name", LIGHT)
def test_a_heavy_penalty_loses_digits(name: str) -> None:
    """A penalty of 1e9 loses digits however often multipliers are corrected: the reason for light ones."""
    blocks, dense = in_scene(name, "penalty")
    assert all(x > 1e-9 for x in errors(blocks, dense, closed(dense, np.random.default_rng(0)), 1e9, 4))


@pytest.mark.parametrize(("seed", "geared"), [*((seed, False) for seed in range(6)), *((seed, True) for seed in range(3))])
def test_a_correction_inside_is_a_correction_outside(seed: int, geared: bool) -> None:
    """Two evaluations of the closure "penalty" without stabilisation are one of "proximal", three are one of "solved", of loops inside
    branches and across them, and of gears."""
    model: Model = random_models.random_loops(seed)
    model = random_models.with_gears(model, seed, bent=seed > 0) if geared else model
    topology = build_topology(model)
    plain, dense = both(topology, SCENE, parameters=PARAMETERS)
    rng = np.random.default_rng(seed)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    at, multipliers = Instant(q=q, v=v, t=0.37), 10 * rng.standard_normal(dense.m)
    soft = Numerics(penalty=1e3, damping_ratio=0.0, frequency=0.0)
    condition, corrected = dense.solve(at, multipliers, soft).condition, multipliers + plain.solve(at, multipliers, soft).correction
    for closure in ("proximal", "solved"):
        outside = plain.solve(at, corrected, soft)
        corrected = corrected + outside.correction
        found = BlockMechanism(topology, SCENE, parameters=PARAMETERS, closure=closure).solve(at, multipliers, soft)
        assert relative_error(found.vdot, outside.vdot, 1.0) < 1e-11 + 1e-14 * condition
        assert relative_error(found.correction, corrected - multipliers, 100.0) < 1e-11 + 1e-14 * condition


@pytest.mark.parametrize("kind", [K.SPHERICAL, K.UNIVERSAL, K.FIXED, K.PRISMATIC, K.POINT_ON_LINE, K.DISTANCE])
def test_loops_across_branches(kind: object) -> None:
    """Cut joints with independent equations between subtrees of several bodies.

    The cut joints feel grams to kilograms, and rounding costs more of the light ones.
    """
    model = random_models.loop_with(kind, "roots", 1)  # type: ignore[arg-type]
    blocks, dense = both(build_topology(model), SCENE, parameters=PARAMETERS, closure="proximal")
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, np.random.default_rng(1))
    assert errors(blocks, dense, Instant(q=q, v=v, t=0.37), 1e4, 3)[-1] < 1e-9
