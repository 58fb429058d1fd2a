"""A rack that an input guides, and a wheel that a tie rod turns by it: a loop that follows what a host holds."""

from __future__ import annotations

from math import sin

#: The law of the scene "lawful", which begins at rest.
LAW = "0.02*sin(3*t)**2"


def law(t: float) -> float:
    """The law of the input, for a host."""
    return 0.02 * sin(3 * t) ** 2


#: The stabilisation is as slow as that of the scenes of the Iltis: a gap closes in a tenth of a second.
_NUMERICS = "numerics: {{penalty: 1.0e+7, dt: 0.001{more}}}"


def steered_text(more: str = "") -> str:
    """The model's text; ``more`` are other settings of its scenes."""
    numerics = _NUMERICS.format(more=more)
    return f"""
cutjoint: 1
name: steered
gravity: [0, 0, -9.81]
parameters:
  rack: {{value: 0, unit: m, binding: input}}
  push: {{value: 0, unit: N, binding: input}}
bodies:
  cart: {{mass: 20, centre_of_mass: [0, 0, 0], inertia: [2, 2, 2]}}
  slider: {{mass: 4, centre_of_mass: [0.1, 0, 0], inertia: [0.01, 0.01, 0.01]}}
  wheel: {{mass: 3, centre_of_mass: [0.05, 0.5, 0], inertia: [0.05, 0.05, 0.08]}}
  rod: {{mass: 0.3, centre_of_mass: [0.12, 0.3, 0], inertia: [0.004, 0.0001, 0.004]}}
joints:
  way: {{kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [0, 1, 0]}}
  rail: {{kind: prismatic, bodies: [cart, slider], at: [0.1, 0, 0], axis: [0, 1, 0], guide: rack}}
  pivot: {{kind: revolute, bodies: [cart, wheel], at: [0, 0.5, 0], axis: [0, 0, 1]}}
  inner: {{kind: revolute, bodies: [slider, rod], at: [0.1, 0.1, 0], axis: [0, 0, 1]}}
  outer: {{kind: revolute, bodies: [rod, wheel], at: [0.14, 0.5, 0], axis: [0, 0, 1], cut: true}}
forces:
  hand: {{kind: joint_force, joint: way, law: "push - 40*position - 3*rate"}}
outputs: [rail.displacement, rail.displacement_rate, pivot.angle, pivot.angle_rate, cart.y, cart.vy]
scenes:
  free: {{end: 1, output_step: 0.01, {numerics}}}
  lawful: {{inputs: {{rack: "{LAW}"}}, end: 1, output_step: 0.01, {numerics}}}
"""
