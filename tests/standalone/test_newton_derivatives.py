"""Derivatives of runs by Newton's iteration with loops: beside differences of runs, and by the adjoint method."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import cutjoint
from cutjoint.run.scenes import load_model
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.standalone.test_radau_derivatives import by_radau
from tests.standalone.test_run_adjoints import backwards
from tests.standalone.test_run_adjoints import compare as compare_backwards
from tests.standalone.test_run_derivatives import CART, compare
from tests.standalone.test_step_derivatives import DAMPING, MASS, OSCILLATOR, PUSHER, SHARP, STIFFNESS, H

pytestmark = needs_cpp

#: A crank and a rocker about axes that cross, with a coupler between balls, one of them cut.
CROSSED = """
cutjoint: 1
name: crossed
gravity: [0, 0, -9.81]
parameters:
  heavy: {value: 0.6, unit: kg, binding: param}
  tip: {value: 0.7, unit: m, binding: param}
  push: {value: 0.1, unit: N*m, binding: input}
bodies:
  crank: {mass: 0.5, centre_of_mass: [0, 0, 0.1], inertia: [0.002, 0.002, 0.001]}
  coupler: {mass: heavy, centre_of_mass: [0.3, 0.1, 0.3], inertia: [0.01, 0.02, 0.02]}
  rocker: {mass: 0.7, centre_of_mass: [0.6, 0.3, 0.2], inertia: [0.01, 0.01, 0.004]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  wrist: {kind: spherical, bodies: [crank, coupler], at: [0, 0, 0.2]}
  foot: {kind: revolute, bodies: [ground, rocker], at: [0.6, 0.3, 0], axis: [1, 0, 0]}
  knee: {kind: spherical, bodies: [coupler, rocker], at: [tip, 0.3, 0.4]}
forces:
  drive: {kind: joint_force, joint: pin, law: push - 0.02*rate}
  hold: {kind: joint_force, joint: foot, law: -3*position}
  bush: {kind: bushing,
         bodies: [crank, coupler], at: [0, 0, 0.2], stiffness: [0, 0, 0, 0.1, 0.1, 0.1], damping: [0, 0, 0, 0.05, 0.05, 0.05]}
outputs: [pin.angle, foot.angle, coupler.z]
scenes: {run: {end: 1, NUMERICS}}
"""


@cache
def by_newton(text: str, name: str, integrator: str = "trapezoidal") -> cutjoint.Simulation:
    """A model with derivatives both ways.  Its iterations end near rounding, so that each projection has a tangent of its own."""
    sharp = text.replace("{NUMERICS}", f"{{{SHARP}}}").replace("NUMERICS", f"numerics: {{{SHARP}}}")
    return backwards(sharp, name, "recursive-newton", integrator)


def chung_hulbert(stiffness: complex, push: float, steps: int, radius: float = 0.8) -> complex:
    """Where the oscillator is after steps by the generalised-alpha method, with the parameters of Chung and Hulbert, 1993."""
    alpha_m, alpha_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    gamma, beta = 0.5 - alpha_m + alpha_f, (1 - alpha_m + alpha_f) ** 2 / 4
    x, v = complex(0.3), complex(0.0)
    rate = mean = (push - stiffness * x - DAMPING * v) / MASS
    for _ in range(steps):
        known = (alpha_f * rate - alpha_m * mean) / (1 - alpha_m)
        share = (1 - alpha_f) / (1 - alpha_m)
        x += H * v + H**2 * ((0.5 - beta) * mean + beta * known)
        v += H * ((1 - gamma) * mean + gamma * known)
        rate = (push - stiffness * x - DAMPING * v) / (MASS + share * (beta * H**2 * stiffness + gamma * H * DAMPING))
        x, v, mean = x + H**2 * beta * share * rate, v + H * gamma * share * rate, known + share * rate
    return x


def test_a_linear_motion_by_the_generalised_alpha_method() -> None:
    """Along a complex step of the stiffness, and by a force, of which the motion is an affine function."""
    sim = by_newton(OSCILLATOR, "oscillator", "generalised-alpha")
    sim.inputs["push"] = 0.7
    run = sim.reset(dt=H).forward_sensitivities(40, ["mass.x"], ["stiffness", "push"], every=20)
    for at, steps in ((1, 20), (2, 40)):
        known = chung_hulbert(STIFFNESS + 1e-30j, 0.7, steps)
        assert run.values[at, 0] == pytest.approx(known.real, rel=1e-12)
        assert run.derivatives[at, 0, 0] == pytest.approx(known.imag / 1e-30, rel=1e-11)
        assert run.derivatives[at, 0, 1] == pytest.approx((chung_hulbert(STIFFNESS, 1.7, steps) - known).real, rel=1e-11)
    compare_backwards(sim.reset(), 1e-12)


@pytest.mark.parametrize("integrator", ["trapezoidal", "generalised-alpha"])
def test_forces_between_knots(integrator: str) -> None:
    """Beside runs with other values, of which a linear motion has the exact derivatives as differences."""
    sim = by_newton(OSCILLATOR, "oscillator", integrator)

    def go(values: NDArray[np.float64], by: list[str]) -> cutjoint.ForwardSensitivities:
        sim.inputs["push"] = values[0]
        given = {"t": np.array([0, 0.031, 0.08, 0.16]), "value": values, "interpolation": "linear"}
        return sim.reset(dt=H).forward_sensitivities(8, ["mass.x"], by, every=8, inputs={"push": given})

    values = np.random.default_rng(1).normal(size=4)
    run = go(values, ["push"])
    for i in range(1, 4):
        change = go(values + np.eye(4)[i], []).values[-1, 0] - run.values[-1, 0]
        assert run.derivatives[-1, 0, i] == pytest.approx(change, rel=1e-9, abs=1e-12)


def test_the_generalised_alpha_method_with_states_and_controllers() -> None:
    sim = by_newton(CART, "cart", "generalised-alpha").reset(dt=5e-3)
    compare(sim, None, list(sim.outputs)[:3], {"k": 1e-1, "c": 1e-2, "load": 2e-4, "push": 1e-2}, 1e-7)
    sim.reset()
    sim.choose_independent()
    compare_backwards(sim, 1e-12)


@pytest.mark.parametrize("integrator", ["trapezoidal", "generalised-alpha"])
def test_a_slider_crank(integrator: str) -> None:
    """The derivative follows projections of speeds and accelerations in the norm of the tangent, and how that changes."""
    sim = by_newton(PUSHER, "pusher", integrator).reset(dt=0.01)
    compare(sim, None, ["cart.x"], {"drag": 0.01, "torque": 0.001}, 1e-8, steps=20)
    sim.reset()
    sim.choose_independent()
    compare_backwards(sim, 1e-12)


def test_the_press_and_its_hardpoint() -> None:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8").replace("rates: {", f"numerics: {{{SHARP}}}, rates: {{")
    sim = by_newton(text, "press").reset(dt=2e-3)
    compare(sim, ["pin.angle_rate"], ["slider.x", "spring.force"], {"stiffness": 3.0}, 1e-8)
    model, scene = load_model(MODELS / "press.yaml", None, ["A.z"])
    sim = load_scene(model, scene, method="recursive-newton", integrator="trapezoidal", adjoint=True).reset(dt=1e-3)
    sim.choose_independent(["pin.angle_rate"])
    compare_backwards(sim, 1e-12)


@pytest.mark.parametrize("integrator", with_heavy(["trapezoidal", "generalised-alpha", "radau5-fixed"], "radau5-fixed"))
def test_balls_in_a_loop(integrator: str) -> None:
    by_rule = integrator != "radau5-fixed"
    sim = by_newton(CROSSED, "crossed", integrator) if by_rule else by_radau(CROSSED.replace(", NUMERICS", ""), "crossed")
    sim.reset(dt=5e-3)
    independent = ["pin.angle_rate", "knee.wx"]
    compare(sim, independent, ["pin.angle", "foot.angle", "coupler.z"], {"heavy": 1e-3, "push": 1e-3}, 1e-7, steps=40)
    sim.reset()
    sim.choose_independent(independent)
    compare_backwards(sim, 1e-11, steps=40)
