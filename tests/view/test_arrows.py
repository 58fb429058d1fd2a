"""Forces and reactions as arrows: of a mass that hangs in balance, where each is known by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.conftest import needs_cpp
from tests.view.browser import Page
from tests.view.conftest import Shown, show
from tests.view.files import Gltf
from tests.view.pages import PICTURES, require_silence

#: A mass of 2 kg on a vertical rail, a spring above it, pulled sideways by 5 N; an arm of 1 kg that hangs beside it; y is up.
HANGING = """
cutjoint: 1
name: hanging
gravity: [0, -10, 0]
bodies:
  mass: {mass: 2, centre_of_mass: [0, 1, 0], inertia: [0.1, 0.1, 0.1]}
  arm: {mass: 1, centre_of_mass: [1, 1.5, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  rail: {kind: prismatic, bodies: [ground, mass], at: [0, 1, 0], axis: [0, 1, 0]}
  hinge: {kind: revolute, bodies: [ground, arm], at: [1, 2, 0], axis: [0, 0, 1]}
forces:
  spring: {kind: point_spring, bodies: [ground, mass], from: [0, 2, 0], to: [0, 1, 0], law: {stiffness: 200, damping: 1, free_length: 1}}
  pull: {kind: load, body: mass, at: [0, 1, 0], force: [5, 0, 0]}
  unasked: {kind: load, body: arm, at: [1, 1.5, 0], force: [0, 0, 1]}
reactions:
  hold: {joint: rail, axes_of: ground, direction: [1, 0, 0]}
  hang: {joint: hinge, axes_of: arm}
outputs: [spring.force, pull.Fx, pull.Fy, pull.Fz, unasked.Fz, hold.force, hang.Fx, hang.Fy, hang.Fz, mass.y]
scenes: {rest: {end: 0.1, output_step: 0.05, pose: equilibrium, numerics: {dt: 0.01}}}
"""


@pytest.fixture(scope="module")
def hanging(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    return show(tmp_path_factory.mktemp("hanging"), HANGING)


@needs_cpp
@pytest.mark.parametrize(("name", "at", "along", "newton"), [
    ("spring", [0, 0.9, 0], [0, 1, 0], 20.0), ("pull", [0, 0.9, 0], [1, 0, 0], 5.0), ("hold", [0, 0.9, 0], [-1, 0, 0], 5.0),
    ("hang", [1, 2, 0], [0, 10 / np.sqrt(101), -1 / np.sqrt(101)], np.sqrt(101)),
])  # fmt: skip
def test_forces_on_followers(name: str, at: list[float], along: list[float], newton: float, hanging: Shown, browser: Page) -> None:
    """The spring is 20 N/(200 N/m) longer than free; the load that is no output whole is no arrow, but the hinge bears it."""
    browser.open(hanging.page)
    seen = browser.run(f"cutjoint.arrow('{name}', 0.1)")
    assert seen["newton"] == pytest.approx(newton, rel=1e-5)
    assert seen["at"] == pytest.approx(at, abs=1e-5)
    assert seen["along"] == pytest.approx(along, abs=1e-5)
    require_silence(browser)


@needs_cpp
def test_arrows_are_shown_on_request(hanging: Shown, browser: Page) -> None:
    browser.open(hanging.page)
    before = browser.picture(PICTURES / "arrows-without.png").read_bytes()
    browser.run("document.getElementById('forces').click(); document.getElementById('names').click()")
    browser.settle()
    names = browser.run("[...document.querySelectorAll('#labels .force')].map((label) => label.textContent)")
    assert names
    assert set(names) <= {"spring 20 N", "pull 5 N", "hold 5 N", "hang 10 N"}
    assert browser.picture(PICTURES / "arrows.png").read_bytes() != before
    assert not any("force" in node["name"] or "reaction" in node["name"] for node in Gltf.read(hanging.glb).document["nodes"])
    require_silence(browser)
