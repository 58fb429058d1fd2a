"""Pages in which a simulation runs: keys move it, its motion is that of the native core with the same inputs, and faults are reported."""

from __future__ import annotations

import json
import re
import subprocess
import time
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import numpy as np
import pytest

from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_case
from cutjoint.toolchain import wasm
from cutjoint.toolchain.compiler import find_compiler
from cutjoint.view.drive import ROADS, replay_drive, simulated
from tests.conftest import MODELS, ROOT, needs_cpp
from tests.view.browser import Page
from tests.view.conftest import call
from tests.view.files import Array
from tests.view.pages import PICTURES, projected, require_silence

needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang of PyPI")

DELTA = MODELS / "delta.yaml"
RIGHT_THEN_UP = [[0, "down", "ArrowRight"], [200, "up", "ArrowRight"], [250, "down", "ArrowUp"], [400, "up", "ArrowUp"]]


@pytest.fixture(scope="module")
def delta(tmp_path_factory: pytest.TempPathFactory) -> Path:
    page = tmp_path_factory.mktemp("delta") / "delta.html"
    call("drive", DELTA, "--out", page)
    return page


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The car of a recipe."""
    folder = tmp_path_factory.mktemp("car")
    found = re.search(r'```yaml title="driven.yaml"\n(.*?)```', (ROOT / "docs/how-to/simple-car.md").read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    (folder / "driven.yaml").write_text(found[1], encoding="utf-8")
    (folder / "iltis.tir").write_bytes((MODELS / "iltis.tir").read_bytes())
    options = ("--scene", "turns", "--steer", "steer=0.3,-0.3", "--brake", "brake=900", "--throttle", "drive=300")
    call("drive", folder / "driven.yaml", *options, "--out", folder / "car.html")
    return folder / "car.html"


def rows_of(text: str) -> Array:
    return np.array([[float(x) for x in line.split(",")] for line in text.splitlines()[1:]])


def press(page: Page, *keys: str, up: bool = False) -> None:
    """Keys as a keyboard gives them."""
    for key in keys:
        page._call("Input.dispatchKeyEvent", type="keyUp" if up else "keyDown", code=key, key=key)


def wait_for(page: Page, script: str) -> None:
    end = time.monotonic() + 60
    while not page.run(script):
        assert time.monotonic() < end, script
        time.sleep(0.05)


def steps(page: Page, count: int, keys: Sequence[Sequence[object]] = ()) -> None:
    page.run(f"cutjoint.drive.steps({count}, {json.dumps(keys)})")


@needs_cpp
@needs_zig
def test_a_drive_is_that_of_the_native_core(delta: Path, browser: Page, tmp_path: Path) -> None:
    browser.open(delta)
    steps(browser, 600, RIGHT_THEN_UP)
    log, table = browser.run("cutjoint.drive.log()"), browser.run("cutjoint.drive.table()")
    (tmp_path / "drive.json").write_text(log, encoding="utf-8")
    call("drive", DELTA, "--replay", tmp_path / "drive.json", "--out", tmp_path / "replay.csv")
    here, there = rows_of((tmp_path / "replay.csv").read_text(encoding="utf-8")), rows_of(table)
    assert {name for _, name, _ in json.loads(log)["events"]} == {"q1", "q2"}
    assert here.shape == (1 + 600 // json.loads(log)["every"], 10)
    assert np.array_equal(here, there[:, :10]), "bit for bit"
    still = rows_of(table)[:, 10:]
    assert np.ptp(still[:, 0]) > 0.04, "the first input was moved"
    assert np.ptp(here[:, 1]) > 1e-3, "and so was the plate"


@needs_cpp
@needs_zig
def test_a_lap_of_a_car_replays_bit_by_bit(car: Path, browser: Page) -> None:
    browser.open(car)
    corner = [[at + 1000 * i, how, code] for i in range(2) for at, how, code in ((0, "down", "ArrowLeft"), (900, "up", "ArrowLeft"))]
    steps(browser, 4000, [[0, "down", "ArrowUp"], *corner, [2500, "up", "ArrowUp"], [2500, "down", "KeyS"]])
    log, table = car.with_name("lap.json"), browser.run("cutjoint.drive.table()")
    log.write_text(browser.run("cutjoint.drive.log()"), encoding="utf-8")
    call("drive", car.with_name("driven.yaml"), "--scene", "turns", "--replay", log, "--out", car.with_name("lap.csv"))
    here, there = rows_of(car.with_name("lap.csv").read_text(encoding="utf-8")), rows_of(table)
    assert np.array_equal(here, there[:, : here.shape[1]])
    assert here[-1, 3] < here[0, 3] - 3, "it has braked"
    assert here[-1, 4] > 0.2, "and turned"


@needs_cpp
@needs_zig
@pytest.mark.parametrize(("name", "seed", "count"), [("hills", 3, 61_696), ("ISO 8608 C", 7, 20_000), ("flat", 1, 0)])
def test_a_page_has_the_roads_of_a_replay_bit_by_bit(name: str, seed: int, count: int, car: Path, browser: Page) -> None:
    browser.open(car)
    browser.run(f"cutjoint.drive.road('{name}', {seed})")
    assert browser.run("cutjoint.drive.shown().road") == name
    here, there = ROADS[name].heights(seed)[1].ravel()[:count], browser.run(f"cutjoint.drive.heights().slice(0, {count})")
    assert np.array_equal(here, there)
    assert count == 0 or np.std(here) > 1e-3


@needs_cpp
@needs_zig
def test_a_drive_on_another_road_replays_bit_by_bit_and_the_road_of_the_scene_comes_back(car: Path, browser: Page) -> None:
    browser.open(car)
    steps(browser, 500)
    level = browser.run("cutjoint.drive.table()")
    browser.run("cutjoint.drive.road('hills with steps', 2)")
    steps(browser, 2500, [[0, "down", "ArrowUp"], [700, "down", "ArrowLeft"], [1000, "up", "ArrowLeft"]])
    log, table = car.with_name("hills.json"), browser.run("cutjoint.drive.table()")
    log.write_text(browser.run("cutjoint.drive.log()"), encoding="utf-8")
    call("drive", car.with_name("driven.yaml"), "--scene", "turns", "--replay", log, "--out", car.with_name("hills.csv"))
    here, there = rows_of(car.with_name("hills.csv").read_text(encoding="utf-8")), rows_of(table)
    assert np.array_equal(here, there[:, : here.shape[1]])
    loads = [i for i, name in enumerate(table.splitlines()[0].split(",")) if ".Fz" in name]
    assert len(loads) == 4
    assert np.ptp(here[:, loads], axis=0).min() > 1000, "wheels meet the plates"
    ground = browser.run("cutjoint.drive.groundBelow()")
    assert abs(ground) > 0.1, "it is on a hill"
    browser.run("cutjoint.drive.road('', 1)")
    steps(browser, 500)
    assert browser.run("cutjoint.drive.table()") == level


@needs_cpp
@needs_zig
def test_a_closed_page_loses_no_drive(car: Path, browser: Page) -> None:
    browser.open(car)
    browser.run("localStorage.clear()")
    browser.run("cutjoint.drive.road('hills', 1)")
    steps(browser, 1500, [[0, "down", "ArrowUp"], [200, "down", "ArrowLeft"], [500, "up", "ArrowLeft"]])
    driven = browser.run("[cutjoint.drive.table(), cutjoint.drive.log()]")
    browser.open(car)
    assert not browser.run("document.getElementById('kept').hidden")
    assert re.match(r"A drive of [12] s is kept", browser.run("document.getElementById('lasted').textContent"))
    browser.run("cutjoint.drive.continueDrive(cutjoint.drive.kept().earlier)")
    assert browser.run("[cutjoint.drive.table(), cutjoint.drive.log()]") == driven
    steps(browser, 100)
    assert browser.run("cutjoint.drive.shown().step") == 1600
    browser.run("Storage.prototype.setItem = () => { throw new DOMException('full', 'QuotaExceededError'); }")
    browser.run("cutjoint.drive.store()")
    assert "This browser keeps no drive (QuotaExceededError)" in browser.run("document.getElementById('saying').textContent")


@needs_cpp
@needs_zig
def test_an_earlier_drive_is_a_ghost(car: Path, browser: Page) -> None:
    browser.open(car, size=(1280, 800))
    steps(browser, 1000, [[0, "down", "ArrowUp"], [100, "down", "ArrowLeft"]])
    log, place = json.loads(browser.run("cutjoint.drive.log()")), browser.run("cutjoint.drive.outputs()")[:2]
    browser.run(f"cutjoint.drive.ghost({json.dumps(log)})")
    assert browser.run("cutjoint.drive.shown().ghost") == 1 + 1000 // log["every"]
    at = browser.run("cutjoint.drive.rival('chassis')")
    assert at[:2] == pytest.approx(place, abs=0.3), "where it has been, at its last row"
    browser.run("cutjoint.drive.reset()")
    steps(browser, 1000, [[0, "down", "ArrowUp"], [100, "down", "ArrowRight"]])
    at, own = browser.run("cutjoint.drive.rival('chassis')"), browser.run("cutjoint.drive.outputs()")
    assert at[1] > 0.01 > -0.01 > own[1]
    assert browser.run("cutjoint.plotted().length") == 3, "its curve is beside that of this drive"
    browser.picture(PICTURES / "drive-ghost.png")
    browser.run(f"cutjoint.drive.ghost({json.dumps({**log, 'mark': '0'})})")
    assert "That is no drive of this page" in browser.run("document.getElementById('saying').textContent")
    browser.run("cutjoint.drive.ghost()")
    assert browser.run("[cutjoint.drive.shown().ghost, cutjoint.plotted().length]") == [0, 2]
    require_silence(browser)


@needs_cpp
@needs_zig
def test_a_lost_gamepad_a_hidden_page_and_no_number_pause_it_with_a_word(delta: Path, browser: Page) -> None:
    browser.open(delta)
    browser.run("navigator.getGamepads = () => [{ connected: true, mapping: 'standard', axes: [0, 0], buttons: [] }]")
    press(browser, "Space")
    wait_for(browser, "cutjoint.drive.shown().time > 0.05")
    browser.run("dispatchEvent(new Event('gamepaddisconnected'))")
    assert not browser.run("cutjoint.drive.shown().playing")
    assert "The gamepad is gone" in browser.run("document.getElementById('saying').textContent")
    press(browser, "Space", up=True)
    press(browser, "Space")
    assert browser.run("cutjoint.drive.shown().playing")
    browser.run("Object.defineProperty(document, 'hidden', { value: true }); document.dispatchEvent(new Event('visibilitychange'))")
    assert not browser.run("cutjoint.drive.shown().playing")
    assert "Paused while the page was hidden" in browser.run("document.getElementById('saying').textContent")
    steps(browser, 200)
    before = browser.run("cutjoint.drive.table()")
    browser.run("cutjoint.drive.simulation().parameters.fill(NaN)")
    steps(browser, 100)
    assert browser.run("cutjoint.drive.shown().fault")
    assert browser.run("document.getElementById('rescue').hidden") is False
    assert browser.run("cutjoint.drive.table()").startswith(before)


@pytest.mark.heavy
@needs_cpp
@pytest.mark.skipif(not (which("qemu-aarch64") and which("aarch64-linux-gnu-g++")), reason="needs qemu-user and g++-aarch64-linux-gnu")
def test_a_replay_on_another_processor_has_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, scene = find_case(read_model_text(DELTA.read_text(encoding="utf-8"), "delta.yaml"), None)
    alone = simulated(model, scene, "recursive")
    events = [[0, 0, 0.2], [0, 2, -0.1], [137, 1, 0.31], *([at, 0, 0.2 + 1e-4 * at] for at in range(200, 900))]
    dt, count, every = 0.001, 2000, 20
    drive = {"cutjoint": "drive", "mark": alone.mark, "model": "delta", "scene": scene.name, "dt": dt, "steps": count, "every": every}
    drive |= {"initial_values": {}, "events": [[at, f"q{index + 1}", value] for at, index, value in events]}
    (tmp_path / "drive.json").write_text(json.dumps(drive), encoding="utf-8")
    here = replay_drive(model, scene, tmp_path / "drive.json").rows
    tools = "aarch64-linux-gnu"
    monkeypatch.setattr(wasm, "find_compiler", lambda: replace(find_compiler(), command=(f"{tools}-g++",)))
    library = alone.build_matching_library()
    (tmp_path / "delta.h").write_text(alone.files["delta.h"], encoding="utf-8")
    given = ("-I.", '-DHEADER="delta.h"', "-DMODEL=delta", f"-DBYTES={alone.size}")
    sources = (str(Path(__file__).with_name("replay.c")), str(library))
    subprocess.run([f"{tools}-gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", *given, *sources, "-o", "replay"], cwd=tmp_path, check=True)
    said = "\n".join(" ".join(map(repr, line)) for line in ((dt, count, every, here.shape[1] - 1, len(events)), *events))
    call_it = ["qemu-aarch64", "-L", f"/usr/{tools}", "-E", f"LD_LIBRARY_PATH={library.parent}", "./replay"]
    done = subprocess.run(call_it, cwd=tmp_path, input=said, check=True, capture_output=True, text=True)
    there = np.array([[float.fromhex(x) for x in line.split()] for line in done.stdout.splitlines()])
    assert np.array_equal(there, here[1:, 1:])
    assert np.ptp(there[:, 0]) > 1e-3


@needs_cpp
@needs_zig
def test_a_replay_of_another_model_is_refused(tmp_path: Path) -> None:
    drive = {"cutjoint": "drive", "mark": "0", "model": "press", "scene": "turn", "dt": 0.001, "given": {}, "steps": 1, "every": 1}
    drive["events"] = []
    (tmp_path / "drive.json").write_text(json.dumps(drive), encoding="utf-8")
    said = call("drive", DELTA, "--replay", tmp_path / "drive.json", "--out", tmp_path / "x.csv", status=1)
    assert "a drive of 'press', turn, in another version; drive the page of this one" in said


@needs_cpp
@needs_zig
def test_keys_move_it_against_the_clock(delta: Path, browser: Page) -> None:
    browser.open(delta)
    assert not browser.run("cutjoint.drive.shown().playing")
    press(browser, "ArrowRight")
    wait_for(browser, "cutjoint.drive.shown().time > 0.5")
    press(browser, "ArrowRight", up=True)
    press(browser, "Space")
    shown = browser.run("cutjoint.drive.shown()")
    assert not shown["playing"]
    assert shown["axes"]["q1"] > 0.05
    assert {name for _, name, _ in json.loads(browser.run("cutjoint.drive.log()"))["events"]} == {"q1"}
    outputs = dict(zip(("x", "y", "z"), browser.run("cutjoint.drive.outputs()"), strict=False))
    assert np.abs(browser.run("cutjoint.project('plate', 0)") - projected(browser, np.array([*outputs.values()]))).max() < 1.0
    assert "of the clock" in browser.run("document.getElementById('pace').textContent")
    listed = browser.run("[...document.querySelectorAll('#keys div')].map((line) => line.textContent)")
    assert [line.split()[-1] for line in listed[:3]] == ["q1", "q2", "q3"], "all keys, also of inputs that thumbs have no button for"
    browser.picture(PICTURES / "drive-delta.png")
    require_silence(browser)


@needs_cpp
@needs_zig
def test_a_model_without_inputs_says_what_would_move_it(browser: Page, tmp_path: Path) -> None:
    call("drive", MODELS / "slider_crank.yaml", "--loops", "embedded", "--out", tmp_path / "page.html")
    browser.open(tmp_path / "page.html", size=(390, 844))
    assert "cutjoint drive --tunable NAME" in browser.run("document.getElementById('inputs').innerText")
    steps(browser, 100)
    assert browser.run("cutjoint.drive.shown().time") > 0


@needs_cpp
@needs_zig
def test_from_an_earlier_second_it_goes_on_bit_by_bit(delta: Path, browser: Page) -> None:
    browser.open(delta)
    keys = [[0, "down", "ArrowRight"], [1300, "up", "ArrowRight"]]
    steps(browser, 2500, keys)
    first = browser.run("[cutjoint.drive.table(), cutjoint.drive.log()]")
    browser.run("cutjoint.drive.rewind(1.9)")
    shown = browser.run("cutjoint.drive.shown()")
    assert (shown["step"], shown["snapshots"]) == (1000, 2)
    assert browser.run("cutjoint.drive.outputs()") != pytest.approx(rows_of(first[0])[-1, 1:10], abs=1e-6)
    steps(browser, 300, [[1000, "down", "ArrowRight"]])
    steps(browser, 1200, keys)
    assert browser.run("[cutjoint.drive.table(), cutjoint.drive.log()]") == first
    browser.run("cutjoint.drive.reset()")
    assert browser.run("cutjoint.drive.shown().step") == 0
    steps(browser, 2500, keys)
    assert browser.run("[cutjoint.drive.table(), cutjoint.drive.log()]") == first


@needs_cpp
@needs_zig
def test_a_slider_stays_where_it_is_put_and_other_inputs_follow_the_scene(delta: Path, browser: Page) -> None:
    browser.open(delta)
    browser.run("(() => { const s = document.querySelector('#inputs input'); s.value = 0.5; s.dispatchEvent(new Event('input')); })()")
    steps(browser, 500)
    assert browser.run("cutjoint.drive.shown().axes.q1") == pytest.approx(0.25)
    assert browser.run("cutjoint.drive.simulation().input('q1')") == pytest.approx(0.25)
    assert browser.run("cutjoint.drive.simulation().input('q2')") == pytest.approx(0.3 * np.sin(6 * 0.5 - 2 * np.pi / 3), abs=1e-9)


@needs_cpp
@needs_zig
def test_a_fault_is_reported_and_the_drive_so_far_is_kept(delta: Path, browser: Page) -> None:
    browser.open(delta)
    steps(browser, 1100)
    browser.run("cutjoint.drive.simulation().setInput('q1', 1e5)")
    steps(browser, 200)
    shown = browser.run("cutjoint.drive.shown()")
    assert shown["fault"]
    assert shown["step"] < 1300
    assert browser.run("document.getElementById('stopped').textContent") == shown["fault"]
    assert browser.run("['failure', 'rescue'].map((id) => document.getElementById(id).hidden)") == [False, False]
    assert "delta.yaml:" in shown["fault"] or "step" in shown["fault"]
    assert len(rows_of(browser.run("cutjoint.drive.table()"))) >= 1 + 1100 // 17
    browser.picture(PICTURES / "drive-fault.png")
    browser.run("cutjoint.drive.rewind(1e9)")
    assert browser.run("document.getElementById('failure').hidden")
    steps(browser, 100)
    assert (browser.run("cutjoint.drive.shown().step"), browser.run("cutjoint.drive.shown().fault")) == (1100, "")


@needs_cpp
@needs_zig
def test_a_car_turns_to_the_left_brakes_and_is_seen_from_behind(car: Path, browser: Page) -> None:
    browser.open(car, size=(1280, 800))
    names = ["x", "y", "vx", "yaw"]
    steps(browser, 1500, [[0, "down", "ArrowUp"]])
    fast = dict(zip(names, browser.run("cutjoint.drive.outputs()"), strict=False))
    assert fast["vx"] > 20.3, "its throttle is open"
    steps(browser, 1500, [[1500, "up", "ArrowUp"], [1500, "down", "KeyA"]])
    left = dict(zip(names, browser.run("cutjoint.drive.outputs()"), strict=False))
    assert left["yaw"] > 0.2
    assert left["y"] > 1.0
    assert browser.run("cutjoint.drive.shown().axes")["steer"] == pytest.approx(0.3 / (1 + (left["vx"] / 8) ** 2), rel=0.1), (
        "less, at this speed"
    )
    eye, at = browser.run("cutjoint.eye().from"), np.array([left["x"], left["y"]])
    ahead = np.array([np.cos(left["yaw"]), np.sin(left["yaw"])])
    assert (np.array([eye[0], -eye[2]]) - at) @ ahead < -2.0, "the eye is behind it"
    browser.picture(PICTURES / "drive-car.png")
    steps(browser, 6000, [[3000, "up", "KeyA"], [3000, "down", "ArrowDown"]])
    assert abs(browser.run("cutjoint.drive.outputs()")[2]) < 0.3, "it stands"
    assert float(browser.run("document.getElementById('fast').textContent")) <= 1
    browser._call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
    browser.picture(PICTURES / "drive-phone.png")
    places = "[...document.querySelectorAll('#pads button')].map((pad) => pad.getBoundingClientRect())"
    assert browser.run(f"{places}.map((at) => at.left >= 0 && at.right <= innerWidth)") == [True] * 4
    require_silence(browser)
