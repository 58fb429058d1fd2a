"""Ways to look at a page: several curves, curves over others, traces, sides, distances, and files of what is shown."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import MODELS, needs_cpp
from tests.view.browser import Page
from tests.view.conftest import Shown, show
from tests.view.files import read_csv
from tests.view.pages import PICTURES, projected, require_silence

pytestmark = needs_cpp


def change(page: Page, element: str, value: str) -> None:
    """Choose from a list as a user does."""
    page.run(f"{{ const list = document.getElementById('{element}'); list.value = '{value}'; list.dispatchEvent(new Event('change')); }}")
    page.settle()


def tick(page: Page, column: str) -> None:
    page.run(f"document.querySelector('#values input[title=\"{column} in the plot\"]').click()")
    page.settle()


def test_several_curves_with_an_axis_for_each_unit(press: Shown, browser: Page) -> None:
    browser.open(press.page)
    table = read_csv(press.table)
    browser.run("cutjoint.choose('slider')")
    for column in ("slider.z", "spring.force"):
        tick(browser, column)
    assert browser.run("cutjoint.shown().chosen") == ["slider.x", "slider.z", "spring.force"]
    data = browser.run("cutjoint.plotted().map((values) => [...values])")
    for values, name in zip(data, ("t", "slider.x", "slider.z", "spring.force"), strict=True):
        assert values == pytest.approx(table[name], rel=1e-6, abs=1e-6)
    colours = browser.run("[...document.querySelectorAll('#values tr.chosen td:first-child')].map((cell) => getComputedStyle(cell).color)")
    assert len(set(colours)) == 3
    assert browser.run("document.querySelectorAll('.u-axis').length") == 3  # t, m and N
    browser.picture(PICTURES / "press-curves.png")
    tick(browser, "slider.x")
    assert browser.run("cutjoint.shown().chosen") == ["slider.z", "spring.force"]
    require_silence(browser)


def test_a_curve_over_another_column_goes_from_row_to_row(press: Shown, browser: Page) -> None:
    browser.open(press.page)
    table = read_csv(press.table)
    change(browser, "column", "slider.vx")
    change(browser, "abscissa", "slider.x")
    x, y = browser.run("cutjoint.plotted()[1].map((values) => [...values])")
    assert x == pytest.approx(table["slider.x"], rel=1e-6, abs=1e-6)
    assert y == pytest.approx(table["slider.vx"], rel=1e-6, abs=1e-6)
    places = []
    for row in (20, 70):
        browser.run(f"cutjoint.setTime({table['t'][row]})")
        places.append(browser.run("(({x, y}) => [x, y])(document.querySelector('.now').getBoundingClientRect())"))
    way = np.subtract(places[1], places[0])
    assert np.sign(way[0]) == np.sign(table["slider.x"][70] - table["slider.x"][20])
    assert np.sign(way[1]) == -np.sign(table["slider.vx"][70] - table["slider.vx"][20])
    browser.picture(PICTURES / "press-over.png")
    change(browser, "abscissa", "")
    assert len(browser.run("cutjoint.plotted().map((values) => [...values])")[0]) == table["t"].size
    require_silence(browser)


def test_plots_of_the_scene_are_chosen_by_their_names(tmp_path: Path, browser: Page) -> None:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8")
    plots = "plots: {way: {x: slider.x, y: [slider.vx]}, both: {y: [slider.x, slider.vx]}}"
    shown = show(tmp_path, re.sub(r"(\n  turn: *\{)", rf"\1{plots}, ", text))
    browser.open(shown.page)
    table = read_csv(shown.table)

    def is_plotted(columns: list[str], values: object) -> None:
        for name, of in zip(columns, values, strict=True):  # type: ignore[call-overload]
            assert of == pytest.approx(table[name], rel=1e-6, abs=1e-6)

    is_plotted(["slider.x", "slider.vx"], browser.run("cutjoint.plotted()[1].map((values) => [...values])"))
    assert browser.run("document.getElementById('abscissa').value") == "slider.x"
    change(browser, "column", "#1")
    is_plotted(["t", "slider.x", "slider.vx"], browser.run("cutjoint.plotted().map((values) => [...values])"))
    assert browser.run("document.getElementById('column').selectedOptions[0].textContent") == "both"
    change(browser, "column", "slider.x")
    is_plotted(["t", "slider.x"], browser.run("cutjoint.plotted().map((values) => [...values])"))
    require_silence(browser)


def test_a_stretch_of_the_plot_is_zoomed_to_and_a_click_still_goes_to_a_time(press: Shown, browser: Page) -> None:
    browser.open(press.page)
    left, top, width = browser.run("(({x, y, width}) => [x, y, width])(document.querySelector('.u-over').getBoundingClientRect())")
    browser.click(left + 0.5 * width, top + 40)
    middle = browser.run("cutjoint.shown().time")
    assert middle == pytest.approx(1.0, abs=0.05)
    browser.drag((left + 0.25 * width, top + 40), (left + 0.35 * width, top + 40))
    assert browser.run("cutjoint.shown().time") == middle
    assert browser.run("document.querySelector('.now').hidden")
    browser.click(left + 0.5 * width, top + 40)
    assert browser.run("cutjoint.shown().time") == pytest.approx(0.6, abs=0.05)
    require_silence(browser)


def test_a_trace_is_the_way_of_the_centre_of_mass(press: Shown, browser: Page) -> None:
    browser.open(press.page)
    table = read_csv(press.table)
    x, y, z = np.array(browser.run("cutjoint.path('rod')")).T  # of the scene, in which y is up
    for found, axis in ((x, "x"), (z, "y"), (y, "z")):
        known = table[f"rod.{axis}"] * (-1 if axis == "y" else 1)
        assert found.min() == pytest.approx(known.min(), abs=1e-4)
        assert found.max() == pytest.approx(known.max(), abs=1e-4)
    browser.run("cutjoint.choose('rod')")
    before = browser.picture(PICTURES / "press-untraced.png").read_bytes()
    browser.run("document.getElementById('trace').click()")
    assert browser.picture(PICTURES / "press-traced.png").read_bytes() != before
    browser.run("document.getElementById('trace').click()")
    assert browser.picture(PICTURES / "press-untraced.png").read_bytes() == before
    require_silence(browser)


@pytest.mark.parametrize(("side", "axes"), [("front", "yz"), ("side", "xz"), ("top", "xy")])
def test_sides_look_along_an_axis(side: str, axes: str, iltis: Shown, browser: Page) -> None:
    browser.open(iltis.page)
    change(browser, "look", side)
    eye = browser.run("cutjoint.eye()")
    way = np.subtract(eye["from"], eye["to"])
    along = {"yz": 0, "xy": 1, "xz": 2}[axes]  # of the scene, in which y is up
    assert abs(way[along]) == pytest.approx(np.linalg.norm(way), rel=1e-3)
    browser.picture(PICTURES / f"iltis-{side}.png")
    if side != "top":
        table = read_csv(iltis.table)
        expected = projected(browser, np.array([table[f"chassis.{axis}"][0] for axis in "xyz"]))
        assert np.abs(browser.run("cutjoint.project('chassis', 0)") - expected).max() < 1.0
    require_silence(browser)


def test_the_distance_of_two_points_and_bodies_that_are_seen_through(press: Shown, browser: Page) -> None:
    browser.open(press.page)
    top = browser.run("document.getElementById('picture').getBoundingClientRect().top")
    browser.run("document.getElementById('measuring').click(); cutjoint.setTime(0)")
    for body in ("crank", "slider"):
        x, y = browser.run(f"cutjoint.project('{body}', 0)")
        browser.click(x, y + top)
    table = read_csv(press.table)
    apart = np.linalg.norm([table[f"slider.{axis}"][0] - table[f"crank.{axis}"][0] for axis in "xyz"])
    said = float(browser.run("document.getElementById('measured').textContent").split()[0])
    assert said == pytest.approx(apart, rel=0.25)  # points on surfaces, not centres
    browser.picture(PICTURES / "press-measured.png")
    browser.run("cutjoint.setTime(0.3)")
    assert float(browser.run("document.getElementById('measured').textContent").split()[0]) != said
    browser.run("document.getElementById('through').click()")
    browser.picture(PICTURES / "press-through.png")
    require_silence(browser)


def test_the_table_is_saved_with_its_units(press: Shown, browser: Page) -> None:
    browser.open(press.page)
    head, *rows = browser.run("cutjoint.table()").splitlines()
    table = read_csv(press.table)
    assert head.startswith("t [s],")
    assert "slider.x [m]" in head.split(",")
    found = np.array([[float(x) for x in row.split(",")] for row in rows])
    assert found.shape == (table["t"].size, len(head.split(",")))
    assert found[:, head.split(",").index("slider.x [m]")] == pytest.approx(table["slider.x"], rel=1e-6, abs=1e-7)
    browser.run("window.saved = []; HTMLAnchorElement.prototype.click = function () { saved.push(this.download); }")
    for how in ("table", "picture"):
        change(browser, "save", how)
    browser.run("new Promise((done) => setTimeout(done, 500))")
    assert browser.run("saved") == ["press.csv", "press.png"]
    browser.run("document.getElementById('speed').value = '5'")
    change(browser, "save", "video")
    browser.run("new Promise((done) => { const wait = () => saved.length < 3 ? setTimeout(wait, 50) : done(1); wait(); })")
    assert browser.run("saved")[2] in ("press.webm", "press.mp4")
    require_silence(browser)
