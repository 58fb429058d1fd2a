"""Pages in a browser without a window: what is seen is where it should be, and nothing is asked of a network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from cutjoint.package.locations import templates_folder
from cutjoint.view import meshes
from cutjoint.view.ghost import GhostRun, read_page
from cutjoint.view.gltf import write_gltf
from cutjoint.view.graph import Graph
from cutjoint.view.motions import Motion
from cutjoint.view.page import DRIVING, SCRIPTS, PlotColumn, make_page
from cutjoint.view.records import Drawing, Node, Part
from tests.conftest import needs_cpp
from tests.view.browser import Page
from tests.view.conftest import Shown, call
from tests.view.files import read_csv
from tests.view.pages import PICTURES, projected, require_silence


@needs_cpp
@pytest.mark.parametrize(("run", "bodies"), [
    ("press", ("crank", "rod", "slider")), ("iltis", ("chassis", "front_left.carrier", "rear_right.tie_rod")),
])  # fmt: skip
def test_bodies_are_seen_where_the_table_says(run: str, bodies: tuple[str, ...], browser: Page, request: pytest.FixtureRequest) -> None:
    shown: Shown = request.getfixturevalue(run)
    table = read_csv(shown.table)
    browser.open(shown.page)
    for row in (0, table["t"].size // 3, table["t"].size - 1):
        for body in bodies:
            seen = browser.run(f"cutjoint.project('{body}', {table['t'][row]})")
            expected = projected(browser, np.array([table[f"{body}.{axis}"][row] for axis in "xyz"]))
            assert np.abs(seen - expected).max() < 1.0
        browser.picture(PICTURES / f"{run}-{row}.png")
    require_silence(browser)


@needs_cpp
def test_bodies_have_their_colours_in_the_picture(press: Shown, browser: Page) -> None:
    browser.open(press.page)
    top = browser.run("document.getElementById('picture').getBoundingClientRect().top")
    for time in (0.0, 0.1, 1.0):
        pixels = {body: browser.run(f"cutjoint.project('{body}', {time})") for body in ("crank", "rod", "slider")}
        picture = imread(browser.picture(PICTURES / "press-colours.png"))
        crank, rod, slider = (picture[round(y + top), round(x), :3] for x, y in pixels.values())
        assert crank.argmax() == 2, "blue"
        assert rod[0] > rod[1] > rod[2], "orange"
        assert slider.argmax() == 1, "green"


@needs_cpp
def test_a_click_chooses_a_body_and_lists_its_outputs(press: Shown, browser: Page) -> None:
    browser.open(press.page)
    x, y = browser.run("cutjoint.project('slider', 0.5)")
    top = browser.run("document.getElementById('picture').getBoundingClientRect().top")
    browser.click(x, y + top)
    assert browser.run("cutjoint.shown().body") == "slider"
    names = browser.run("[...document.querySelectorAll('#values td:first-child')].map((cell) => cell.textContent)")
    assert names == ["slider.x", "slider.y", "slider.z", "slider.vx", "spring.force"]
    table = read_csv(press.table)
    value = browser.run("document.querySelector('#values td + td').textContent")
    assert float(value.split()[0]) == pytest.approx(table["slider.x"][50], abs=1e-4)
    require_silence(browser)


@needs_cpp
def test_it_plays_to_the_end_and_the_cursor_follows(press: Shown, browser: Page) -> None:
    browser.open(press.page, dark=True)
    browser.run("document.getElementById('speed').value = '5'; cutjoint.play(true)")
    browser.run("new Promise((done) => { const wait = () => cutjoint.shown().playing ? setTimeout(wait, 50) : done(1); wait(); })")
    assert browser.run("cutjoint.shown().time") == pytest.approx(2.0)
    ends = browser.run("[0, 1, 2].map((t) => (cutjoint.setTime(t), document.querySelector('.now').getBoundingClientRect().left))")
    assert ends[1] - ends[0] == pytest.approx(ends[2] - ends[1], abs=1.0)
    assert ends[2] - ends[0] > 100
    browser.picture(PICTURES / "press-dark.png")
    require_silence(browser)


@needs_cpp
def test_a_body_that_is_followed_stays_where_it_is_in_the_picture(iltis: Shown, browser: Page) -> None:
    browser.open(iltis.page)
    assert browser.run("document.getElementById('follow').value") == "chassis"
    first, later = (np.array(browser.run(f"cutjoint.project('chassis', {time})")) for time in (0.0, 5.0))
    assert np.abs(first - later).max() < 1.0
    browser.run("const list = document.getElementById('follow'); list.value = ''; list.dispatchEvent(new Event('change'))")
    assert np.abs(browser.run("cutjoint.project('chassis', 0)") - later).max() > 100.0


@needs_cpp
def test_names_do_not_overlap(iltis: Shown, browser: Page) -> None:
    browser.open(iltis.page)
    browser.run("document.getElementById('names').click(); cutjoint.choose('front_left.carrier')")
    browser.picture(PICTURES / "iltis-names.png")
    sides = "(label) => { const b = label.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; }"
    boxes = browser.run(f"[...document.querySelectorAll('#labels span')].map({sides})")
    assert len(boxes) > 3
    overlaps = [
        (one, other) for i, one in enumerate(boxes) for other in boxes[:i]
        if one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
    ]  # fmt: skip
    assert overlaps == []


#: A crank and a rod that a guide pulls apart until they are in line, at x = 0.1 + sqrt(0.1).
LOCKED = """
cutjoint: 1
name: locked
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 2, centre_of_mass: [0, 0, 0.05], inertia: [0.002, 0.002, 0.001]}
  rod: {mass: 1, centre_of_mass: [0.15, 0, 0.05], inertia: [0.001, 0.008, 0.008]}
  slider: {mass: 3, centre_of_mass: [0.3, 0, 0]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  elbow: {kind: revolute, bodies: [crank, rod], at: [0, 0, 0.1], axis: [0, 1, 0]}
  wrist: {kind: revolute, bodies: [rod, slider], at: [0.3, 0, 0], axis: [0, 1, 0]}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0.3, 0, 0], axis: [1, 0, 0], guide: 0.4*t*t}
outputs: [pin.angle, rod.x]
scenes: {pull: {end: 2, output_step: 0.1, numerics: {dt: 0.001}}}
"""


@needs_cpp
def test_a_run_that_failed_opens_on_its_last_step(browser: Page, tmp_path: Path) -> None:
    model, page = tmp_path / "locked.yaml", tmp_path / "locked.html"
    model.write_text(LOCKED, encoding="utf-8")
    options = ("--method", "recursive-newton", "--no-error", "--view", page)
    message = call("simulate", model, *options, "--out", tmp_path / "run.csv", status=1)
    browser.open(page)
    time = browser.run("cutjoint.shown().time")
    locked = np.sqrt((0.1 + np.sqrt(0.1) - 0.3) / 0.4)
    assert locked - 0.003 < time < locked, "each step has a row, though the table has one in a hundred"
    text, place = browser.run("['stopped', 'place'].map((id) => document.getElementById(id).textContent)")
    assert text in message
    assert "worst at 'elbow." in text
    assert place == "locked.yaml:11"
    x = 0.3 + 0.4 * time**2  # where two circles meet: the crank's end
    along = (x**2 + 0.01 - 0.1) / (2 * x)
    elbow = np.array([along, 0.0, np.sqrt(0.01 - along**2)])
    seen = browser.run("cutjoint.mark()")
    assert np.abs(seen - projected(browser, elbow)).max() < 1.0
    assert browser.run("[...document.querySelectorAll('#labels .failed')].map((e) => e.textContent)") == [text.split("'")[1]]
    browser.picture(PICTURES / "locked.png")
    browser.run("document.getElementById('slowly').click()")
    assert browser.run("cutjoint.shown().playing")
    assert time - 0.05 < browser.run("cutjoint.shown().time") < time
    require_silence(browser)


#: Names that would run in a page that took them for more than text.
HOSTILE = (
    "</script><script>window.owned = 1</script>", "<img src=x onerror=window.owned=1>", "\"'`${window.owned=1}", "--><!--<script>",
    "\u2028{{ 1 }}",
)  # fmt: skip


def hostile_page(file: Path, motions: Sequence[Motion] = (), ghost: GhostRun | None = None, graph: Graph | None = None) -> Path:
    """A page whose names are all hostile."""
    t, part = np.linspace(0.0, 1.0, 3), Part(mesh=meshes.box(1, 1, 1), colour=(0.8, 0.2, 0.2))
    nodes = [
        Node(name=name, parts=(part,), translation=t[:, np.newaxis] * [i, 1.0, 0.0], about={kind: name})
        for kind in ("body", "mark") for i, name in enumerate(HOSTILE)
    ]  # fmt: skip
    columns = [PlotColumn(name=name, unit=name, bodies=[name], values=np.array([0.0, 1.0, np.nan])) for name in HOSTILE]
    camera = {"direction": [1, 1, 1], "extent": 2.0, "floor": -1.0, "road": False, "follow": HOSTILE[0]}
    glb = write_gltf(Drawing(name=HOSTILE[0], t=t, nodes=tuple(nodes), up=np.array([0.0, 0.0, 1.0])))
    failure = dict(zip(("text", "advice", "row", "element", "place"), (*HOSTILE[:4], HOSTILE[0]), strict=True)) | {"bodies": [HOSTILE[1]]}
    text = make_page(
        title=HOSTILE[0], scene=HOSTILE[1], note=HOSTILE[2], bodies=HOSTILE, glb=glb, t=t, columns=columns, camera=camera,
        failure=failure, motions=motions, ghost=ghost, graph=graph,
    )  # fmt: skip
    file.write_text(text, encoding="utf-8")
    return file


def test_names_are_text_whatever_they_are(browser: Page, tmp_path: Path) -> None:
    browser.open(hostile_page(tmp_path / "hostile.html"))
    browser.run("document.getElementById('names').click()")
    for name in HOSTILE:
        browser.run(f"cutjoint.choose(JSON.parse(document.getElementById('about').textContent).bodies[{HOSTILE.index(name)}])")
        assert browser.run("cutjoint.shown().body") == name
    assert browser.run("window.owned ?? 'nobody'") == "nobody"
    assert browser.run("document.querySelector('#labels .failed').textContent") == HOSTILE[2]
    assert browser.run("[document.title, document.querySelector('h1').textContent]") == [f"{HOSTILE[0]}, {HOSTILE[1]}", HOSTILE[0]]
    assert browser.run("document.querySelectorAll('script').length") == 5
    require_silence(browser)


def test_names_of_motions_are_text_too(browser: Page, tmp_path: Path) -> None:
    motions = [Motion(name=name, facts=[(HOSTILE[0], HOSTILE[1])], poses={}) for name in HOSTILE]
    browser.open(hostile_page(tmp_path / "hostile.html", motions))
    for i in range(len(HOSTILE)):
        browser.run(f"cutjoint.motion(JSON.parse(document.getElementById('about').textContent).motions[{i}].name)")
    assert browser.run("[...document.querySelectorAll('#facts td')].map((cell) => cell.textContent)") == [HOSTILE[0], HOSTILE[1]]
    assert browser.run("window.owned ?? 'nobody'") == "nobody"
    require_silence(browser)


def test_names_of_an_earlier_page_are_text_too(browser: Page, tmp_path: Path) -> None:
    earlier = read_page(hostile_page(tmp_path / "earlier.html"), "--ghost")
    assert earlier.name == f"earlier.html: {HOSTILE[0]}, {HOSTILE[1]}, {HOSTILE[2]}"
    browser.open(hostile_page(tmp_path / "hostile.html", ghost=earlier))
    assert browser.run("document.getElementById('over').textContent") == f"over {earlier.name}"
    assert browser.run("window.owned ?? 'nobody'") == "nobody"
    require_silence(browser)


def test_no_other_script_runs(browser: Page, tmp_path: Path) -> None:
    """The page's policy holds even if a text should once get out of its place."""
    file = hostile_page(tmp_path / "policy.html")
    text = file.read_text(encoding="utf-8").replace("<main>", "<script>window.owned = 1</script><main>")
    file.write_text(text, encoding="utf-8")
    browser.open(file)
    assert browser.run("window.owned ?? 'nobody'") == "nobody"
    assert any("Content Security Policy" in complaint for complaint in browser.complaints)
    browser.complaints.clear()


@pytest.mark.parametrize("file", sorted((templates_folder() / "view").rglob("*.js")), ids=lambda file: file.name)
def test_scripts_end_where_they_end(file: Path) -> None:
    text = file.read_text(encoding="utf-8").lower()
    assert "</script" not in text
    assert "<!--" not in text


def test_all_parts_of_the_script_are_in_the_page() -> None:
    assert sorted((*SCRIPTS, *DRIVING)) == sorted(file.stem for file in (templates_folder() / "view" / "page").glob("*.js"))


def test_the_libraries_have_their_licences() -> None:
    folder = templates_folder() / "view" / "vendor"
    licences, text = ((folder / name).read_text(encoding="utf-8") for name in ("LICENSES.txt", "libraries.min.js"))
    for owner in ("three.js authors", "Leon Sorokin"):
        assert owner in licences
        assert owner in text, "each page has them too"


@needs_cpp
def test_all_of_it_is_seen_from_the_start(press: Shown, browser: Page) -> None:
    browser.open(press.page, size=(900, 500))
    width, height = browser.run("cutjoint.eye().size")
    for time in (0.0, 0.1, 0.25, 2.0):
        for body in ("crank", "rod", "slider"):
            x, y = browser.run(f"cutjoint.project('{body}', {time})")
            assert 0 < x < width
            assert 0 < y < height
