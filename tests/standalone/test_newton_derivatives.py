"""Derivatives of runs by Newton's iteration with loops: beside differences of runs, and by the adjoint method."""

from __future__ import annotations

from functools import cache

import pytest

import cutjoint
from cutjoint.run.scenes import load_model
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.standalone.test_radau_derivatives import by_radau
from tests.standalone.test_run_adjoints import backwards
from tests.standalone.test_run_adjoints import compare as compare_backwards
from tests.standalone.test_run_derivatives import compare
from tests.standalone.test_step_derivatives import PUSHER, SHARP

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
def by_newton(text: str, name: str) -> cutjoint.Simulation:
    """A model with derivatives both ways.  Its iterations end near rounding, so that each projection has a tangent of its own."""
    return backwards(text.replace("{NUMERICS}", f"{{{SHARP}}}").replace("NUMERICS", f"numerics: {{{SHARP}}}"), name, "recursive-newton")


def test_a_slider_crank() -> None:
    """The derivative follows projections of speeds and accelerations in the norm of the tangent, and how that changes."""
    sim = by_newton(PUSHER, "pusher").reset(dt=0.01)
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


@pytest.mark.parametrize("integrator", with_heavy(["trapezoidal", "radau5-fixed"], "radau5-fixed"))
def test_balls_in_a_loop(integrator: str) -> None:
    by_rule = integrator == "trapezoidal"
    sim = by_newton(CROSSED, "crossed") if by_rule else by_radau(CROSSED.replace(", NUMERICS", ""), "crossed")
    sim.reset(dt=5e-3)
    independent = ["pin.angle_rate", "knee.wx"]
    compare(sim, independent, ["pin.angle", "foot.angle", "coupler.z"], {"heavy": 1e-3, "push": 1e-3}, 1e-7, steps=40)
    sim.reset()
    sim.choose_independent(independent)
    compare_backwards(sim, 1e-11, steps=40)
