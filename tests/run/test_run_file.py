"""Numbers that follow from parameters, or a message that names the one without a value."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.record import RunFile
from cutjoint.run.run_file import make_run_file
from tests.conftest import needs_cpp

#: A wheel on a strut whose place, speed and radius follow from parameters.
STRUT = """\
cutjoint: 1
name: strut
gravity: [0, 0, -9.81]
parameters:
  a: {value: 2, binding: param}
  k: {value: 8, binding: param}
bodies: {hub: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {rail: {kind: prismatic, bodies: [ground, hub], at: [0, 0, 0], axis: [0, 0, 1]}}
forces:
  tyre:
    kind: tyre
    body: hub
    centre: [0, 0, 0.3]
    axis: [0, 1, 0]
    radius: 0.3*a/k + where(k > 0, 0.2, 0.1)
    stiffness: 2.0e+5
    calspan: {A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11,
              SN: 1.0274, AF1: -1.71e-5, AF2: 1.71e-5}
outputs: [hub.z]
scenes:
  placed: {end: 0.1, positions: {rail.displacement: a/k}}
  thrown: {end: 0.1, rates: {rail.displacement_rate: sqrt(k)}}
  rolled: {end: 0.1, road: {profile: [{flat: 1}]}}
"""


def follow(scene: str, **changes: float) -> RunFile:
    model = read_model_text(STRUT, "strut.yaml")
    return make_run_file(model, model.scenes[scene], changes, task="simulate")


def test_the_file_is_plain_data_in_an_order_that_stays() -> None:
    found = follow("placed").entries()
    assert list(found) == [
        "task", "parameters", "integrator", "solver", "stabilisation", "numerics", "end", "output_step", "pose", "positions", "rates",
        "roads", "out",
    ]  # fmt: skip
    assert list(found["numerics"]) == [
        "dt", "penalty", "tolerance", "iterations", "multiplier_updates", "fixed_cost", "events", "absolute_tolerance", "spectral_radius",
    ]  # fmt: skip
    assert (found["task"], found["end"], found["positions"]) == ("simulate", 0.1, {"rail.displacement": 0.25})
    assert json.loads(json.dumps(found)) == found


@pytest.mark.parametrize("changes", [{}, {"energy": True}, {"inputs": {"push": {"value": 1.0}}}])
def test_the_record_comes_back_from_its_data(changes: dict[str, Any]) -> None:
    file = replace(follow("rolled"), **changes)
    again = RunFile.of(json.loads(json.dumps(asdict(file))))
    assert again == file
    assert again.entries() == file.entries()
    assert {key for key in file.entries() if key in ("energy", "inputs")} == set(changes)


def test_other_settings_leave_the_file_as_it_was() -> None:
    file = follow("placed")
    other = file.with_settings(dt=0.5 * file.settings.dt)
    assert other.entries() == {**file.entries(), "numerics": {**file.entries()["numerics"], "dt": 0.5 * file.settings.dt}}
    with pytest.raises(TypeError, match="unexpected keyword argument 'step'"):
        file.with_settings(step=1.0)


def test_numbers_follow() -> None:
    assert follow("placed").positions == {"rail.displacement": 0.25}
    assert follow("placed", k=4.0, a=1.0).positions == {"rail.displacement": 0.25}
    assert follow("thrown", k=9.0).rates == {"rail.displacement_rate": 3.0}


@pytest.mark.parametrize(
    ("scene", "changes", "message"),
    [
        ("placed", {"k": 0.0}, "strut.yaml:21:3: scene 'placed': positions: 'rail.displacement' has no finite value with a = 2, k = 0"),
        ("placed", {"k": 0.0, "a": 0.0}, "positions: 'rail.displacement' has no finite value with a = 0, k = 0; set other values"),
        ("placed", {"a": 1e308, "k": 1e-3}, "positions: 'rail.displacement' has no finite value with a = 1e+308, k = 0.001"),
        ("thrown", {"k": -1.0}, "strut.yaml:22:3: scene 'thrown': rates: 'rail.displacement_rate' has no finite value with k = -1"),
        ("rolled", {"k": 0.0}, "strut.yaml:10:3: tyre 'tyre': radius has no finite value with a = 2, k = 0"),
    ],
)
def test_what_has_no_value_is_reported_with_its_place(scene: str, changes: dict[str, float], message: str) -> None:
    with pytest.raises(RunError) as error:
        follow(scene, **changes)
    assert message in str(error.value)


@pytest.mark.parametrize(("k", "fault"), [(0.0, " has no finite value with a = 2, k = 0"), (1.0, ": 2 is outside of its bounds, 0 to 1;")])
def test_states_have_a_value_within_their_bounds(k: float, fault: str) -> None:
    scene, states = "  filled: {end: 0.1, states: {level: a/k}}\n", "states: {level: {start: 0, rate: -level, bounds: [0, 1]}}\n"
    model = read_model_text(STRUT + scene + states, "strut.yaml")
    assert make_run_file(model, model.scenes["filled"], {}, task="simulate").rates == {"level.value": 0.25}
    with pytest.raises(RunError, match=f"strut.yaml:24:3: scene 'filled': states: 'level'{fault}"):
        make_run_file(model, model.scenes["filled"], {"k": k}, task="simulate")


@needs_cpp
def test_the_command_ends_with_the_place(tmp_path: Path) -> None:
    (tmp_path / "strut.yaml").write_text(STRUT, encoding="utf-8")
    arguments = ["simulate", str(tmp_path / "strut.yaml"), "--scene", "placed", "--set", "k=0", "--out", str(tmp_path / "run.csv")]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 1
    assert "strut.yaml:21:3: scene 'placed': positions: 'rail.displacement' has no finite value" in done.output


@pytest.mark.parametrize(
    ("m", "message"),
    [
        (-2.0, "cart.yaml:6:3: body 'cart': with these parameters the mass is negative: -2 kg; set other values"),
        (0.5, "body 'cart': with these parameters a principal moment of inertia is negative: -0.5, 1, 1 kg m2; set other values"),
        (0.0, "body 'cart': its mass or inertia has no finite value with m = 0; set other values"),
        (1e60, "body 'cart': with these parameters its mass or inertia is larger than 1e+50 in SI units; set other values"),
    ],
)
def test_a_mass_that_no_body_has_is_refused(m: float, message: str) -> None:
    text = """\
cutjoint: 1
name: cart
gravity: [0, 0, -9.81]
parameters: {m: {value: 4, unit: kg, binding: param}}
bodies:
  cart: {mass: m, centre_of_mass: [0, 0, 0], inertia: ["1.5 - 1/m*1", 1, 1]}
joints: {rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0]}}
scenes: {still: {end: 1}}
"""
    model = read_model_text(text, "cart.yaml")
    assert make_run_file(model, model.scenes["still"], {"m": 2.0}, task="simulate").parameters == {"m": 2.0}
    with pytest.raises(RunError) as error:
        make_run_file(model, model.scenes["still"], {"m": m}, task="simulate")
    assert message in str(error.value)
