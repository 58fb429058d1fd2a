"""Equal steps over the first touch of contacts that slide, roll and stick: they go on, and meet the motion of steps that are chosen."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate

Array = NDArray[np.float64]

_LAW = """
submodels: {contact_law: {include: library/contact_law}}
instances:
  grip:
    use: contact_law
    with: {deflection: sole.deflection, deflection_rate: sole.deflection_rate, vx: sole.vx, vy: sole.vy, %s}
"""
#: A ball that falls on a plane with a spin: its friction's spring is as short as the load is small.
BALL = (
    """
cutjoint: 1
name: ball
gravity: [0, 0, -9.81]
bodies: {ball: {mass: 1, centre_of_mass: [0, 0, 0.35], inertia: [0.016, 0.016, 0.016]}}
joints: {p: {kind: planar, bodies: [ground, ball], at: [0, 0, 0.35], axis: [0, -1, 0]}}
forces:
  sole: {kind: contact, bodies: [ground, ball], at: [0, 0, 0], normal: z, along: x, centre: [0, 0, 0.35], radius: 0.2,
         force: [grip.Fx, grip.Fy, grip.Fz]}
outputs: [ball.x, ball.z]
scenes: {run: {end: 0.5, output_step: 0.01, rates: {p.angle_rate: 12}}}
"""
    + _LAW % "stiffness: 1.0e+5, damping: 0.3, friction: 0.4"
)
#: A foot that falls, slides to a halt and sticks.
FOOT = (
    """
cutjoint: 1
name: foot
gravity: [0, 0, -9.81]
bodies:
  carriage: {mass: 2, centre_of_mass: [0, 0, 0.3]}
  foot: {mass: 1, centre_of_mass: [0, 0, 0.1]}
joints:
  along: {kind: prismatic, bodies: [ground, carriage], at: [0, 0, 0.3], axis: x}
  down: {kind: prismatic, bodies: [carriage, foot], at: [0, 0, 0.1], axis: z}
forces:
  sole: {kind: contact, bodies: [ground, foot], at: [0, 0, 0], normal: z, along: x, centre: [0, 0, 0.06], radius: 0.05,
         force: [grip.Fx, grip.Fy, grip.Fz]}
outputs: [foot.x, foot.z]
scenes: {run: {end: 0.5, output_step: 0.01, rates: {along.displacement_rate: 0.4}}}
"""
    + _LAW % "stiffness: 5.0e+5, damping: 1, friction: 0.6"
)
#: A roller that a spring presses on an eccentric cam, from which it begins away.
CAM = (
    """
cutjoint: 1
name: cam
gravity: [0, 0, -9.81]
bodies:
  shaft: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.001, 0.001, 0.001]}
  stem: {mass: 0.4, centre_of_mass: [0, 0, 0.08]}
  roller: {mass: 0.05, centre_of_mass: [0, 0, 0.05], inertia: [1e-5, 1e-5, 1e-5]}
joints:
  cam: {kind: revolute, bodies: [ground, shaft], at: [0, 0, 0], axis: y, guide: 30*t}
  slide: {kind: prismatic, bodies: [ground, stem], at: [0, 0, 0.08], axis: z, spring: {stiffness: 5 kN/m, damping: 20, preload: -60}}
  pin: {kind: revolute, bodies: [stem, roller], at: [0, 0, 0.06], axis: y}
forces:
  sole: {kind: contact, bodies: [shaft, roller], at: [10 mm, 0, 0], axis: y, cylinder: 40 mm, centre: [0, 0, 0.06], radius: 20 mm,
         force: [grip.Fx, grip.Fy, grip.Fz]}
outputs: [stem.z, pin.angle]
scenes: {run: {end: 0.2, output_step: 0.01, positions: {slide.displacement: 1 mm}}}
"""
    + _LAW % "stiffness: 2e8, exponent: 1, damping: 0.3, friction: 0.2, tangential: 1e5"
)
#: A four-bar that falls until a sphere on its coupler hits a stop, on which it slides.
FOUR_BAR = (
    """
cutjoint: 1
name: four
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 1, centre_of_mass: [0.1, 0, 0.35], inertia: [0.01, 0.01, 0.01]}
  coupler: {mass: 2, centre_of_mass: [0.4, 0, 0.45], inertia: [0.05, 0.05, 0.05]}
  rocker: {mass: 1, centre_of_mass: [0.7, 0, 0.25], inertia: [0.02, 0.02, 0.02]}
joints:
  a: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0.3], axis: y}
  b: {kind: revolute, bodies: [crank, coupler], at: [0.2, 0, 0.4], axis: y}
  c: {kind: revolute, bodies: [coupler, rocker], at: [0.7, 0, 0.5], axis: y}
  d: {kind: revolute, bodies: [ground, rocker], at: [0.7, 0, 0], axis: y}
forces:
  sole: {kind: contact, bodies: [ground, coupler], at: [0, 0, 0.2], normal: z, along: x, centre: [0.3, 0, 0.3], radius: 0.05,
         force: [grip.Fx, grip.Fy, grip.Fz]}
outputs: [coupler.x, coupler.z]
scenes: {run: {end: 0.3, output_step: 0.01}}
"""
    + _LAW % "stiffness: 1.0e+6, damping: 0.5, friction: 0.4"
)
#: A ball with a spin on a carriage, two slides and an arm to the ground, which close a loop.
LINK = (
    """
cutjoint: 1
name: link
gravity: [0, 0, -9.81]
bodies:
  arm: {mass: 0.5, centre_of_mass: [0.25, 0, 0.5], inertia: [0.01, 0.01, 0.01]}
  ball: {mass: 1, centre_of_mass: [0.5, 0, 0.4], inertia: [0.016, 0.016, 0.016]}
  carriage: {mass: 0.3, centre_of_mass: [0.5, 0, 0.5]}
  rail: {mass: 0.3, centre_of_mass: [0.5, 0, 0.6]}
joints:
  p: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0.5], axis: y}
  q: {kind: revolute, bodies: [arm, carriage], at: [0.5, 0, 0.5], axis: y}
  x: {kind: prismatic, bodies: [ground, rail], at: [0.5, 0, 0.6], axis: x}
  z: {kind: prismatic, bodies: [rail, carriage], at: [0.5, 0, 0.5], axis: z}
  w: {kind: revolute, bodies: [carriage, ball], at: [0.5, 0, 0.4], axis: y}
forces:
  sole: {kind: contact, bodies: [ground, ball], at: [0, 0, 0], normal: z, along: x, centre: [0.5, 0, 0.4], radius: 0.2,
         force: [grip.Fx, grip.Fy, grip.Fz]}
outputs: [ball.x, ball.z]
scenes: {run: {end: 0.4, output_step: 0.01, rates: {w.angle_rate: 12}}}
"""
    + _LAW % "stiffness: 1.0e+5, damping: 0.3, friction: 0.4"
)
MODELS = {"ball": BALL, "foot": FOOT, "cam": CAM, "four_bar": FOUR_BAR, "link": LINK}
#: Largest errors (m, m; m, rad) by length of step (s); 1 ms does not resolve the bounces of the roller.
BOUNDS = {
    "ball": {1e-3: (1e-4, 5e-4), 1e-4: (1e-6, 5e-6)}, "foot": {1e-3: (1e-4, 2e-4), 1e-4: (1e-6, 2e-6)},
    "cam": {1e-3: (0.05, 3.0), 1e-5: (2e-5, 0.02)},
    "four_bar": {1e-3: (5e-5, 3e-4), 1e-4: (1e-6, 5e-6)}, "link": {1e-3: (2e-4, 1e-3), 1e-4: (2e-6, 1e-5)},
}  # fmt: skip


@cache
def _artifact(name: str, method: str) -> Artifact:
    model = read_model_text(MODELS[name], f"{name}.yaml")
    return compile_interpreted(model, find_scene(model, None), method=method)


@cache
def _known(name: str) -> Array:
    run = simulate(_artifact(name, "recursive"), integrator="dop853", tolerance=1e-10, error=False)
    return _rows(run)


def _rows(run: Trajectory) -> Array:
    return np.column_stack(list(run.columns.values()))


@pytest.mark.parametrize(("method", "integrator", "events"), [
    ("recursive", "trapezoidal", "crossed"), ("recursive", "trapezoidal", "located"), ("recursive-newton", "trapezoidal", "crossed"),
    ("recursive-newton", "generalised-alpha", "crossed"),
])  # fmt: skip
@pytest.mark.parametrize("name", BOUNDS)
def test_equal_steps_go_on_over_the_first_touch(name: str, method: str, integrator: str, events: str) -> None:
    for dt, bounds in BOUNDS[name].items():
        run = simulate(_artifact(name, method), integrator=integrator, dt=dt, error=False, events=events)
        assert (np.abs(_rows(run) - _known(name)).max(axis=0) < bounds).all(), dt


@pytest.mark.parametrize("method", ["augmented", "classical"])
@pytest.mark.parametrize("name", ["ball", "foot", "four_bar", "link"])
def test_lagrangian_steps_go_on_over_the_first_touch(name: str, method: str) -> None:
    for dt, bounds in BOUNDS[name].items():
        run = simulate(_artifact(name, method), integrator="trapezoidal", dt=dt, error=False)
        assert (np.abs(_rows(run) - _known(name)).max(axis=0) < bounds).all(), dt


@pytest.mark.parametrize(("rate", "method", "settings"), [
    (0.13, "recursive", {"integrator": "dormand-prince", "tolerance": 1e-10}),  # the spring's relaxation near flight divided by zero
    (0.2, "recursive", {"integrator": "trapezoidal", "dt": 1e-4, "events": "located"}),
    (0.45, "recursive-newton", {"integrator": "trapezoidal", "dt": 7e-5, "events": "located"}),  # rounding was an event
    (0.7, "recursive", {"integrator": "trapezoidal", "dt": 7e-5, "events": "located"}),
])  # fmt: skip
def test_a_foot_slides_to_a_halt_from_any_speed(rate: float, method: str, settings: Mapping[str, Any]) -> None:
    row = 143 * settings.get("dt", 7e-5)
    text = FOOT.replace("rate: 0.4", f"rate: {rate}").replace("end: 0.5, output_step: 0.01", f"end: {50 * row}, output_step: {row}")
    model = read_model_text(text, "foot.yaml")
    rows = {}
    for way, how in ((method, settings), ("recursive", {"integrator": "dop853", "tolerance": 1e-10})):
        rows[str(how)] = _rows(simulate(compile_interpreted(model, find_scene(model, None), method=way), error=False, **how))
    run, known = rows.values()
    assert np.abs(run - known).max() < 3e-6
