"""A mechanism whose guide and forces follow inputs, and how its guided arm moves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: The inputs of the scene "lawful" as polynomials of time: what a cubic table gives exactly.
LIFT, PUSH = Polynomial([0, 0, 0.3, -0.1]), Polynomial([2, -1, 0, 0.5])

_STEPS = "end: 1, output_step: 0.05, numerics: {dt: 0.005}"

DRIVEN = f"""
cutjoint: 1
name: driven
gravity: [0, 0, -9.81]
parameters:
  lift: {{value: 0.1, unit: rad, binding: input}}
  push: {{value: 1, unit: N, binding: input}}
  gain: {{value: 3, binding: param}}
bodies:
  slider: {{mass: 2, centre_of_mass: [0, 0, 0]}}
  arm: {{mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1]}}
  bob: {{mass: 0.5, centre_of_mass: [1, 0, -0.4], inertia: [0.02, 0.02, 0.01]}}
joints:
  slide: {{kind: prismatic, bodies: [ground, slider], at: [0, 0, 0], axis: [1, 0, 0]}}
  shoulder: {{kind: revolute, bodies: [slider, arm], at: [0, 0, 0], axis: [0, 1, 0], guide: "lift + 0.2*t*lift**2"}}
  elbow: {{kind: revolute, bodies: [arm, bob], at: [1, 0, 0], axis: [0, 1, 0]}}
forces:
  thrust: {{kind: joint_force, joint: slide, law: "gain*push - 20*position - push*rate"}}
  gust: {{kind: load, body: bob, at: [1, 0, -0.4], force: [0, 0, "push*vx + lift"]}}
outputs: [shoulder.angle, shoulder.angle_rate, arm.az, slider.x, slider.vx, bob.z, thrust.force]
scenes:
  lawful: {{inputs: {{lift: "0.3*t**2 - 0.1*t**3", push: "2 - t + 0.5*t**3"}}, {_STEPS}}}
  free: {{{_STEPS}}}
"""


def pushed_text(law: str = "push") -> str:
    """A mass of 2 kg on a slide, at rest; a force of this law, which a host's input ``push`` (N) drives."""
    return f"""
cutjoint: 1
name: pushed
gravity: [0, 0, 0]
parameters:
  push: {{value: 0, unit: N, binding: input}}
bodies:
  mass: {{mass: 2, centre_of_mass: [0, 0, 0]}}
joints:
  slide: {{kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}}
forces:
  hand: {{kind: joint_force, joint: slide, law: "{law}"}}
outputs: [mass.x, mass.vx, mass.ax]
scenes:
  free: {{end: 1, output_step: 0.1}}
"""


def table(course: Polynomial, times: Any = (0.0, 0.4, 1.0)) -> dict[str, list[float]]:
    """A cubic, which goes through its samples with its rates."""
    return {"t": list(times), "value": [float(course(t)) for t in times], "rate": [float(course.deriv()(t)) for t in times]}


def guided(lift: tuple[Array, Array, Array], t: Array) -> dict[str, Array]:
    """The guide's effect: the arm's angle, its rate, and the vertical acceleration of its centre of mass, by an input and its rates."""
    u, rate, acceleration = lift
    angle = u + 0.2 * t * u**2
    angle_rate = 0.2 * u**2 + (1 + 0.4 * t * u) * rate
    spin = 0.8 * u * rate + 0.4 * t * rate**2 + (1 + 0.4 * t * u) * acceleration
    return {
        "shoulder.angle": angle, "shoulder.angle_rate": angle_rate, "arm.az": -0.5 * (np.cos(angle) * spin - np.sin(angle) * angle_rate**2)
    }


def orders(course: Polynomial, t: Array) -> tuple[Array, Array, Array]:
    """A course with its first and second derivative."""
    return course(t), course.deriv()(t), course.deriv(2)(t)
