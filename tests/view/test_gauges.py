"""Gauges of wheel loads in a drive: axles side by side, heavy wheels, numbers inside their drawing."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from cutjoint.package.locations import templates_folder

from .browser import CHROMIUM, Page

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")

#: Places of wheels on two, three and four axles, of which the rear ones are 1.3 m apart, and of a motorcycle.
_VEHICLES = {
    "car": [1.4, -1.2], "truck": [0.0, -3.6, -4.9], "crane": [2.9, 1.6, -1.6, -2.9], "motorcycle": [0.7, -0.7],
}  # fmt: skip


def _page(xs: list[float], y: float, loads: list[float]) -> str:
    """The two functions of the page of a drive with a stand-in for the rest of it: these loads (kN) on the wheels of each axle."""
    folder = templates_folder() / "view"
    script, head = (folder / "page" / "drive.js").read_text(), (folder / "page.html.jinja").read_text()
    functions = [re.search(rf"^function {name}\(.*?^}}$", script, re.MULTILINE | re.DOTALL) for name in ("showDials", "layWheels")]
    texts = [found[0] for found in functions if found]
    assert len(texts) == 2
    svg = re.search(r'<svg id="wheels".*?></svg>', head)
    assert svg
    sides, style, outputs = (1, -1) if y else (1,), (folder / "page.css").read_text(), [4e4, 0, *(1e3 * load for load in loads)]
    wheels = [{"name": f"{x}{s}", "at": [x, s * y, 0], "of": {"Fx": 0, "Fy": 1, "Fz": 2 + i}} for i, x in enumerate(xs) for s in sides]
    return f"""<!doctype html><body data-ready="yes"><b id="fast"></b><i id="gear"></i>{svg[0]}<style>{style}</style>
    <script>
    const RPM = 1, by = (id) => document.getElementById(id), drive = {{ wheels: {json.dumps(wheels)} }};
    const run = {{ sim: {{ outputs: {json.dumps(outputs)} }}, core: {{ outputs: [] }} }};
    const shape = (parent, kind, attributes, text) => {{
      const made = document.createElementNS('http://www.w3.org/2000/svg', kind);
      for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
      if (text) made.textContent = text;
      parent.append(made);
      return made;
    }};
    {texts[0]}
    {texts[1]}
    layWheels(); showDials(10);
    window.cutjoint = {{}};
    </script></body>"""


@pytest.mark.parametrize(("vehicle", "loads"), [
    *((name, [45.0] * len(xs)) for name, xs in _VEHICLES.items()), ("truck", [60.0, 35.0, 35.0]), ("crane", [45.0, 90.0, 70.0, 20.0]),
    ("car", [45.0, 2.0]),
])  # fmt: skip
def test_circles_of_axles_stand_apart_and_numbers_are_whole(browser: Page, tmp_path: Path, vehicle: str, loads: list[float]) -> None:
    page = tmp_path / "gauges.html"
    page.write_text(_page(_VEHICLES[vehicle], 0.0 if vehicle == "motorcycle" else 1.0, loads), encoding="utf-8")
    browser.open(page)
    circles = browser.run("[...document.querySelectorAll('#wheels circle:not(.dot)')].map((c) => c.getBoundingClientRect().toJSON())")
    for i, one in enumerate(circles):
        for other in circles[i + 1 :]:
            apart = [abs(one[k] + one[size] / 2 - other[k] - other[size] / 2) for k, size in (("x", "width"), ("y", "height"))]
            assert (apart[0] ** 2 + apart[1] ** 2) ** 0.5 > 0.98 * (one["width"] + other["width"]) / 2, vehicle
    frame = browser.run("document.getElementById('wheels').getBoundingClientRect().toJSON()")
    texts = browser.run("[...document.querySelectorAll('#wheels text')].map((t) => t.getBoundingClientRect().toJSON())")
    assert browser.run("document.querySelector('#wheels text').textContent") == f"{loads[0]:.1f}"
    for text in texts:
        assert frame["left"] <= text["left"], vehicle
        assert text["right"] <= frame["right"], vehicle
        assert frame["top"] <= text["top"], vehicle
        assert text["bottom"] <= frame["bottom"], vehicle
    assert browser.errors == []
