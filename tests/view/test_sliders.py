"""Poses that are changed in their page: loops stay closed, and places on screen are those of closed forms and of the interpreter."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cutjoint.analysis.closing import design_coordinates, evaluate_closures
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.reading import read_model
from cutjoint.view.motions import Mover
from cutjoint.view.sliders import make_sliders, print_function
from cutjoint.view.views import show_start
from tests.conftest import MODELS, needs_cpp
from tests.view.browser import Page
from tests.view.conftest import call
from tests.view.pages import PICTURES, projected, require_silence

PRESS = MODELS / "press.yaml"


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Path:
    page = tmp_path_factory.mktemp("sliders") / "press.html"
    call("view", PRESS, "--out", page)
    return page


@pytest.mark.parametrize("angle", [0.5, -0.7, 3.0])
def test_a_slider_keeps_the_loop_closed(angle: float, press: Path, browser: Page) -> None:
    """The crank's end goes round a circle of 0.1 m, the slider follows on a rod of sqrt(0.1) m."""
    browser.open(press)
    turned, *_ = browser.run(f"cutjoint.slide('pin.angle', {angle})")
    assert turned == pytest.approx(angle, abs=1e-12)
    end = 0.1 * np.array([np.sin(angle), 0, np.cos(angle)])
    slider = np.array([end[0] + np.sqrt(0.1 - end[2] ** 2), 0, 0])
    for body, place in (("slider", slider), ("rod", (end + slider) / 2), ("crank", end / 2)):
        assert np.abs(np.array(browser.run(f"cutjoint.project('{body}', 0)")) - projected(browser, place)).max() < 0.01
    browser.picture(PICTURES / f"slider-{angle}.png")
    browser.run("document.getElementById('reset').click()")
    assert np.abs(np.array(browser.run("cutjoint.project('slider', 0)")) - projected(browser, np.array([0.3, 0, 0]))).max() < 0.01
    require_silence(browser)


def test_a_slider_goes_as_far_as_the_loop_lets_it(press: Path, browser: Page) -> None:
    browser.open(press)
    browser.run("cutjoint.slide('rail.displacement', 0.3)")
    outputs = browser.run("[...document.querySelectorAll('#sliders input')].map((e) => [e.getAttribute('aria-label'), Number(e.value)])")
    reached = dict(outputs)["rail.displacement"]
    straight = 0.1 + np.sqrt(0.1) - 0.3
    assert straight - 0.05 < reached < straight + 1e-9
    assert browser.run("Math.max(...Mechanism.residual(cutjoint.slide('pin.angle', 0.2)).map(Math.abs))") < 1e-9
    require_silence(browser)


@needs_cpp
def test_a_vehicle_is_as_the_interpreter_says(browser: Page, tmp_path: Path) -> None:
    """From its equilibrium, with the attitudes of balls as quaternions."""
    model = read_model(MODELS / "iltis.yaml")
    scene = model.scenes["simul1"]
    shown, mover = show_start(model, scene, {}), Mover(model=model, scene=scene, parameters={})
    assert shown.sliders is not None
    start = mover.poses(np.array([shown.sliders.facts["q"]]))
    for body, pose in shown.poses.items():
        assert start[body].rotation[0] == pytest.approx(pose.rotation[0], abs=1e-9)
        assert start[body].shift[0] == pytest.approx(pose.shift[0], abs=1e-9)
    call("view", MODELS / "iltis.yaml", "--scene", "simul1", "--out", tmp_path / "pose.html")
    browser.open(tmp_path / "pose.html", size=(900, 500))
    q = np.array(browser.run("(cutjoint.slide('chassis_free.z', 0.1), cutjoint.slide('front_left.arm_hinge.angle', 0.2))"))
    assert np.abs(evaluate_closures(mover.equations, q)[0]).max() < 1e-9
    seen = np.array(browser.run(f"Mechanism.poses({q.tolist()})")).reshape(-1, 12)
    expected = mover.poses(q[np.newaxis])
    for row, body in zip(seen, model.bodies, strict=True):
        assert row[:9] == pytest.approx(expected[body.name].rotation[0].ravel(), abs=1e-12)
        assert row[9:] == pytest.approx(expected[body.name].shift[0], abs=1e-11)
    browser.picture(PICTURES / "slider-iltis.png")
    require_silence(browser)


#: Words of programs that are printed, besides those of numbers and of functions of Math.
WORDS = {"use", "strict", "const", "function", "return", "poses", "residual", "Mechanism", "q", "Math"}


def test_a_program_has_no_text_of_the_model() -> None:
    first, second = (Mover(model=model, scene=model.scenes["turn"], parameters={}) for model in (read_model(PRESS), read_model(PRESS)))
    sliders = make_sliders(first, design_coordinates(first.equations))
    assert sliders is not None
    assert {word for word in re.findall("[A-Za-z]+", sliders.script) if word not in WORDS} <= {"x", "e", "sin", "cos", "sqrt"}
    assert sliders.script == getattr(make_sliders(second, design_coordinates(second.equations)), "script", "")


#: Operations with their arguments, of x = 0.3, y = 0.7.
CALLS = [
    *((name, "x") for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "abs")),
    ("atan2", "xy"), ("pow", "xy"), ("div", "xy"), ("mul", "xy"), ("add", "xy"), ("sub", "xy"),
]


def test_operations_are_printed_as_they_are_interpreted(browser: Page, press: Path) -> None:
    b = Builder()
    symbol = b.symbol("in", 2, BindingTime.ITERATION)
    given = {"x": b.element(symbol, 0), "y": b.element(symbol, 1)}
    elementwise = {"add": b.add, "sub": b.sub, "mul": b.mul}
    makers = [(elementwise.get(name, partial(b.call, name)), of) for name, of in CALLS]
    less = b.call("lt", given["x"], given["y"])
    more = b.call("le", given["y"], given["x"])
    conditions = [less, more, b.call("not", less), b.call("and", less, more), b.call("or", less, more)]
    blocks = [make(*(given[a] for a in of)) for make, of in makers]
    blocks += [b.call("where", condition, given["x"], b.neg(given["y"])) for condition in conditions]
    values = np.array([0.3, 0.7])
    expected = interpret_blocks(blocks, {"in": values}, {})
    browser.open(press)
    seen = browser.run(f"{print_function('f', blocks, {}, {'in': 0})} f({values.tolist()})")
    assert seen == pytest.approx([float(expected[block].ravel()[0]) for block in blocks], rel=1e-15)
    constant = browser.run(f"{print_function('f', blocks, {'in': values}, {})} f([])")
    assert constant == pytest.approx(seen, rel=1e-15)
