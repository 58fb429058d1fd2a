"""Instants at which inputs and guides go over to another formula."""

from __future__ import annotations

import pytest

from cutjoint.formulate.events import jump_times
from cutjoint.model.read import read_model, read_model_text
from tests.conftest import ROOT

TURNED = """\
cutjoint: 1
name: turned
gravity: [0, 0, 0]
parameters: {late: {value: 0.5, binding: param}}
bodies: {crank: {mass: 1, centre_of_mass: [0, 0, 1], inertia: [1, 1, 1]}}
joints: {pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0], guide: "GUIDE"}}
outputs: [crank.x]
scenes: {turn: {end: 1}}
"""


def test_the_rack_of_the_slalom_jumps_twice() -> None:
    model = read_model(ROOT / "models" / "iltis.yaml")
    assert jump_times(model, model.scenes["simul3"]) == (1.0, 3.0)
    assert jump_times(model, model.scenes["simul2"]) == ()


@pytest.mark.parametrize(
    ("guide", "times"),
    [
        ("where(t < 0.25, 0, t - 0.25)", (0.25,)),
        ("where(2*t >= late, 0, 1 - 2*t)", (0.25,)),
        ("max(0, 4*t - 1)", (0.25,)),
        ("where(t < 0.25, 0, where(t < 0.75, t - 0.25, 0.5))", (0.25, 0.75)),
        ("sin(t)", ()),
        ("where(t**2 < 0.25, 0, t)", ()),
    ],
)
def test_conditions_that_are_linear_in_time(guide: str, times: tuple[float, ...]) -> None:
    model = read_model_text(TURNED.replace("GUIDE", guide), "turned.yaml")
    assert jump_times(model, model.scenes["turn"]) == pytest.approx(times, abs=1e-12)
