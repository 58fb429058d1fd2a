"""Derivatives of runs by values of tables: closed forms, and differences of runs."""

from __future__ import annotations

import numpy as np
import pytest

import cutjoint
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.stepping.load import load_scene
from tests.conftest import needs_cpp
from tests.standalone.test_run_derivatives import fourth_order, from_start

pytestmark = needs_cpp

MASS = """
cutjoint: 1
name: mass
gravity: [0, 0, 0]
bodies: {mass: {mass: 2, centre_of_mass: [0, 0, 0]}}
joints: {slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: x}}
forces:
  push: {kind: joint_force, joint: slide, law: {table: {t: [0, 0.1, 0.2, 0.4], value: [0, 3, -1, 2]}, interpolation: linear}}
  hold: {kind: joint_force, joint: slide, law: {table: {position: [-0.1, 0, 0.05, 0.1], value: [40, 0, 0, -90]}}}
outputs: [mass.x, mass.vx]
scenes:
  pushed: {end: 0.4, switches: {hold: false}}
  held: {end: 0.4, rates: {slide.displacement_rate: 0.4}, switches: {push: false}}
"""
OUTPUTS = ["mass.x", "mass.vx"]


def simulation(scene: str, pattern: str) -> cutjoint.Simulation:
    model = read_model_text(MASS, "mass.yaml", tunable=[pattern])
    sim = load_scene(model, find_scene(model, scene), integrator="rk4", linearise=True, adjoint=True).reset(dt=5e-3)
    sim.choose_independent()
    return sim


def test_a_force_of_straight_lines_has_its_closed_form() -> None:
    """A value moves the force by a hat: v by its area over the mass, x by that times the time that is left, 0.4 s - t."""
    sim = simulation("pushed", "push.law.table.value.*")
    by = [f"push.law.table.value.{i}" for i in range(4)]
    assert list(sim.parameters) == by
    knots = np.array([0, 0.1, 0.2, 0.4])
    time = np.linspace(0, 0.4, 40_001)
    hats = [np.interp(time, knots, row) for row in np.eye(4)]
    wanted = np.array([[np.trapezoid((0.4 - time) * hat, time) / 2 for hat in hats], [np.trapezoid(hat, time) / 2 for hat in hats]])
    start = sim.snapshot()
    run = sim.forward_sensitivities(80, OUTPUTS, by, every=80)
    assert run.end[1] == pytest.approx(wanted, abs=1e-10)  # of the trapezoids
    sim.restore(start)
    back = sim.adjoint_sensitivities(80, OUTPUTS, by, "end", every=80)
    assert back.derivatives == pytest.approx(run.end[1], abs=1e-14)


def test_a_monotone_curve_beside_differences() -> None:
    """Its derivatives at points follow from the values; those of the flat part are 0."""
    sim = simulation("held", "hold.law.table.value.*").reset(dt=5e-4)
    by = [f"hold.law.table.value.{i}" for i in (0, 3)]
    start = sim.snapshot()
    run = sim.forward_sensitivities(1200, OUTPUTS, by, every=1200)
    sim.restore(start)
    back = sim.adjoint_sensitivities(1200, OUTPUTS, by, "end", every=1200)
    assert np.isfinite(back.derivatives).all()
    assert back.derivatives == pytest.approx(run.end[1], rel=1e-11, abs=1e-14)
    for i, name in enumerate(by):
        wanted = fourth_order(from_start(sim, name, None, 1200, OUTPUTS), 0.05)[-1]
        assert np.abs(run.end[1][:, i] - wanted).max() < 1e-7 * np.abs(wanted).max(), name  # steps end at the knots, which move
