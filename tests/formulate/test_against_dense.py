"""The recursive formulation against the dense oracle: accelerations, corrections, residuals and their rates.

Both solve the same penalty system, so that what they may differ by is rounding times its condition (the oracle's
differences lose 1e-15 of a velocity over their step of 4e-3 s); residual and rate need no solution and agree to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import COORDINATES, GROUND, JointForce, JointKind, Model, Scene, Tyre, Wheel
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.random_models import CLOSINGS, CUT_KINDS, TIME, TREE_KINDS, K, scene, stop, variable, with_gears, workshop
from tests.oracles.dense import Array, DenseMechanism, Instant, Numerics, Solution
from tests.oracles.evaluation import BlockMechanism, both
from tests.oracles.tyre import Flat

MODELS = Path(__file__).parents[2] / "models"
SCENE = scene({"drive": 0.1 + sympy.sin(2 * TIME) / 5})
PARAMETERS = {"size": 1.3}
SOFT = Numerics(penalty=1e3, damping_ratio=0.7, frequency=5.0)
EPS = float(np.finfo(float).eps)


class Slope(Flat):
    """A road that rises by one in twenty."""

    def height(self, x: float, y: float) -> float:
        return 0.01 + x / 20 + 0.002 * np.sign(y)

    def slope(self, x: float, y: float) -> float:
        return 1 / 20


def relative_error(value: Array, reference: Array, floor: float) -> float:
    """The largest difference over the largest reference value, at least ``floor``."""
    return float(np.max(np.abs(value - reference), initial=0.0) / max(np.max(np.abs(reference), initial=0.0), floor))


def assert_agree(found: Solution, expected: Solution, numerics: Numerics) -> None:
    """Agreement to rounding; accelerations and corrections to that times the system's condition."""
    solved = 1e-11 + 50 * EPS * expected.condition
    assert relative_error(found.residual, expected.residual, 0.1) < 1e-12
    assert relative_error(found.rate, expected.rate, 0.1) < 1e-12
    assert relative_error(found.vdot, expected.vdot, 1.0) < solved
    assert relative_error(found.correction, expected.correction, 0.1 * numerics.penalty) < solved


def compare(model: Model, seed: int, motion: float = 1.0, roads: Mapping[str, Flat] | None = None) -> None:
    """A random model at a random state with random multipliers."""
    compare_at(*both(build_topology(model), SCENE, parameters=PARAMETERS, roads=roads or {}), seed, motion)


def compare_at(blocks: BlockMechanism, dense: DenseMechanism, seed: int, motion: float = 1.0) -> None:
    """At a random state with random multipliers."""
    rng = np.random.default_rng(seed)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    at, multipliers = Instant(q=q, v=v, t=0.37, motion=motion), 10 * rng.standard_normal(dense.m)
    assert_agree(blocks.solve(at, multipliers, SOFT), dense.solve(at, multipliers, SOFT), SOFT)
    assert_same_step(blocks, dense, at, 0.1 * rng.standard_normal(dense.m), SOFT)


def assert_same_step(blocks: BlockMechanism, dense: DenseMechanism, at: Instant, gap: Array, numerics: Numerics) -> None:
    """Check the step that closes a gap, (M + penalty J'J)^-1 penalty J' gap, to the rounding of J.

    J is of order one whatever its entries are, since they are differences; its rounding, eps, moves the step by
    eps penalty |gap| times the norm of the inverse matrix. 370 steps were at most 7.2 times that apart.
    """
    expected, _ = dense.project(at, gap, numerics)
    jacobian = dense.closures(at).jacobian
    matrix = dense.inertia(dense.motion(at))[0] + numerics.penalty * jacobian.T @ jacobian
    of_rounding = EPS * numerics.penalty * np.abs(gap).sum() * np.linalg.norm(np.linalg.inv(matrix), np.inf) if len(gap) else 0.0
    assert np.max(np.abs(blocks.project(at, gap, numerics) - expected), initial=0.0) <= 30 * of_rounding


def test_a_cut_joint_between_bodies_that_cannot_move_apart() -> None:
    """Its step is zero, and that of the oracle its rounding: 2.8e-13 for a gap of 0.1."""
    blocks, dense = both(build_topology(random_models.floating_loops(230158)), SCENE, parameters=PARAMETERS, roads={})
    for i in range(4):
        compare_at(blocks, dense, 230158 + i, motion=float(i % 4 > 0))


def test_a_step_whose_error_is_that_of_its_jacobian() -> None:
    """An entry of J of 1e-3 has the rounding of its terms, 7e-16, which moves a step of 0.01 by 2e-12; the elimination loses nothing."""
    model = random_models.loop_with(CUT_KINDS[15423 % len(CUT_KINDS)], CLOSINGS[15423 // 20 % len(CLOSINGS)], 15423)
    blocks, dense = both(build_topology(model), SCENE, parameters=PARAMETERS, roads={})
    for i in range(4):
        compare_at(blocks, dense, 15423 + i, motion=float(i % 4 > 0))


ROTOR = """
cutjoint: 1
name: rotor
gravity: [0, 0, -9.81]
bodies:
  arm: {mass: 2, centre_of_mass: [0.3, 0.1, 0], inertia: [0.1, 0.2, 0.3]}
  wheel: {mass: 3, centre_of_mass: [1, %s, 0], inertia: {principal: [0.4, 0.7, 0.4], x: any, y: [%s]}}
joints:
  hinge: {kind: universal, bodies: [ground, arm], at: [0, 0, 0], axis: [1, 2, 3], axis_2: [3, 0, -1]}
  bearing: {kind: revolute, bodies: [arm, wheel], at: [1, 0, 0], axis: [%s]}
forces:
  contact: {kind: wheel, body: wheel, centre: [1, 0, 0], axis: [0, 1, 0], radius: 0.3, force: [0, 0, 0]}
"""


@pytest.mark.parametrize(("axis", "of_body", "offset", "turns"), [
    ("0, 1, 0", "0, 1, 0", "0.2", False), ("0.2, 1, -0.1", "0.2, 1, -0.1", "0", False), ("0, 1, 0", "0, 1, 0.1", "0", True),
    ("0, 0, 1", "0, 0, 1", "0.2", True),
])  # fmt: skip
def test_a_wheel_about_its_axis_of_symmetry(axis: str, of_body: str, offset: str, turns: bool) -> None:
    """Its angle is in its inertia where axis or centre are others.  About one axis the arm would bear all gyroscopic moments."""
    model = read_model_text(ROTOR % (offset, of_body, axis), "rotor.yaml")
    compare(model, 3, roads={"contact": Flat()})
    program = schedule_recursive(formulate_recursive(build_topology(model), SCENE, ()), lanes=True)
    (evaluate,) = (f for f in program.functions if f.name == "evaluate")
    reached = program.graph.reachable([r.scalar for r in evaluate.results])
    assert (sum(program.graph.nodes[n].op == "cos" for n in reached) == 3) == turns


# Random models


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("direction", ["normal", "reversed"])
@pytest.mark.parametrize("kind", TREE_KINDS)
def test_tree_joint(kind: JointKind, direction: str, seed: int) -> None:
    model = random_models.tree_with(kind, direction == "reversed", seed)
    tried = [t for t in build_topology(model).tree if t.joint.kind is kind and t.reversed == (direction == "reversed")]
    assert {t.parent == GROUND for t in tried} == {True, False}
    compare(model, seed)


@pytest.mark.parametrize("closing", CLOSINGS)
@pytest.mark.parametrize("kind", CUT_KINDS)
def test_cut_joint(kind: JointKind, closing: str) -> None:
    seed = CLOSINGS.index(closing) + CUT_KINDS.index(kind)
    model = random_models.loop_with(kind, closing, seed)
    assert build_topology(model).cuts[-1].kind is kind
    compare(model, seed)


@pytest.mark.parametrize("order", ["base_inside", "base_outside"])
@pytest.mark.parametrize("kind", CUT_KINDS)
def test_cut_joint_to_ground(kind: JointKind, order: str) -> None:
    model = random_models.loop_with(kind, "ground", 10 + (order == "base_outside"))
    (cut,) = build_topology(model).cuts
    assert (cut.base if order == "base_outside" else cut.follower) == GROUND
    compare(model, 0)


@pytest.mark.parametrize("seed", range(12))
def test_random_tree(seed: int) -> None:
    compare(random_models.random_tree(seed), seed)


@pytest.mark.parametrize("seed", range(12))
def test_coupled_loops(seed: int) -> None:
    compare(random_models.random_loops(seed), seed)


@pytest.mark.parametrize("seed", range(12))
def test_parts_around_a_hub(seed: int) -> None:
    """As the sides of an axle around their rack: a branch each, and one of the hub."""
    model = random_models.around_hub(seed)
    branches = build_topology(model).branches
    hubs = [branch.hub for branch in branches if branch.hub]
    assert len(hubs) == 2 + seed % 2
    assert {branch.bodies[0] for branch in branches if not branch.hub} >= set(hubs)
    compare(model, seed)


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_geared_tree(seed: int, bent: bool) -> None:
    """Gears between any coordinates, of guided joints too, in branches of more unknowns than others have."""
    model = with_gears(random_models.random_tree(seed), seed, bent=bent)
    inside = {name for branch in build_topology(model).branches for name in branch.gears}
    assert inside == {gear.name for gear in model.gears}
    compare(model, seed)


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_geared_loops(seed: int, bent: bool) -> None:
    compare(with_gears(random_models.random_loops(seed), seed, bent=bent), seed)


@pytest.mark.parametrize("seed", range(6))
def test_contacts(seed: int) -> None:
    """Balls on planes and cylinders, in trees and loops, beside the ground and between bodies; some do not touch."""
    model = random_models.random_loops(seed) if seed % 2 else random_models.random_tree(seed)
    compare(random_models.with_contacts(model, seed), seed)


@pytest.mark.parametrize("seed", range(6))
def test_ball_springs(seed: int) -> None:
    """Springs and dampers of balls, in trees and loops, turned by any angle."""
    model = random_models.random_loops(seed) if seed % 2 else random_models.random_tree(seed)
    compare(random_models.with_ball_springs(model, seed), seed)


@pytest.mark.parametrize("seed", range(8))
def test_cuts_chosen_by_the_compiler(seed: int) -> None:
    model = random_models.chosen_loops(seed)
    assert all(j.cut is None for j in model.joints)
    compare(model, seed)


@pytest.mark.parametrize("kind", random_models.GUIDABLE)
def test_guided_joint(kind: JointKind) -> None:
    w = workshop(0, f"guided {kind}")
    w.grow(w.guided(w.guided(w.grow(GROUND), kind), kind))
    w.load_all()
    compare(w.model(), 0)


@pytest.mark.parametrize("kind", [kind for kind in TREE_KINDS if COORDINATES[kind]])
def test_force_on_every_coordinate(kind: JointKind) -> None:
    """Of a joint at the ground, and of one on a body that is seen from its follower."""
    w = workshop(0, f"forces on {kind}")
    w.grow(w.grow(GROUND, kind, is_reversed=False), kind, is_reversed=True)
    for joint in w.joints:
        for n, coordinate in enumerate(COORDINATES[kind]):
            law = stop(variable("position"), variable("rate"), 30) + 3 + n
            name = f"force_{len(w.forces)}"
            unit, where = joint.element.units[coordinate], random_models.NOWHERE
            force = JointForce(name=name, joint=joint.name, coordinate=coordinate, unit=unit, law=law, active=True, span=where)
            w.forces.append(force)
    compare(w.model(), 0)


@pytest.mark.parametrize("seed", [0, 2])
def test_held_at_rest(seed: int) -> None:
    """Guides stand where they are when ``motion`` is zero."""
    model = random_models.random_loops(seed)
    assert any(j.guide is not None for j in model.joints)
    compare(model, seed, motion=0.0)


# Tyres

CALSPAN = {"A0": 2625, "A1": 14.47, "A2": 12930, "A3": 2.29, "A4": 18175, "B1": -4.64e-5, "B3": 1.216, "B4": 2.18e-11, "SN": 1.0274,
           "AF1": -1.71e-5, "AF2": 1.71e-5}  # fmt: skip
WHEELS = {  # deflection m, forward m/s, sideways m/s, yaw rad, camber rad
    "rolling": (0.008, 5.0, 0.1, 0.0, 0.02),
    "turned": (0.008, 4.0, -0.2, 2.0, -0.1),
    "sliding": (0.004, 5.0, 3.0, 0.5, 0.05),
    "overloaded": (0.040, 8.0, 0.3, -0.4, 0.1),
    "beyond_friction": (0.080, 8.0, -6.0, 0.3, 0.0),
    "standing": (0.008, 0.0, 0.1, 0.3, 0.1),
    "backwards": (0.008, -5.0, 0.1, 0.3, 0.1),
    "lifted": (-0.010, 5.0, 0.1, 0.3, 0.1),
}


@pytest.mark.parametrize("road", ["flat", "slope"])
@pytest.mark.parametrize("wheel", WHEELS)
def test_tyre(wheel: str, road: str) -> None:
    constants = {name: sympy.Float(value) for name, value in {**CALSPAN, "stiffness": 460000, "radius": 0.364, "spin_inertia": 1.9}.items()}
    compare_on_road(lambda **where: Tyre(constants=constants, **where), WHEELS[wheel], Slope() if road == "slope" else Flat())


def compare_on_road(make: Callable[..., Tyre | Wheel], motion: tuple[float, ...], surface: Flat, spin: float = -0.2) -> None:
    """A free body with a wheel of radius 0.364 m: ``motion`` as above, ``spin`` (rad/s) about the axis of an upright, straight wheel."""
    deflection, forward, sideways, yaw, camber = motion
    w = workshop(0, "tyre")
    w.grow(GROUND, K.FREE, is_reversed=False)
    tyre = make(
        name="tyre", body="body_0", centre=w.bodies[0].centre_of_mass, axis=(sympy.Integer(0), sympy.Integer(1), sympy.Integer(0)),
        active=True, span=random_models.NOWHERE,
    )  # fmt: skip
    w.forces.append(tyre)
    blocks, dense = both(build_topology(w.model()), SCENE, parameters=PARAMETERS, roads={"tyre": surface})
    q = np.array([0.0, 0.0, 0.0, np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    q = dense.retract(q, np.array([0.3, -0.2, 0, camber * np.cos(yaw), camber * np.sin(yaw), 0]))
    R, p = dense.poses(q, 0.0)["body_0"]
    centre = p + R @ dense.vector(tyre.centre)
    q[2] += surface.height(centre[0], centre[1]) + 0.364 - deflection - centre[2]
    c, s = np.cos(yaw), np.sin(yaw)
    v = np.array([forward * c - sideways * s, forward * s + sideways * c, 0.1, 0.3, spin, 0.1])
    joint = w.joints[0]
    v[:3] -= np.cross(v[3:], R @ (dense.vector(tyre.centre) - dense.vector(joint.at)))
    at = Instant(q=q, v=v)
    none = np.zeros(0)
    assert_agree(blocks.solve(at, none, SOFT), dense.solve(at, none, SOFT), SOFT)


def wheel_with(**where: Any) -> Wheel:
    """A wheel all of whose motion has a share in its forces."""
    x = {name: variable(name) for name in ("deflection", "deflection_rate", "loaded_radius", "vx", "vy", "spin", "camber", "turn")}
    rolls = x["vx"] - x["loaded_radius"] * x["spin"]
    force = (5 * x["turn"] - 300 * rolls, -900 * x["vy"] - 2000 * x["camber"], 220000 * x["deflection"] + 900 * x["deflection_rate"])
    moment = (30 * x["camber"] + 3 * x["turn"], -2 * x["spin"], -15 * x["vy"] + 3 * x["turn"])
    return Wheel(free_radius=sympy.Float(0.364), force=force, moment=moment, **where)


@pytest.mark.parametrize("road", ["flat", "slope"])
@pytest.mark.parametrize("wheel", WHEELS)
def test_wheel(wheel: str, road: str) -> None:
    compare_on_road(wheel_with, WHEELS[wheel], Slope() if road == "slope" else Flat(), spin=14.0)


# Models of the repository


def in_scene(file: str, name: str) -> tuple[BlockMechanism, DenseMechanism, Scene]:
    model = read_model(MODELS / file)
    topology, chosen = build_topology(model), model.scenes[name]
    roads = {f.name: Slope() for f in model.forces if isinstance(f, Tyre)}
    return *both(topology, chosen, roads=roads), chosen


def near_design(dense: DenseMechanism, rng: np.random.Generator, size: float) -> Array:
    """Coordinates near those of the design position."""
    q = np.zeros(dense.nq)
    for x in dense.layout.values():
        if x.ball:
            q[x.q + x.scalars] = 1.0
    return dense.retract(q, size * rng.standard_normal(dense.nv))


@pytest.mark.parametrize("penalty", [1e4, 1e9])
@pytest.mark.parametrize("name", ["simul1s", "iavsd_sine_2mm"])
def test_iltis(name: str, penalty: float) -> None:
    blocks, dense, _ = in_scene("iltis.yaml", name)
    numerics, rng = Numerics(penalty=penalty, damping_ratio=1.0, frequency=10.0), np.random.default_rng(1)
    for height in (-0.15, 0.0, 0.2):  # bumpers met, design position, wheels lifted
        q = near_design(dense, rng, 0.03)
        q[2] += height
        v = 0.3 * rng.standard_normal(dense.nv)
        v[0] += 5.0
        at, multipliers = Instant(q=q, v=v, t=0.3), 1e3 * rng.standard_normal(dense.m)
        assert_agree(blocks.solve(at, multipliers, numerics), dense.solve(at, multipliers, numerics), numerics)
        assert_same_step(blocks, dense, at, 0.01 * rng.standard_normal(dense.m), numerics)


def test_iltis_has_the_size_of_the_paper() -> None:
    blocks, _, _ = in_scene("iltis.yaml", "simul1s")
    assert (blocks.equations.speeds, len(blocks.equations.equation_names)) == (42, 36)


@pytest.mark.parametrize("seed", range(3))
def test_four_bar(seed: int) -> None:
    blocks, dense, _ = in_scene("four_bar.yaml", "swing")
    numerics = Numerics(penalty=5e3, damping_ratio=1.0, frequency=10.0)
    rng = np.random.default_rng(seed)
    at = Instant(q=rng.standard_normal(dense.nq), v=rng.standard_normal(dense.nv))
    multipliers = 10 * rng.standard_normal(dense.m)
    assert_agree(blocks.solve(at, multipliers, numerics), dense.solve(at, multipliers, numerics), numerics)
