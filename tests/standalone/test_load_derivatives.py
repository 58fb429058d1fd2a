"""Derivatives of adaptive steps over loads of friction that pass zero, beside differences of equations by hand by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.stepping.load import load_scene
from tests.conftest import needs_cpp, with_heavy
from tests.physics.test_friction_by_hand import Rub

pytestmark = needs_cpp

#: A crank of 0.1 m, a rod and a slider without weight, whose force on its rail changes its sign.
SLIDER = """
cutjoint: 1
name: slider
gravity: [0, 0, 0]
parameters: {m: {value: 1, unit: kg, binding: param}}
bodies:
  crank: {mass: 2, centre_of_mass: [0, 0, 0.05], inertia: [0.002, 0.002, 0.002]}
  rod: {mass: m, centre_of_mass: [0.15, 0, 0.05], inertia: [0.009, 0.009, 0.009]}
  slider: {mass: 3, centre_of_mass: [0.3, 0, 0], inertia: [0.01, 0.01, 0.01]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, -1, 0]}
  elbow: {kind: cylindrical, bodies: [crank, rod], at: [0, 0, 0.1], axis: [0, -1, 0]}
  wrist: {kind: spherical, bodies: [rod, slider], at: [0.3, 0, 0]}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0.3, 0, 0], axis: [1, 0, 0]}
forces: {rub: {kind: joint_friction, joint: rail, coefficient: 0.2}}
outputs: [pin.angle, pin.angle_rate, rub.load]
scenes:
  out: {end: 2, output_step: 0.01, rates: {pin.angle_rate: 10}}
  back: {end: 2, output_step: 0.01, positions: {pin.angle: 2}, rates: {pin.angle_rate: 10}}
"""
RUB, LENGTH = Rub(mu=0.2, static=0.2, stribeck=1, radius=1), np.sqrt(0.1)


def motion(y: np.ndarray, mass: float, sign: float) -> tuple[float, float, float]:
    """The crank's acceleration, the bristle's rate and the load, of that sign: crank, rod, and the force that holds the slider's height."""
    angle, rate, share = y
    s, c = np.sin(angle), np.cos(angle)
    down = -0.1 * c / LENGTH
    e = np.array([np.sqrt(1 - down**2), down])  # along the rod
    n, by_crank = np.array([-e[1], e[0]]), 0.1 * np.array([-c, -s])
    turn = 0.1 * s * rate / (LENGTH * e[0])
    rod, slider = (np.column_stack([by_crank, each * LENGTH * n]) for each in (0.5, 1))
    of_rod, of_slider = (0.1 * np.array([s, -c]) * rate**2 - each * LENGTH * turn**2 * e for each in (0.5, 1))
    friction, change = RUB.law(slider[0] @ [rate, turn], share)
    M = np.zeros((3, 3))
    M[:2, :2] = np.diag([0.002 + 2 * 0.05**2, 0.009]) + mass * rod.T @ rod + 3 * slider.T @ slider
    M[:2, 2], M[2, :2] = -slider[1], slider[1]
    right = np.zeros((3, 2))
    right[:2, 0], right[2, 0] = -mass * rod.T @ of_rod - 3 * slider.T @ of_slider, -of_slider[1]
    right[:2, 1] = friction * slider[0]
    free, unit = np.linalg.solve(M, right).T
    load = free[2] / (1 - sign * unit[2])
    return free[0] + sign * load * unit[0], change, load


def by_hand(mass: float, times: np.ndarray, angle: float) -> np.ndarray:
    """Angle and rate of the crank, between exact zeros of the load, so that differences of runs are smooth."""
    t, y, parts = 0.0, np.array([angle, 10.0, 0.0]), []
    sign = np.sign(motion(y, mass, 1)[2])
    while t < times[-1]:

        def load(_: float, y: np.ndarray, sign: float = sign) -> float:
            return motion(y, mass, sign)[2]

        load.terminal, load.direction = True, -sign  # type: ignore[attr-defined]

        def rates(_: float, y: np.ndarray, sign: float = sign) -> list[float]:
            return [y[1], *motion(y, mass, sign)[:2]]

        run = solve_ivp(rates, (t, times[-1]), y, "DOP853", times[times >= t], rtol=1e-13, atol=1e-14, events=load)
        parts.append(run.y[:2, run.t > t if parts else slice(None)])
        t, y, sign = run.t[-1] if run.status == 0 else run.t_events[0][0], run.y[:, -1] if run.status == 0 else run.y_events[0][0], -sign
    return np.hstack(parts).T


@pytest.mark.parametrize(("scene", "angle"), [("out", 0.0), ("back", 2.0)])
@pytest.mark.parametrize("tolerance", with_heavy([1e-10, 1e-11, 1e-12], 1e-11, 1e-12))
@pytest.mark.parametrize("integrator", with_heavy(["dormand-prince", "dop853"], "dop853"))
def test_derivatives_by_a_mass_over_a_load_that_passes_zero(integrator: str, tolerance: float, scene: str, angle: float) -> None:
    model = read_model_text(SLIDER, "slider.yaml")
    sim = load_scene(model, find_scene(model, scene), integrator=integrator, adjoint=True).reset(dt=0.01, tolerance=tolerance)
    begun, outputs = sim.snapshot(), ["pin.angle", "pin.angle_rate"]
    along = sim.forward_sensitivities(10, outputs, ["m"])
    shares = {-2: 1, -1: -8, 1: 8, 2: -1}
    exact = sum(share * by_hand(1 + 2e-3 * k, along.times, angle) for k, share in shares.items()) / (12 * 2e-3)
    assert np.abs(along.values - by_hand(1, along.times, angle)).max() < 1e-9
    assert np.abs(along.derivatives[:, :, 0] - exact).max() < 2e-8  # a step ends a millionth of its length behind the zero
    sim.restore(begun)
    weights = np.random.default_rng(1).normal(size=(1, *along.values.shape))
    back = sim.adjoint_sensitivities(10, outputs, ["m"], weights)
    assert back.derivatives[0, 0] == pytest.approx(np.tensordot(weights[0], along.derivatives[:, :, 0]), rel=1e-8)
