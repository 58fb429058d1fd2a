"""The topology as a picture: each body and joint once, nothing that covers anything, and what a click tells."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest

from cutjoint.reduce.sequence import reduction_sequence
from cutjoint.topology.build import build_topology
from cutjoint.topology.reading import read_model
from cutjoint.view.graph import Graph, GraphBody, GraphLink, draw_graph
from cutjoint.view.states import show_reduction
from cutjoint.view.views import write_shown
from tests.conftest import MODELS
from tests.view.browser import Page
from tests.view.conftest import call
from tests.view.pages import PICTURES, require_silence
from tests.view.test_page import HOSTILE, hostile_page

NAMES = sorted(file.stem for file in MODELS.glob("*.yaml"))


def graph_of(name: str) -> Graph:
    return draw_graph(build_topology(read_model(MODELS / f"{name}.yaml")), (), {})


@pytest.mark.parametrize("name", NAMES)
def test_every_element_is_there_once(name: str) -> None:
    model, graph = read_model(MODELS / f"{name}.yaml"), graph_of(name)
    assert sorted(b.name for b in graph.bodies) == sorted(["ground", *(b.name for b in model.bodies)])
    assert sorted(link.name for link in graph.links) == sorted(e.name for e in (*model.joints, *model.gears))
    assert {link.name for link in graph.links if link.cut} == {e.name for e in build_topology(model).closing}


@pytest.mark.parametrize("name", NAMES)
def test_bodies_do_not_cover_each_other(name: str) -> None:
    graph = graph_of(name)
    boxes = [(b.x, b.y - 13, b.x + b.width, b.y + 13) for b in graph.bodies]
    for a, b in combinations(boxes, 2):
        assert a[2] < b[0] or b[2] < a[0] or a[3] < b[1] or b[3] < a[1]
    assert all(a[0] > 0 and a[2] < graph.width and a[1] > 0 and a[3] < graph.height for a in boxes)
    for link in graph.links:
        for end, height in zip((link.base, link.follower), link.heights, strict=True):
            body = next(b for b in graph.bodies if b.name == end)
            right = [b for b in graph.bodies if b.x > body.x]
            assert not link.cut or all(abs(b.y - height) > 13 for b in right), "a cut joint's way passes between bodies"


def test_the_parts_of_a_loop() -> None:
    """Of the press the loop is all of it."""
    graph = graph_of("press")
    (cut,) = [link for link in graph.links if link.cut]
    assert {*cut.members, cut.name} == {"ground", "crank", "rod", "slider", "pin", "elbow", "wrist", "rail"}


def test_isomorphic_parts_have_one_colour() -> None:
    graph = graph_of("iltis")
    families = {b.name: b.family for b in graph.bodies}
    sides = ("front_left", "front_right", "rear_left", "rear_right")
    assert len({families[f"{side}.{part}"] for side in sides for part in ("arm", "carrier", "leaf_link", "tie_rod")}) == 1
    assert families["ground"] == families["chassis"] == families["rack"] == -1
    assert families["front_left.arm"] == 0
    assert graph.families == ["4 x 4 bodies: front_left.arm, front_right.arm, rear_left.arm, rear_right.arm"]


@pytest.mark.parametrize(("dark", "name"), [(False, "light"), (True, "dark")])
def test_a_click_tells_the_line(dark: bool, name: str, browser: Page, tmp_path: Path) -> None:
    call("check", MODELS / "press.yaml", "--view", tmp_path / "check.html")
    browser.open(tmp_path / "check.html", dark=dark)
    browser.run("document.getElementById('tab-graph').click()")
    x, y = browser.run("""(() => {
      const box = [...document.querySelectorAll('#graph .cut text')].find((e) => e.textContent.startsWith('elbow')).getBoundingClientRect();
      return [box.left + 5, box.top + box.height / 2];
    })()""")
    browser.click(x, y)
    reported = {e: browser.run(f"document.getElementById('{e}').textContent") for e in ("element", "kind", "line", "notes")}
    assert reported["element"] == "elbow"
    assert reported["kind"] == "cut, revolute, crank to rod"
    assert reported["line"] == "press.yaml:12\nelbow: {kind: revolute, bodies: [crank, rod], at: A, axis: [0, 1, 0]}"
    assert reported["notes"].startswith("redundant in every pose: ")
    assert browser.run("[...document.querySelectorAll('#graph .lit')].length") == 8
    assert browser.run("[...document.querySelectorAll('#said tr')].at(-1).textContent") == "degrees of freedom1"
    browser.picture(PICTURES / f"graph-{name}.png")
    browser.run("cutjoint.select('slider'); document.getElementById('tab-picture').click()")
    assert browser.run("cutjoint.shown().body") == "slider"
    require_silence(browser)


def test_what_a_reduction_does_is_on_the_picture(browser: Page, tmp_path: Path) -> None:
    """Of the governor the balls become parts of their rods."""
    model = read_model(MODELS / "flyball.yaml")
    scene = next(iter(model.scenes.values()))
    shown = show_reduction(model, scene, {}, reduction_sequence(model, scene))
    assert shown.graph is not None
    gone = {part.name for part in (*shown.graph.bodies, *shown.graph.links) if part.is_removed}
    assert {"right.ball", "right.weld", "left.ball", "left.weld"} <= gone
    weld = next(link for link in shown.graph.links if link.name == "left.weld")
    assert "becomes a part of" in weld.about[2]
    browser.open(write_shown(tmp_path / "reduced.html", shown))
    browser.run("cutjoint.tab('graph'); cutjoint.select('left.weld')")
    assert browser.run("document.getElementById('notes').textContent") == "".join(weld.about[2:])
    assert browser.run("document.querySelectorAll('#graph .gone').length") == len(gone)
    browser.picture(PICTURES / "graph-reduced.png")
    require_silence(browser)


def test_names_in_the_graph_are_text(browser: Page, tmp_path: Path) -> None:
    about = [HOSTILE[0], HOSTILE[1], HOSTILE[2]]
    bodies = [GraphBody(name=name, short=name, x=40.0, y=40.0 * i, width=90.0, family=0, about=about) for i, name in enumerate(HOSTILE)]
    links = [
        GraphLink(
            name=f"link {name}", short=name, kind=name, base=HOSTILE[0], follower=HOSTILE[i], cut=i > 2, lane=200.0, heights=(0, i),
            members=HOSTILE, about=about, is_noted=True,
        )
        for i, name in enumerate(HOSTILE) if i
    ]  # fmt: skip
    graph = Graph(width=400, height=300, bodies=bodies, links=links, families=HOSTILE, facts=[(HOSTILE[0], HOSTILE[1])])
    browser.open(hostile_page(tmp_path / "hostile.html", graph=graph))
    browser.run("cutjoint.tab('graph')")
    for part in ("bodies", "links"):
        browser.run(f"cutjoint.select(JSON.parse(document.getElementById('about').textContent).graph.{part}[1].name)")
        assert browser.run("document.getElementById('line').textContent") == f"{HOSTILE[0]}\n{HOSTILE[1]}"
        assert browser.run("document.getElementById('notes').textContent") == HOSTILE[2]
    assert browser.run("[...document.querySelectorAll('#families li')].map((item) => item.textContent)") == [*HOSTILE]
    assert browser.run("window.owned ?? 'nobody'") == "nobody"
    require_silence(browser)
