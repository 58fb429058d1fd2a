"""Every command with `--view`, of every model of models/ and every kind of force: it writes page and glTF file, or says why not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.elements.forces import FORCES
from cutjoint.model.read import read_model
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.view.files import Gltf

pytestmark = needs_cpp

#: Models whose equilibria or modes are interpreted for longer than seconds.
LARGE = ("andrews", "axle", "car", "delta", "excavator", "iltis", "iltis_driven", "stewart")

#: Forces of all kinds, where they may without length, and a reaction: a load pulls a mass along a line, springs and a bushing hold it.
STILL = """
cutjoint: 1
name: still
gravity: [0, 0, -9.81]
points: {O: [0, 0, 0], W: [1, 0, 0.29]}
bodies:
  block: {mass: 1, centre_of_mass: O, inertia: [0.1, 0.1, 0.1]}
  hub: {mass: 20, centre_of_mass: W, inertia: [1, 1, 1]}
joints:
  slide: {kind: prismatic, bodies: [ground, block], at: O, axis: [0, 1, 0]}
  rise: {kind: prismatic, bodies: [ground, hub], at: W, axis: [0, 0, 1]}
forces:
  axial: {kind: axial_force, bodies: [ground, block], origin: O, axis: [0, 1, 0], point: O, law: -100*travel - rate}
  point: {kind: point_spring, bodies: [ground, block], from: O, to: [0, 0.5, 0], law: {stiffness: 200, damping: 1, free_length: 0.5}}
  pad: {kind: bushing, bodies: [ground, block], at: O, stiffness: [1, 300, 1, 1, 1, 1], damping: [1, 1, 1, 1, 1, 1]}
  motor: {kind: joint_force, joint: slide, law: -10*position}
  pull: {kind: load, body: block, at: O, force: [0, 3, 0]}
  rubbing: {kind: joint_friction, joint: slide, coefficient: 0.1}
  tyre:
    kind: tyre
    body: hub
    centre: W
    axis: [0, 1, 0]
    radius: 0.3
    stiffness: 2.0e+5
    calspan: {A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11,
              SN: 1.0274, AF1: -1.71e-5, AF2: 1.71e-5}
  wheel: {kind: wheel, body: hub, centre: W, axis: [0, 1, 0], radius: 0.3, force: [0, 0, 1e3*deflection]}
  foot: {kind: contact, bodies: [ground, hub], at: O, normal: z, centre: W, radius: 0.4, force: [0, 0, 10*deflection]}
reactions:
  side: {joint: slide, axes_of: block, direction: [1, 0, 0]}
outputs: [axial.force, point.force, pad.Fx, pad.Fy, pad.Fz, motor.force, pull.Fx, pull.Fy, pull.Fz, tyre.Fz, wheel.Fz, side.force, block.y]
scenes: {rest: {end: 0.1, output_step: 0.05}}
"""

COMMANDS = ("simulate", "equilibrium", "modes", "check", "view")


def call(command: str, model: Path, view: Path) -> str:
    """The message of a command that refuses a view, nothing where it has written one."""
    option = "--out" if command == "view" else "--view"
    scene = next(iter(read_model(model).scenes))
    more = ("--scene", scene, "--no-error", "--end", "0.02", "--out", view.with_suffix(".csv")) if command == "simulate" else ()
    result = CliRunner().invoke(main, [str(a) for a in (command, model, option, view, *more)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.output if result.exit_code else ""


@pytest.mark.parametrize("name", with_heavy([path.stem for path in sorted(MODELS.glob("*.yaml"))], *LARGE))
@pytest.mark.parametrize("command", COMMANDS)
def test_models(command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUTJOINT_IMPLEMENTATION", "interpreted")
    for ending in (".html", ".glb"):
        view = tmp_path / f"shown{ending}"
        refused = call(command, MODELS / f"{name}.yaml", view)
        assert view.exists() != bool(refused)
        assert not refused or command in ("equilibrium", "modes"), refused
        assert not refused or f"{name}.yaml:" in refused


def test_every_kind_of_force_is_in_the_model() -> None:
    assert all(f"kind: {kind}" in STILL for kind in FORCES)


@pytest.mark.parametrize("command", COMMANDS)
def test_forces(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A force that has no length is drawn along its axis, as long as a coil that is pressed together."""
    monkeypatch.setenv("CUTJOINT_IMPLEMENTATION", "interpreted")
    model = tmp_path / "still.yaml"
    model.write_text(STILL, encoding="utf-8")
    for ending in (".html", ".glb"):
        assert not call(command, model, tmp_path / f"shown{ending}")
    nodes = {node["name"]: node for node in Gltf.read(tmp_path / "shown.glb").document["nodes"]}
    assert nodes["axial"]["scale"][2] > 0.01
    x, y, z, w = nodes["axial"]["rotation"]
    assert abs(2 * (y * z - x * w)) == pytest.approx(1.0, abs=1e-6)  # its axis is y
    assert np.isfinite([number for node in nodes.values() for number in node.get("rotation", [])]).all()
