"""A run over the run of an earlier page: both are where their tables say, and an earlier page is read as data."""

from __future__ import annotations

import base64
import json
import re
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.view.ghost import GhostRun, read_page
from cutjoint.view.page import PlotColumn
from cutjoint.view.views import ViewSpec, _displayed
from tests.conftest import MODELS, needs_cpp
from tests.view.browser import Page
from tests.view.conftest import Shown, call, show
from tests.view.files import read_csv
from tests.view.pages import PICTURES, part_of, projected, require_silence, with_part

PRESS = MODELS / "press.yaml"


@pytest.fixture(scope="module")
def both(press: Shown, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """A softer press by another method, with rows at other times, over that of the other tests."""
    folder = tmp_path_factory.mktemp("both")
    text = press.page.with_name("model.yaml").read_text(encoding="utf-8").replace("output_step: 10 ms", "output_step: 16 ms")
    (folder / "model.yaml").write_text(text, encoding="utf-8")
    shown = Shown(page=folder / "both.html", glb=press.glb, table=folder / "run.csv")
    options = ("--method", "augmented", "--set", "stiffness=1200", "--no-error", "--out", shown.table)
    call("simulate", folder / "model.yaml", *options, "--view", shown.page, "--ghost", press.page)
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


def about(page: str, **changes: Any) -> str:
    """A page with other facts."""
    return with_part(page, "about", json.dumps({**json.loads(part_of(page, "about")), **changes}))


def gltf(page: str, **changes: Any) -> str:
    """A page whose .glb file has other entries in its document, or others in one of its lists: ``nodes_3`` is the fourth node."""
    glb = base64.b64decode(part_of(page, "glb"))
    size = struct.unpack_from("<I", glb, 12)[0]
    document = json.loads(glb[20 : 20 + size])
    for key, value in changes.items():
        name, _, number = key.partition("_")
        if number:
            document[name][int(number)] = {**document[name][int(number)], **value}
        else:
            document[name] = value
    return with_part(page, "glb", base64.b64encode(in_chunks(document, glb[28 + size :])).decode())


def in_chunks(document: dict[str, Any], binary: bytes) -> bytes:
    part = json.dumps(document).encode()
    part += b" " * (-len(part) % 4)
    chunks = struct.pack("<I4s", len(part), b"JSON") + part + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


@needs_cpp
@pytest.mark.parametrize("spoil", [
    lambda page: "", lambda page: "<p>another page</p>", lambda page: about(page, columns=3), lambda page: about(page, columns=[]),
    lambda page: about(page, title=None, columns=[{"name": "x"}] * 5), lambda page: with_part(page, "glb", "!" + part_of(page, "glb")[1:]),
    lambda page: with_part(page, "glb", part_of(page, "glb")[:-4]), lambda page: "[" * 100_000,
    lambda page: with_part(page, "about", "[" * 100_000),
    lambda page: with_part(page, "table", part_of(page, "table")[::-1], is_sealed=False),
    lambda page: with_part(page, "table", part_of(page, "table").replace("A", "B", 1), is_sealed=False),
    lambda page: gltf(page, nodes_1={"matrix": [float("nan")] * 16}), lambda page: gltf(page, nodes_1={"children": [1]}),
    lambda page: gltf(page, nodes_0={"children": [1, 1]}), lambda page: gltf(page, nodes_1={"mesh": 99}), lambda page: gltf(page, nodes=[]),
    lambda page: gltf(page, nodes_1={"extras": {"newton": float("nan")}}), lambda page: gltf(page, nodes_0={"rotation": [0, 0, 0, 0]}),
    lambda page: gltf(page, accessors_0={"count": 10**6}),
    lambda page: gltf(page, accessors_0={"byteOffset": -4}), lambda page: gltf(page,
        buffers=[{"byteLength": 4, "uri": "https://example.org/x"}]),
    lambda page: gltf(page, animations_0={"channels": [{"sampler": 99, "target": {"node": 1, "path": "translation"}}]}),
    lambda page: gltf(page, accessors_0={"max": None}), lambda page: gltf(page, accessors_0={"min": "0, 0"}),
    lambda page: gltf(page, animations_0={"name": None}), lambda page: gltf(page, animations_0={"extras": {"of": [1, {"rows": None}]}}),
    lambda page: gltf(page, animations_0={"samplers": [{"input": 0, "output": 0, "interpolation": None}]}),
    lambda page: gltf(page, extensionsRequired=["KHR_draco_mesh_compression"]),
], ids=[
    "empty", "another", "columns", "no columns", "too many", "letters", "cut off", "brackets", "deep", "backwards", "sum", "nan matrix",
    "cycle", "twice", "no mesh", "no nodes", "nan", "turn", "count", "offset", "elsewhere", "no sampler", "no extent",
    "extent", "no name", "null within", "interpolation", "extension",
])  # fmt: skip
def test_what_is_no_page_is_refused(spoil: Any, press: Shown, tmp_path: Path) -> None:
    earlier = tmp_path / "earlier.html"
    earlier.write_text(spoil(press.page.read_text(encoding="utf-8")), encoding="utf-8")
    arguments = ("simulate", PRESS, "--out", tmp_path / "x.csv", "--view", tmp_path / "x.html", "--ghost", earlier)
    result = CliRunner().invoke(main, [str(a) for a in arguments])
    assert result.exit_code == 1
    assert "earlier.html: not a page of a run; write one with simulate --view" in result.output
    assert sorted(file.name for file in tmp_path.iterdir()) == ["earlier.html"]


@needs_cpp
def test_only_what_is_drawn_of_an_earlier_page_gets_into_another(press: Shown, browser: Page, tmp_path: Path) -> None:
    text = press.page.read_text(encoding="utf-8")
    other = {"extensions": {"KHR_lights_punctual": {"lights": 3}}, "images": [{"uri": "https://example.org/x"}], "skins": [{"joints": [9]}]}
    text = gltf(text, **other, nodes_1={"skin": 0, "camera": 5, "matrix": None}, materials=[{"emissiveTexture": {"index": 0}}])
    (tmp_path / "earlier.html").write_text(text, encoding="utf-8")
    call("simulate", PRESS, "--no-error", "--out", tmp_path / "x.csv", "--view", tmp_path / "x.html", "--ghost", tmp_path / "earlier.html")
    browser.open(tmp_path / "x.html")
    assert browser.run("cutjoint.ghost('slider', 0.3)") == pytest.approx(browser.run("cutjoint.project('slider', 0.3)"), abs=0.1)
    require_silence(browser)


@needs_cpp
def test_keys_without_a_value_are_dropped(press: Shown, tmp_path: Path) -> None:
    text = press.page.read_text(encoding="utf-8")
    (tmp_path / "earlier.html").write_text(gltf(text, nodes_1={"matrix": None, "mesh": None}), encoding="utf-8")
    assert b"null" not in read_page(tmp_path / "earlier.html", "").glb


@needs_cpp
def test_pages_without_check_sums_are_read(press: Shown, tmp_path: Path) -> None:
    """Pages of the first version had none."""
    text = re.sub(' data-crc="[0-9]+"', "", press.page.read_text(encoding="utf-8"))
    (tmp_path / "earlier.html").write_text(text, encoding="utf-8")
    assert read_page(tmp_path / "earlier.html", "").glb == read_page(press.page, "").glb


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
    result = CliRunner().invoke(main, ["simulate", str(PRESS), "--out", "x.csv", *options, "--ghost", "run.html"])
    assert result.exit_code == 1
    assert message in result.output


def test_a_ghost_shows_columns_in_the_units_of_the_page_alone(tmp_path: Path) -> None:
    """A page in degrees under one in radians: its angles have no values there, its speeds have; both in degrees have all."""
    columns = {"bob.roll": np.array([0.0, 1.0]), "bob.vx": np.array([0.0, 2.0])}
    ghost = GhostRun(name="old", glb=b"", t=np.arange(2.0), columns=columns, units={"bob.roll": "deg", "bob.vx": "m/s"})
    of = {"bob.roll": "rad", "bob.vx": "m/s"}
    own = tuple(PlotColumn(name=name, unit=of[name], bodies=(), values=values) for name, values in columns.items())
    for display, shown in (((), ["bob.vx"]), (("deg",), ["bob.roll", "bob.vx"])):
        spec = ViewSpec(model=SimpleNamespace(display=()), scene=None, parameters={}, t=np.zeros(2), poses={}, columns=own, display=display)  # type: ignore[arg-type]
        _, kept = _displayed(spec, ghost)
        assert kept is not None
        assert list(kept.columns) == shown
