"""Options of `cutjoint drive`: inputs and their ends, replays that are refused, parts of pages."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from cutjoint.methods import Loops
from cutjoint.model.read import read_model, read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.scenes import find_case, with_loops
from cutjoint.view.drive import Ends, make_drive
from cutjoint.view.page import own_script
from cutjoint.view.views import show_start
from tests.conftest import MODELS
from tests.view.conftest import call

DELTA = MODELS / "delta.yaml"


def compile_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.compile.c_export.Standalone.build_module", lambda self: b"")
    monkeypatch.setattr("cutjoint.view.drive.require_zig", lambda: "")


@pytest.mark.parametrize(("change", "said"), [
    ({"every": 0}, "(every: "), ({"dt": -1.0}, "(dt: "), ({"initial_values": {"q1": "fast"}}, "(initial_values.q1: "),
    ({"events": [[0, "q1"]]}, "(events.0"), ({"given": {"q1": 1.0}}, "(given: "),
    ({"steps": 1.5}, "(steps: "), ({"more": 1}, "(more: "), ({"mark": "0"}, "a drive of 'delta', circle, in another version"),
])  # fmt: skip
def test_a_replay_refuses_what_no_page_has_saved(change: dict[str, object], said: str, tmp_path: Path) -> None:
    drive = {"cutjoint": "drive", "mark": "", "model": "delta", "scene": "circle", "dt": 0.01, "initial_values": {}, "steps": 1, "every": 1}
    (tmp_path / "drive.json").write_text(json.dumps({**drive, "events": [], **change}), encoding="utf-8")
    assert said in call("drive", DELTA, "--replay", tmp_path / "drive.json", "--out", tmp_path / "out.csv", status=1)


def test_a_drive_of_an_earlier_version_names_its_initial_values_given(tmp_path: Path) -> None:
    drive = {"cutjoint": "drive", "mark": "0", "model": "delta", "scene": "circle", "dt": 0.01, "steps": 1, "every": 1}
    (tmp_path / "drive.json").write_text(json.dumps({**drive, "given": {"q1": 0.1}, "events": []}), encoding="utf-8")
    assert "in another version" in call("drive", DELTA, "--replay", tmp_path / "drive.json", "--out", tmp_path / "out.csv", status=1)


def test_ends_follow_from_options_units_and_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compile_nothing(monkeypatch)
    model, scene = find_case(read_model_text(DELTA.read_text(encoding="utf-8"), "delta.yaml"), None)
    drive = make_drive(model, scene, {}, ranges=[Ends(name="q2", low=-0.1, high=0.2)], roles={"throttle": Ends(name="kp", high=900.0)})
    axes = {axis["name"]: axis for axis in drive.facts["axes"]}  # type: ignore[attr-defined]
    assert list(axes) == ["kp", "q1", "q2", "q3", "kd"]
    assert [axis["plus"] for axis in axes.values()] == [("ArrowUp", "KeyW"), ("KeyL",), ("KeyI",), (), ()]
    assert (axes["kp"]["low"], axes["kp"]["rest"], axes["kp"]["high"], axes["kp"]["kind"]) == (800, 800, 900, "parameter")
    assert (axes["q1"]["low"], axes["q1"]["high"]) == (-0.5, 0.5)
    assert (axes["q2"]["low"], axes["q2"]["high"]) == (-0.1, 0.2)


def test_parameters_of_the_start_alone_are_no_controls(monkeypatch: pytest.MonkeyPatch) -> None:
    compile_nothing(monkeypatch)
    model, scene = find_case(read_model_text("""
cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
parameters: {v: {value: 0.5, unit: rad/s, binding: param}, k: {value: 2, unit: N*m/rad, binding: param}}
bodies: {arm: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.1, 0.1]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}}
forces: {spring: {kind: joint_force, joint: pin, law: -k*position}}
outputs: [pin.angle]
scenes: {swing: {end: 1, output_step: 0.01, rates: {pin.angle_rate: v}}}
""", "arm.yaml"), None)
    assert [axis["name"] for axis in make_drive(model, scene, {}).facts["axes"]] == ["k"]  # type: ignore[attr-defined]
    with pytest.raises(RunError, match="'v' changes the start only, which is fixed in a page; change it in the file"):
        make_drive(model, scene, {"v": 1.0})


@pytest.mark.parametrize(("options", "said"), [
    (("--steer", "q9"), "model 'delta' has no input or tunable parameter 'q9'; it has kd, kp, q1, q2, q3"),
    (("--steer", "q1=0.1"), "--steer q1=0.1: write q1=LOW,HIGH, or q1 alone"),
    (("--throttle", "q1=1,2"), "--throttle q1=1,2: write q1=FULL, or q1 alone"),
    (("--range", "q1=a,b"), "--range q1=a"),
    (("--range", "q1=1 m,2 m"), "q1"),
    (("--out", "x.csv"), "write a name that ends in .html"),
    (("--replay", DELTA), "no drive; save one in a page of cutjoint drive as 'drive (JSON)'"),
])  # fmt: skip
def test_wrong_options_are_reported(options: tuple[object, ...], said: str) -> None:
    """Before any compiler is looked for."""
    assert said in call("drive", DELTA, *options, status=1)


def test_a_replay_has_the_options_that_change_the_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compile_nothing(monkeypatch)
    options = ("--loops", "embedded", "--method", "recursive-newton", "--tunable", "crank.*")
    call("drive", MODELS / "slider_crank.yaml", *options, "--out", tmp_path / "page.html")
    found = re.search(r'"replay": "([^"]*)"', (tmp_path / "page.html").read_text(encoding="utf-8"))
    assert found is not None
    assert found[1] == "cutjoint drive slider_crank.yaml --scene turn --method recursive-newton --loops embedded --tunable 'crank.*'"


@pytest.mark.cpp
def test_a_page_shows_the_start_of_loops_as_functions() -> None:
    """Functions have no angles of the Iltis' tie rods."""
    model, scene = find_case(read_model(MODELS / "iltis.yaml"), "simul1")
    here, there = (show_start(model, with_loops(scene, loops), {}).poses for loops in Loops)
    assert all(here[name].shift == pytest.approx(there[name].shift) for name in there)


def test_pages_that_are_not_driven_have_no_part_of_it() -> None:
    assert "class Simulation " in own_script(driving=True)
    assert "class Simulation " not in own_script()
