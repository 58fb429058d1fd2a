"""Equal steps over the first touch of a contact that slides: where they have no end, the message names the cause and what goes on."""

from __future__ import annotations

import re

import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model_text
from cutjoint.run.failures import FailedRunError
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate

#: A ball that falls on a plane with a spin: its friction's spring is as short as the load is small.
BALL = """
cutjoint: 1
name: ball
gravity: [0, 0, -9.81]
bodies: {ball: {mass: 1, centre_of_mass: [0, 0, 0.35], inertia: [0.016, 0.016, 0.016]}}
joints: {p: {kind: planar, bodies: [ground, ball], at: [0, 0, 0.35], axis: [0, -1, 0]}}
forces:
  sole: {kind: contact, bodies: [ground, ball], at: [0, 0, 0], normal: z, along: x, centre: [0, 0, 0.35], radius: 0.2,
         force: [grip.Fx, grip.Fy, grip.Fz]}
submodels: {contact_law: {include: library/contact_law}}
instances:
  grip:
    use: contact_law
    with: {deflection: sole.deflection, deflection_rate: sole.deflection_rate, vx: sole.vx, vy: sole.vy, stiffness: 1.0e+5,
           damping: 0.3, friction: 0.4}
outputs: [ball.z]
scenes: {run: {end: 0.3, output_step: 0.01, rates: {p.angle_rate: 12}}}
"""
SAID = "a force may change its formula within the step, as at the first touch of a contact: use an integrator that locates it"


@pytest.mark.parametrize(("method", "cure"), [
    ("recursive", "integrator dormand-prince"), ("recursive-newton", "integrator radau5"),
    ("augmented", "method recursive-newton with integrator radau5"),
])  # fmt: skip
def test_what_goes_on_over_the_first_touch_is_named(method: str, cure: str) -> None:
    model = read_model_text(BALL, "ball.yaml")
    artifact = compile_interpreted(model, find_scene(model, None), method=method)
    with pytest.raises(FailedRunError) as failed:
        simulate(artifact, integrator="trapezoidal", dt=1e-3, error=False)
    said = str(failed.value)
    assert SAID in said
    assert re.search(rf"tried up to \S+ s: [^;]*{cure}\b[^;]* goe?s? on", said), said
