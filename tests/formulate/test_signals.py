"""Tangents of forces that read the motion of other bodies, of signals and of states, against differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from cutjoint.analysis.natural import call
from cutjoint.compile.pipeline import generate
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.natural.equations import formulate_lagrangian
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model_text
from cutjoint.sparse.pattern import dense, make_pattern, places
from cutjoint.topology.build import build_topology
from tests.formulate.test_implicit import System, verify_tangent
from tests.formulate.test_natural import SCENE, Hills, differences, make_pair, without_rod_forces
from tests.mechanisms import random_models
from tests.mechanisms.reading import reading


@dataclass(frozen=True)
class WithStates(System):
    """A system whose states are among its unknowns."""

    @property
    def n(self) -> int:
        return len(self.equations.state.v)


@pytest.mark.parametrize("states", [0, 3])
@pytest.mark.parametrize("seed", range(3))
def test_recursive_newton_has_the_exact_tangent(seed: int, states: int) -> None:
    for make in (random_models.random_tree, random_models.random_loops):
        model = reading(make(seed), seed, states=states)
        start = formulate_recursive(build_topology(model), random_models.scene(), ())
        system = WithStates(formulate_implicit(start, ()), {name: Hills() for name in start.roads})
        assert verify_tangent(system, seed) > 0


def test_laws_of_every_kind_read_where_their_own_parts_are() -> None:
    """Of springs, displacements and bushings: no loop, since places follow from the motion, and forces that act later."""
    text = """
cutjoint: 1
name: own
gravity: [0, 0, -9.81]
bodies: {one: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}, two: {mass: 1, centre_of_mass: [1, 0, 0], inertia: [1, 1, 1]}}
joints:
  first: {kind: free, bodies: [ground, one], at: [0, 0, 0]}
  second: {kind: planar, bodies: [one, two], at: [1, 0, 0], axis: [0, 1, 0.2]}
forces:
  spring: {kind: point_spring, bodies: [ground, two], from: [0, 0, 2], to: [1, 0, 0], law: -far - 2*rate - pad.Fx}
  slide: {kind: axial_force, bodies: [ground, one], origin: [0, 0, 0], point: [0, 1, 0], axis: [1, 1, 0], law: pulled - spring.rate}
  pad: {kind: bushing, bodies: [one, two], at: [0.5, 0, 0], laws: [soft, -position, -position, -4*pad.rx, -rate, -position]}
signals:
  pulled: -3*slide.travel
  far: 2*spring.length*slide.travel
  soft: -3*pad.dx - 2*pad.rz - here
  here: one.y*one.yaw
scenes: {run: {end: 1}}
"""
    model = read_model_text(text, "own.yaml")
    start = formulate_recursive(build_topology(model), model.scenes["run"], ())
    assert verify_tangent(System(formulate_implicit(start, ()), {}), 2) == 9


@pytest.mark.parametrize("seed", [1, 3])
def test_natural_coordinates_have_the_tangent_of_all_that_laws_read(seed: int) -> None:
    """The symmetric part of it, and the whole matrix of the classical method."""
    for method in ("augmented", "classical"):
        pair = make_pair(reading(without_rod_forces(random_models.random_loops(seed)), seed), SCENE, (), method)
        rng = np.random.default_rng(seed)
        q, v, vdot = (rng.standard_normal(pair.n) for _ in range(3))
        M, C, K, J = differences(pair, q, v, vdot)
        A = M + 0.1 * C + 0.01 * K
        expected = (A + A.T) / 2 + J.T @ J
        if method == "classical":
            expected = np.block([[A, J.T], [J, np.zeros((pair.m, pair.m))]])
        found = pair.tangent(q, v, vdot, (0.1, 0.01, 1.0))
        assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("angle", ["roll", "pitch", "yaw"])
def test_natural_coordinates_have_the_derivatives_of_angles(angle: str) -> None:
    text = SLIDER.replace("LAW", f"3*rod.{angle} + 2*rod.{angle}**2")
    pair = make_pair(read_model_text(text, "slider.yaml"), SCENE, (), "augmented")
    rng = np.random.default_rng(1)
    q, v, vdot = (rng.standard_normal(pair.n) for _ in range(3))
    M, C, K, J = differences(pair, q, v, vdot)
    A = M + 0.1 * C + 0.01 * K
    expected = (A + A.T) / 2 + J.T @ J
    assert np.abs(K).max() > 0.1
    assert np.abs(pair.tangent(q, v, vdot, (0.1, 0.01, 1.0)) - expected).max() < 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("seed", [1, 3])
def test_the_classical_tangent_has_states(seed: int) -> None:
    """With the change of Phi_q^T lambda left out, by multipliers that are zero."""
    damping, stiffness, rng = 0.1, 0.01, np.random.default_rng(seed)
    model = reading(without_rod_forces(random_models.random_loops(seed)), seed, states=2)
    system = formulate_lagrangian(formulate_recursive(build_topology(model), SCENE, ()), "classical", ())
    n, m, coordinates = len(system.state.v), len(system.equation_names), len(system.coordinate_names)
    found = system.function("linearise").results
    entries = [tuple(map(int, name.removeprefix("tangent:").split(","))) for name in found if name.startswith("tangent:")]
    pattern = make_pattern(n + m, entries, symmetric=False)
    system = system.with_tangent(places(pattern))
    now = {"t": np.array([0.2]), "motion": np.ones(1), "penalty": np.zeros(1), "parameters": np.array([p.value for p in system.parameters])}
    q, v, vdot = rng.standard_normal(coordinates), rng.standard_normal(n), rng.standard_normal(n)

    def balance(x: np.ndarray) -> np.ndarray:
        arrays = {"q": q + stiffness * x[:coordinates], "v": v + damping * x, "vdot": vdot + x, "lambda": np.zeros(m)}
        return np.asarray(call(system, "dynamic_residual", {**now, **arrays}, {})["force_residual"])

    h = 2e-4
    expected = np.array([(8 * (balance(e) - balance(-e)) - balance(2 * e) + balance(-2 * e)) / (12 * h) for e in h * np.eye(n)]).T
    arrays = {"q": q, "v": v, "vdot": vdot, "lambda": np.zeros(m), "weights": np.array([damping, stiffness, 1.0])}
    tangent = dense(pattern, call(system, "linearise", {**now, **arrays}, {})["tangent"])[:n, :n]
    assert np.abs(tangent - expected).max() < 1e-7 * np.abs(expected).max()


SLIDER = """
cutjoint: 1
name: slider
gravity: [0, 0, -9.81]
bodies:
  shoe: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  rod: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [1, 2, 3]}
joints:
  slide: {kind: prismatic, bodies: [ground, shoe], at: [0, 0, 0], axis: [1, 0, 0]}
  ball: {kind: spherical, bodies: [shoe, rod], at: [0, 0, 0]}
forces: {drive: {kind: joint_force, joint: slide, law: LAW}}
scenes: {run: {end: 1}}
"""

RIG = """
cutjoint: 1
name: rig
gravity: [0, 0, -9.81]
bodies: {one: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [1, 2, 3]}, two: {mass: 1, centre_of_mass: [1.5, 0, 0], inertia: [1, 1, 1]}}
joints:
  first: {kind: revolute, bodies: [ground, one], at: [0, 0, 0], axis: y}
  second: {kind: revolute, bodies: [one, two], at: [1, 0, 0], axis: [0, 1, 1]}
forces: {drive: {kind: joint_force, joint: first, law: -2*rate}}
scenes: {run: {end: 1}}
"""


def operations(text: str) -> int:
    model = read_model_text(text, "rig.yaml")
    return generate(model, model.scenes["run"], (), method="recursive").program.operations("evaluate")


def test_signals_and_states_cost_what_they_say() -> None:
    """Twenty signals, eight rates and the law's further term have a product and a sum each; nothing else is added to an evaluation."""
    states = "".join(f"  s{i}: {{start: 0.1, rate: -2*s{i} + g{2 * i + 1}}}\n" for i in range(8))
    signals = "".join(f"  g{k}: 0.5*g{k - 1} + s{k % 8}\n" for k in range(1, 20))
    more = RIG.replace("-2*rate", '"-2*rate + 3*g19"') + f"states:\n{states}signals:\n  g0: 0.5*first.angle_rate + s0\n{signals}"
    assert operations(more) - operations(RIG) == 2 * (20 + 8 + 1)
