"""A run over the run of an earlier page: both are where their tables say, and an earlier page is read as data."""

from __future__ import annotations

import base64
import json
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from tests.conftest import MODELS, needs_cpp
from tests.view.browser import Page
from tests.view.conftest import Shown, call, show
from tests.view.files import read_csv
from tests.view.pages import PICTURES, projected, require_silence

PRESS = MODELS / "press.yaml"


@pytest.fixture(scope="module")
def both(press: Shown, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """A softer press by another method, with rows at other times, over that of the other tests."""
    folder = tmp_path_factory.mktemp("both")
    text = press.page.with_name("model.yaml").read_text(encoding="utf-8").replace("output_step: 10 ms", "output_step: 16 ms")
    (folder / "model.yaml").write_text(text, encoding="utf-8")
    shown = Shown(page=folder / "both.html", glb=press.glb, table=folder / "run.csv")
    options = ("--method", "augmented", "--set", "stiffness=1200", "--no-error", "--out", shown.table)
    call("simulate", folder / "model.yaml", *options, "--view", shown.page, "--over", press.page)
    return shown


@needs_cpp
def test_both_runs_are_where_their_tables_say(press: Shown, both: Shown, browser: Page) -> None:
    browser.open(both.page)
    for shown, call_of in ((both, "project"), (press, "ghost")):
        table = read_csv(shown.table)
        for row in (0, table["t"].size // 7, table["t"].size // 2):
            for body in ("crank", "rod", "slider"):
                seen = browser.run(f"cutjoint.{call_of}('{body}', {table['t'][row]})")
                expected = projected(browser, np.array([table[f"{body}.{axis}"][row] for axis in "xyz"]))
                assert np.abs(seen - expected).max() < 1.0
    assert np.abs(np.array(browser.run("cutjoint.ghost('slider', 0.3)")) - browser.run("cutjoint.project('slider', 0.3)")).max() > 3.0
    browser.picture(PICTURES / "both.png")
    require_silence(browser)


@needs_cpp
def test_values_stand_side_by_side(press: Shown, both: Shown, browser: Page) -> None:
    browser.open(both.page)
    browser.run("cutjoint.setTime(0.8)")
    lines = browser.run("[...document.querySelectorAll('#values tr')].map((line) => [...line.cells].map((cell) => cell.textContent))")
    now, before = (read_csv(shown.table) for shown in (both, press))
    for name, value, other in lines:
        for text, table in ((value.split()[0], now), (other, before)):
            expected = table[name][np.searchsorted(table["t"], 0.8 - 1e-6)]
            assert float(text) == pytest.approx(expected, abs=2e-4 * np.abs(table[name]).max() + 1e-9)
    assert browser.run("document.getElementById('over').textContent") == "over run.html: press, turn, recursive"
    browser.run("document.getElementById('ghost').click()")
    browser.picture(PICTURES / "both-without.png")
    require_silence(browser)


def about(page: Path, **changes: Any) -> str:
    """The text of a page with other facts."""
    text = page.read_text(encoding="utf-8")
    facts = json.loads(re.search('id="about">(.*?)</script>', text)[1])  # type: ignore[index]
    return re.sub('id="about">.*?</script>', lambda _: f'id="about">{json.dumps({**facts, **changes})}</script>', text)


def with_image(page: Path) -> str:
    """The text of a page whose scene asks for a file."""
    text = page.read_text(encoding="utf-8")
    glb = base64.b64decode(re.search('id="glb">([^<]*)<', text)[1])  # type: ignore[index]
    size = struct.unpack_from("<I", glb, 12)[0]
    document = {**json.loads(glb[20 : 20 + size]), "images": [{"uri": "https://example.org/x.png"}]}
    part = json.dumps(document).encode()
    part += b" " * (-len(part) % 4)
    chunks = struct.pack("<I4s", len(part), b"JSON") + part + glb[20 + size :]
    whole = struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
    return re.sub('id="glb">[^<]*<', lambda _: f'id="glb">{base64.b64encode(whole).decode()}<', text)


@needs_cpp
@pytest.mark.parametrize("spoil", [
    lambda page: "", lambda page: "<p>another page</p>", lambda page: about(page, columns=3), lambda page: about(page, columns=[]),
    lambda page: about(page, title=None, columns=[{"name": "x"}] * 5), lambda page: re.sub('id="glb">.', 'id="glb">!', page.read_text()),
    with_image, lambda page: "[" * 100_000, lambda page: re.sub("id=\"about\">.*?</script>", 'id="about">' + "[" * 100_000 + "</script>",
                                                               page.read_text()),
], ids=["empty", "another", "columns", "no columns", "too many", "letters", "an image", "brackets", "deep"])  # fmt: skip
def test_what_is_no_page_is_refused(spoil: Any, press: Shown, tmp_path: Path) -> None:
    earlier = tmp_path / "earlier.html"
    earlier.write_text(spoil(press.page), encoding="utf-8")
    arguments = ("simulate", PRESS, "--out", tmp_path / "x.csv", "--view", tmp_path / "x.html", "--over", earlier)
    result = CliRunner().invoke(main, [str(a) for a in arguments])
    assert result.exit_code == 1
    assert "earlier.html: not a page of a run; write one with simulate --view" in result.output
    assert sorted(file.name for file in tmp_path.iterdir()) == ["earlier.html"]


@needs_cpp
@pytest.mark.parametrize(("view", "message"), [
    (None, "only a page shows two runs; write --view with a name that ends in .html"),
    ("x.glb", "only a page shows two runs; write --view with a name that ends in .html"),
    ("run.html", "that is the page of another run"),
])  # fmt: skip
def test_refusals(view: str | None, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    show(tmp_path, PRESS.read_text(encoding="utf-8"))
    monkeypatch.chdir(tmp_path)
    options = () if view is None else ("--view", view)
    result = CliRunner().invoke(main, ["simulate", str(PRESS), "--out", "x.csv", *options, "--over", "run.html"])
    assert result.exit_code == 1
    assert message in result.output
