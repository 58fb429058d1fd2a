"""Printed tables in units for display; files keep the units of the model and name them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from cutjoint.cli import main
from cutjoint.report.response import in_display_units, vibration_table
from cutjoint.stepping.vibration import RandomVibration
from tests.conftest import needs_cpp

_LIFT = """
cutjoint: 1
name: lift
gravity: [0, 0, -9.81]
display: [kN, mm, deg]
bodies: {load: {mass: 2000, centre_of_mass: [0, 0, 1]}}
joints: {rail: {kind: prismatic, bodies: [ground, load], at: [0, 0, 0], axis: z}}
forces: {spring: {kind: joint_force, joint: rail, law: "-2.0e+5*position - 4000*rate"}}
scenes:
  rest: {end: 1, outputs: [load.z]}
  rise: {end: 1, output_step: 0.5, drive: {rail: "t**2"}, outputs: [load.z]}
"""


def _call(folder: Path, *words: str) -> str:
    (folder / "lift.yaml").write_text(_LIFT, encoding="utf-8")
    done = CliRunner().invoke(main, [words[0], str(folder / "lift.yaml"), *words[1:]])
    assert done.exit_code == 0, done.output
    return done.output


@needs_cpp
@pytest.mark.parametrize(
    ("display", "title", "height", "force"),
    [((), "mm and deg", "901.90000", "19.62 kN"), (("--display", "cm"), "cm and rad", "90.19000", "19620 N")],
)
def test_equilibria(tmp_path: Path, display: tuple[str, ...], title: str, height: str, force: str) -> None:
    """2000 kg on 200 kN/m: a sag of 98.1 mm and 19.62 kN; a stiffness is neither a force nor a length."""
    text = _call(tmp_path, "equilibrium", "--scene", "rest", *display)
    assert f"poses, {title}" in text
    assert height in text
    assert " ".join(["spring", "force", force]) in " ".join(text.split())
    assert "-200000 N/m" in " ".join(text.split())


@needs_cpp
def test_a_trim_has_its_unknowns_in_them(tmp_path: Path) -> None:
    """300 kg/s hold a sled of any mass back at 20 m/s with 6 kN."""
    text = (
        "cutjoint: 1\nname: sled\ndisplay: [kN, km/h]\ngravity: [0, 0, 0]\nparameters: {push: {value: 0, unit: N, binding: input}}\n"
        "bodies: {sled: {mass: 300, centre_of_mass: [0, 0, 0]}}\n"
        "joints: {way: {kind: prismatic, bodies: [ground, sled], at: [0, 0, 0], axis: x}}\n"
        "forces: {engine: {kind: joint_force, joint: way, law: push - 300*rate}}\noutputs: [way.displacement]\n"
        "scenes: {steady: {end: 1, trim: {find: [push], hold: {way.displacement_rate: 20}}}}\n"
    )
    (tmp_path / "sled.yaml").write_text(text, encoding="utf-8")
    done = CliRunner().invoke(main, ["equilibrium", str(tmp_path / "sled.yaml")])
    assert done.exit_code == 0, done.output
    assert "push = 6 kN" in done.output


@needs_cpp
def test_drives(tmp_path: Path) -> None:
    """At 1 s 2000 (9.81 + 2) N lift, and the spring's 2e5 N and the damper's 8e3 N are overcome; the file has N."""
    table = tmp_path / "drives.csv"
    text = _call(tmp_path, "inverse", "--scene", "rise", "--out", str(table))
    assert "231.62" in text
    assert "kN" in text
    assert np.genfromtxt(table, delimiter=",", names=True)["rail"][-1] == pytest.approx(231.62e3, rel=1e-9)
    assert json.loads((tmp_path / "drives.units.json").read_text())["rail"] == "N"


def test_random_vibration() -> None:
    """Root mean squares go by the unit, densities by its square; what has no such unit stays."""
    found = RandomVibration(
        frequencies=np.ones(1), densities=np.array([[4e6, 9.0]]), rms=np.array([2000.0, 3.0]), weighted=np.array([np.nan, 2.5]),
        white=np.array([2100.0, 3.5]), variation=np.array([0.1, np.nan]), outputs=("tyre.force", "body.az"),
        units={"tyre.force": "N", "body.az": "m/s^2", "post": "m"},
    )  # fmt: skip
    shown = in_display_units(found, ["kN", "mm"])
    assert shown.densities == pytest.approx(np.array([[4.0, 9.0]]))
    twice = in_display_units(replace(found, outputs=("tyre.force", "tyre.force")), ["kN"])
    assert twice.rms == pytest.approx(np.array([2.0, 0.003]))
    console = Console(width=120, record=True)
    console.print(vibration_table(shown, "road", "Wk"))
    rows = [line.split() for line in console.export_text().splitlines()]
    assert ["tyre.force", "kN", "2", "2.1", "-", "10"] in rows
    assert ["body.az", "m/s^2", "3", "3.5", "2.5", "-"] in rows


def test_wrong_units_are_named(tmp_path: Path) -> None:
    (tmp_path / "lift.yaml").write_text(_LIFT, encoding="utf-8")
    for command in ("equilibrium", "inverse", "response"):
        road = ["--road", "C", "--speed", "9"] if command == "response" else []
        done = CliRunner().invoke(main, [command, str(tmp_path / "lift.yaml"), "--display", "foo", *road])
        assert (done.exit_code, "--display: unknown unit 'foo'" in done.output) == (1, True), done.output
