"""Modes, equilibria and free directions as motions on screen: their shapes have closed forms, and their loops stay closed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from tests.analysis.test_modes import pendulums
from tests.conftest import MODELS, needs_cpp
from tests.view.browser import Page
from tests.view.conftest import call
from tests.view.files import Array, Gltf
from tests.view.pages import PICTURES, require_silence

PRESS = MODELS / "press.yaml"


def motion(gltf: Gltf, number: int, body: str) -> Array:
    """The places of a body in a motion, (frames, 3)."""
    animation = gltf.document["animations"][number]
    for channel in animation["channels"]:
        if (gltf.document["nodes"][channel["target"]["node"]]["name"], channel["target"]["path"]) == (body, "translation"):
            return gltf.numbers(animation["samplers"][channel["sampler"]]["output"])
    raise KeyError(body)


@pytest.fixture(scope="module")
def modes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("modes")
    (folder / "model.yaml").write_text(pendulums() + "scenes: {rest: {end: 1, output_step: 0.1}}\n", encoding="utf-8")
    for file in ("modes.glb", "modes.html"):
        call("modes", folder / "model.yaml", "--view", folder / file)
    return folder


@needs_cpp
def test_modes_have_their_shapes(modes: Path) -> None:
    """Of two equal pendulums the lower one's angle from the vertical is +-sqrt 2 times the upper one's."""
    gltf = Gltf.read(modes / "modes.glb")
    assert [a["name"] for a in gltf.document["animations"]] == ["1: 0.3815 Hz", "2: 0.9211 Hz"]
    for number, ratio in ((0, np.sqrt(2)), (1, -np.sqrt(2))):
        upper, lower = (motion(gltf, number, body) for body in ("upper", "lower"))
        first, second = (np.arctan2(way[:, 0], -way[:, 1]) for way in (upper, lower - upper))
        assert np.ptp(first) > 0.02
        assert second == pytest.approx(ratio * first, abs=2e-6)
        assert abs(first[0]) == pytest.approx(np.abs(first).max(), abs=1e-6)
        assert first[0] == pytest.approx(-first[len(first) // 2], abs=1e-6)


@needs_cpp
def test_a_page_plays_its_motions_again_and_again(modes: Path, browser: Page) -> None:
    browser.open(modes / "modes.html")
    assert browser.run("cutjoint.shown().playing")
    browser.run("cutjoint.play(false)")
    seen = []
    for name in ("1: 0.3815 Hz", "2: 0.9211 Hz", "1: 0.3815 Hz"):
        browser.run(f"cutjoint.motion('{name}')")
        seen.append(browser.run("cutjoint.project('lower', 0)"))
        facts = browser.run("[...document.querySelectorAll('#facts tr')].map((line) => line.cells[0].textContent)")
        assert facts[:4] == ["eigenvalue, 1/s", "frequency, Hz", "damping ratio", "time constant, s"]
        assert {"top.angle", "middle.angle"} == set(facts[4:])
    assert seen[0] == seen[2] != seen[1]
    browser.picture(PICTURES / "modes.png")
    browser.run("document.getElementById('speed').value = '5'; cutjoint.setTime(1.99); cutjoint.play(true)")
    browser.run("new Promise((done) => { const wait = () => cutjoint.shown().time < 1.9 ? done(1) : setTimeout(wait, 20); wait(); })")
    assert browser.run("cutjoint.shown().playing")
    require_silence(browser)


@needs_cpp
def test_the_equilibrium_is_reached_with_closed_loops(tmp_path: Path) -> None:
    call("equilibrium", PRESS, "--view", tmp_path / "rest.glb")
    found = cutjoint.find_equilibrium(PRESS)
    gltf = Gltf.read(tmp_path / "rest.glb")
    slider, rod, crank = (motion(gltf, 0, body) for body in ("slider", "rod", "crank"))
    middle = len(slider) // 2
    assert slider[0] == pytest.approx([0.3, 0, 0], abs=1e-6)
    for body, way in (("slider", slider), ("rod", rod), ("crank", crank)):
        assert way[middle] == pytest.approx([found[f"{body}.{axis}"] for axis in "xyz"], abs=1e-6)
    assert np.abs(np.linalg.norm(slider - rod, axis=1) - np.sqrt(0.1) / 2).max() < 1e-6
    assert np.abs(rod - (2 * crank + slider) / 2).max() < 1e-6
    assert np.abs(slider[:, 1:]).max() < 1e-6


def test_free_directions_keep_loops_closed(tmp_path: Path) -> None:
    call("check", PRESS, "--view", tmp_path / "free.glb")
    gltf = Gltf.read(tmp_path / "free.glb")
    (animation,) = gltf.document["animations"]
    assert animation["name"].startswith("free: ")
    slider, rod, crank = (motion(gltf, 0, body) for body in ("slider", "rod", "crank"))
    assert np.ptp(slider[:, 0]) > 0.005
    assert np.abs(rod - (2 * crank + slider) / 2).max() < 1e-6
    assert np.abs(slider[:, 1:]).max() < 1e-6
    assert crank[0] == pytest.approx(crank[-1], abs=1e-6)


@pytest.mark.parametrize("command", ["modes", "equilibrium", "check"])
def test_a_page_has_its_ending(command: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(main, [command, str(PRESS), "--view", str(tmp_path / "x.txt")])
    assert result.exit_code == 2
    assert "x.txt: no such kind of file; write a name that ends in .html or .glb" in result.output
    assert list(tmp_path.iterdir()) == []
