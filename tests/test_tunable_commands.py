"""Constants that become parameters: `--tunable` stands in every command with `--set`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from click.testing import CliRunner

from cutjoint.cli import main
from tests.conftest import ROOT, needs_cpp
from tests.edges.commands import commands

LIFT = """
cutjoint: 1
name: lift
gravity: [0, 0, -9.81]
bodies: {load: {mass: 2, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, load], at: [0, 0, 0], axis: z, guide: 0.1*t**2}}
scenes: {rise: {end: 1, output_step: 0.5}}
"""


def call(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(main, words)
    return done.exit_code, done.output


def test_every_command_that_sets_parameters_makes_constants_tunable() -> None:
    options = {name: {switch for p in command.params for switch in p.opts} for name, command in commands().items()}
    setting = {name for name, switches in options.items() if "--set" in switches}
    assert {"simulate", "realtime", "reduce", "response", "kinematics"} <= setting
    assert {name for name in setting if "--tunable" not in options[name]} <= {"bench"}  # which compares models as they are


@needs_cpp
def test_reduce_takes_a_mass_that_becomes_tunable(tmp_path: Path) -> None:
    (tmp_path / "lift.yaml").write_text(LIFT)
    code, text = call("reduce", str(tmp_path / "lift.yaml"), "--tunable", "load.mass", "--set", "load.mass=-1")
    assert code == 1
    assert "load" in text
    assert "mass" in text
    assert "no parameter" not in text


@needs_cpp
def test_inverse_takes_a_mass_that_becomes_tunable(tmp_path: Path) -> None:
    (tmp_path / "lift.yaml").write_text(LIFT)
    forces = []
    for mass in (2.0, 3.0):
        words = ("--tunable", "load.mass", "--set", f"load.mass={mass}", "--out", str(tmp_path / "out.csv"))
        code, text = call("inverse", str(tmp_path / "lift.yaml"), *words)
        assert code == 0, text
        forces.append(np.genfromtxt(tmp_path / "out.csv", delimiter=",", skip_header=1)[:, 1])
    assert np.abs(np.abs(forces) / np.array([[2.0], [3.0]]) - 10.01).max() < 1e-9
    assert "no constant that could be tunable" in call("inverse", str(tmp_path / "lift.yaml"), "--tunable", "lod.mass")[1]


def test_kinematics_takes_a_hardpoint_that_becomes_tunable(tmp_path: Path) -> None:
    model, tables = str(ROOT / "models" / "axle.yaml"), []
    for change in ((), ("--tunable", "corner.UB.z", "--set", "corner.UB.z=0.32"), ("--tunable", "*UB.z")):
        code, text = call("kinematics", model, "--points", "5", *change)
        tables.append(text if code == 0 else f"{code}: {text}")
    assert tables[0] == tables[2], tables[2]
    assert tables[0] != tables[1]
