"""Rest on stiff contacts, from gaps of all sizes, beside closed forms."""

from __future__ import annotations

import pytest

from cutjoint.model.read import read_model_text
from cutjoint.tasks.states import MechanismState, find_scene_equilibrium
from tests.conftest import needs_cpp

pytestmark = needs_cpp

#: A mass on a slide and one at the end of a swinging arm, over ground at different heights.
TEXT = """
cutjoint: 1
name: rest
gravity: [0, 0, -9.81]
bodies:
  mass: {mass: 0.45, centre_of_mass: [0, 0, HEIGHT], inertia: [1, 1, 1]}
  bob: {mass: 80, centre_of_mass: [5, 0, 1.3], inertia: [1, 1, 1]}
joints:
  slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 1], axis: z}
  arm: {kind: revolute, bodies: [ground, bob], at: [4, 0, 1.3], axis: y}
forces:
  foot: {kind: contact, bodies: [ground, mass], at: [0, 0, 0], normal: z, along: x, centre: [0, 0, HEIGHT], radius: 1, force: [0, 0, LAW]}
  heel:
    {kind: contact, bodies: [ground, bob], at: [0, 0, 0], normal: z, centre: [5, 0, 1.3], radius: 1, force: [0, 0, 2e4*deflection]}
outputs: [foot.Fz]
scenes: {run: {end: 1, pose: equilibrium}}
"""  # fmt: skip


def rest(gap: float, law: str) -> MechanismState:
    model = read_model_text(TEXT.replace("HEIGHT", repr(1 + gap)).replace("LAW", f'"{law}"'), "rest.yaml")
    return find_scene_equilibrium(model, model.scenes["run"])


@pytest.mark.parametrize(("stiffness", "exponent", "gap"), [
    (1e3, 1, 0.3), (1e7, 1, 1e-6), (1e7, 1.5, 1e-3), (2e8, 1, 8e-4), (1e10, 1, 0.3), (1e10, 1.5, 1e-6),
])  # fmt: skip
def test_a_mass_sinks_in_by_its_weight(stiffness: float, exponent: float, gap: float) -> None:
    found = rest(gap, f"{stiffness!r}*deflection**{exponent}")
    assert found["foot.Fz"] == pytest.approx(0.45 * 9.81, rel=1e-4)
    assert found["foot.deflection"] == pytest.approx((0.45 * 9.81 / stiffness) ** (1 / exponent), rel=1e-4)
    assert found["heel.Fz"] == pytest.approx(80 * 9.81, rel=1e-4)
