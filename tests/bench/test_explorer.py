"""The chart of all points in a browser: its answer is the fastest point, its filters leave lines out, its names are text."""

from __future__ import annotations

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from cutjoint_bench.findings import TARGETS, fastest_spot
from cutjoint_bench.report.explorer import explore
from cutjoint_bench.report.page import render_page
from tests.bench.test_summary import STUDIES, line, point
from tests.view.browser import Page
from tests.view.pages import PICTURES, require_silence
from tests.view.test_page import HOSTILE


def studies(*more: dict[str, Any]) -> dict[str, Any]:
    """The studies of the summary's tests with further lines in their case."""
    changed = deepcopy(STUDIES)
    changed["swings"]["cases"][0]["lines"] += more
    return changed


FAST = line("recursive/rk4/reduced", "reduced", point(0.02, 0.1, 3e-3), point(0.01, 0.2, 5e-4), point(0.001, 4.0, 8e-7))


@pytest.fixture
def page(browser: Page, tmp_path: Path) -> Page:
    file = tmp_path / "bench.html"
    file.write_text(render_page(studies(FAST)), encoding="utf-8")
    browser.open(file, size=(1280, 900))
    return browser


def choose(page: Page, name: str, value: object) -> None:
    page.run(f"(() => {{ const e = document.getElementById('{name}'); e.value = '{value}'; e.dispatchEvent(new Event('change')); }})()")


def test_the_answer_is_the_fastest_point(page: Page) -> None:
    lines = studies(FAST)["swings"]["cases"][0]["lines"]
    options = page.run("[...document.getElementById('accuracy').options].map((o) => Number(o.value))")
    assert options == list(TARGETS)
    for option, target in zip(page.run("[...document.getElementById('accuracy').options].map((o) => o.value)"), TARGETS, strict=True):
        choose(page, "accuracy", option)
        answer = page.run("document.getElementById('answer').textContent")
        spots = [s for s in (fastest_spot(lines, target, peers=peers) for peers in (False, True)) if s is not None]
        if not spots:
            assert answer.startswith("Nothing that is shown comes to")
            continue
        best = min(spots)
        assert answer.startswith(f"Take {best.contender}, step {1e3 * best.dt:g} ms: {1e3 * best.seconds:g} ms for 1 s of motion")
    page.picture(PICTURES / "explorer.png")
    require_silence(page)


def test_filters_leave_lines_out(page: Page) -> None:
    count = "document.querySelectorAll('#chart .line').length"
    assert page.run(count) == 3
    for value, left in (("reduced model", 2), ("peer", 1)):
        page.run(f"[...document.querySelectorAll('#filters input')].find((box) => box.value === '{value}').click()")
        assert page.run(count) == left
    assert page.run("document.getElementById('answer').textContent").startswith("Take recursive, step")
    assert page.run("[...document.querySelectorAll('#legend li')].map((item) => item.textContent)") == ["recursive"]


def test_a_point_tells_its_step_time_and_error(page: Page) -> None:
    x, y = page.run("""(() => {
      document.getElementById('chart').scrollIntoView();
      const box = document.querySelector('#chart .line circle').getBoundingClientRect();
      return [box.left + box.width / 2, box.top + box.height / 2];
    })()""")
    page.click(x, y)
    assert page.run("document.getElementById('tip').textContent") == "recursive\nstep 10 ms, time 500 ms\nerror 1.0e-4 m, 1.0e-4 m/s"
    for view, points in (("velocity", 8), ("step", 8), ("position", 8)):
        choose(page, "view", view)
        assert page.run("document.querySelectorAll('#chart circle').length") == points
    require_silence(page)


def test_axes_are_logarithmic_with_small_errors_at_the_right(page: Page) -> None:
    places = page.run("""[...document.querySelectorAll('#chart .line')].map(
      (g) => [...g.querySelectorAll('circle')].map((c) => Number(c.getAttribute('cx'))))""")
    ours, peer, reduced = places
    assert ours == sorted(ours)
    per_decade = (ours[2] - ours[0]) / 2  # errors of 1e-4 and 1e-6
    assert reduced[2] - reduced[0] == pytest.approx(per_decade * 3.574, rel=1e-3)
    assert peer[1] > peer[0]


def test_names_are_text(browser: Page, tmp_path: Path) -> None:
    file = tmp_path / "hostile.html"
    lines = [line(name, name, point(0.01, 1.0, 1e-5)) for name in HOSTILE]
    file.write_text(render_page(studies(*lines)), encoding="utf-8")
    browser.open(file)
    assert set(HOSTILE) <= set(browser.run("[...document.querySelectorAll('#legend li')].map((item) => item.textContent)"))
    assert browser.run("window.owned ?? 'nobody'") == "nobody"
    require_silence(browser)


def test_points_without_an_error_are_left_out() -> None:
    unknown = line("augmented", "generated", point(0.01, 1.0, float("nan")), point(0.005, 1.0, None), point(0.001, 1.0, 0.0))  # type: ignore[arg-type]
    (case,) = explore(studies(unknown)["swings"]["cases"])["cases"]
    assert [found["label"] for found in case["lines"]] == ["recursive", "mujoco/rk4"]
    assert len(case["lines"][1]["points"]) == 2, "the one that failed has no time"
    json.dumps(case, allow_nan=False)
