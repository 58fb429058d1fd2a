"""Approximations: their changes, and errors that follow the omitted parts."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.outcome import Outcome
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.freeze import freeze_idle
from cutjoint.reduce.measure import distance
from cutjoint.reduce.sequence import reduction_sequence
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

#: A pendulum with a lamp on a stiff hinge, which a cord holds; the lamp starts away from where it is drawn.
LAMP = """\
cutjoint: 1
name: lamp
gravity: [0, 0, -9.81]
parameters: {stiffness: {value: 1.0e+6, unit: N*m, binding: param}}
bodies:
  rod: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1]}
  lamp: {mass: 2, centre_of_mass: [1.2, 0.1, 0.05], inertia: [0.02, 0.03, 0.04, 0.001, 0.002, 0.003]}
joints:
  pin: {kind: revolute, bodies: [ground, rod], at: [0, 0, 0], axis: [0, 1, 0]}
  hinge: {kind: revolute, bodies: [rod, lamp], at: [1, 0, 0], axis: [0, 0, 1],
          spring: {stiffness: stiffness, damping: 40, free_position: 0.3}}
forces:
  cord: {kind: point_spring, bodies: [ground, lamp], from: [1, 1, 1], to: [1.4, 0, 0], law: {stiffness: 20, free_length: 0.5, damping: 0.1}}
markers: {tip: {body: lamp, at: [1.4, 0, 0]}}
outputs: [pin.angle, lamp.x, lamp.y, lamp.z, tip.x, tip.y, tip.z, cord.length]
scenes:
  fall: {end: 1, output_step: 0.01, positions: {hinge.angle: 0.3}, numerics: {dt: 0.0005, solver_tolerance: 1.0e-9}}
"""


def run(model: Model, scene: Scene, prepare: Callable[[Model, Scene], Artifact] = compile_scene) -> Trajectory:
    """Orders of errors are those of programs, whichever way these are run: nothing is compiled where only an order is looked for."""
    trajectory = simulate(prepare(model, scene))
    assert trajectory.failure is None
    return trajectory


def words(outcome: Outcome) -> dict[str, str]:
    return {note.element: note.text for note in (*outcome.done, *outcome.left)}


def lamp(old: str = "", new: str = "") -> tuple[Model, Scene]:
    assert not old or old in LAMP
    model = read_model_text(LAMP.replace(old, new) if old else LAMP, "lamp.yaml")
    return model, model.scenes["fall"]


def by_hand() -> tuple[Model, Scene]:
    """The lamp drawn where it starts, turned by 0.3 rad about the hinge, on a joint that does not move."""
    cosine, sine = np.cos(0.3), np.sin(0.3)
    R, hinge = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]), np.array([1.0, 0, 0])
    J = R @ np.array([[0.02, 0.001, 0.002], [0.001, 0.03, 0.003], [0.002, 0.003, 0.04]]) @ R.T
    inertia = [float(J[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    centre, tip = ([float(x) for x in hinge + R @ (np.array(p) - hinge)] for p in ([1.2, 0.1, 0.05], [1.4, 0, 0]))
    text = LAMP.replace("centre_of_mass: [1.2, 0.1, 0.05], inertia: [0.02, 0.03, 0.04, 0.001, 0.002, 0.003]",
                        f"centre_of_mass: {centre}, inertia: {inertia}").replace("[1.4, 0, 0]", str(tip))  # fmt: skip
    start, end = text.index("  hinge:"), text.index("forces:")
    text = text[:start] + "  hinge: {kind: fixed, bodies: [rod, lamp], at: [1, 0, 0]}\n" + text[end:]
    model = read_model_text(text.replace("positions: {hinge.angle: 0.3}, ", ""), "lamp.yaml")
    return model, model.scenes["fall"]


def test_reduce_prints_by_how_much_outputs_differ(tmp_path: Path) -> None:
    """A stiff joint that is frozen: positions differ by what it yields; the equal motion of the exact passes has no such line."""
    path = tmp_path / "lamp.yaml"
    path.write_text(LAMP, encoding="utf-8")
    result = CliRunner().invoke(main, ["reduce", str(path), "--approximate", "--dt", "1ms"])
    assert result.exit_code == 0, result.output
    found = result.output.partition("frozen: largest differences of outputs from the full model\n")[2]
    assert re.match(r" rad +\d\.\de-07 \(pin\.angle\) *\n m +\d\.\de-0", found)


def test_a_frozen_body_is_where_it_starts() -> None:
    outcome = freeze_idle(*lamp())
    assert [b.name for b in outcome.model.bodies] == ["rod"]
    assert [f.name for f in outcome.model.forces] == ["cord"]
    assert words(outcome)["hinge"].startswith("is frozen: it moves by ")
    frozen, drawn = run(outcome.model, outcome.scene), run(*by_hand())
    assert list(frozen.columns) == list(drawn.columns)
    assert np.abs(frozen["pin.angle"]).max() > 0.5
    for column in frozen.columns:
        assert frozen[column] == pytest.approx(drawn[column], abs=1e-9), column


def test_the_error_falls_as_the_hinge_gets_stiff() -> None:
    errors = []
    for stiffness in ("2.0e+4", "4.0e+4"):
        model, scene = lamp("value: 1.0e+6", f"value: {stiffness}")
        scene = replace(scene, accuracy=0.1)
        outcome = freeze_idle(model, scene)
        assert outcome.done
        errors.append(distance(run(outcome.model, outcome.scene, compile_interpreted), run(model, scene, compile_interpreted)))
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.2)


@pytest.mark.parametrize(
    ("old", "new", "note"),
    [
        ("[pin.angle,", "[hinge.angle, pin.angle,", ("hinge", "is not frozen: the output 'hinge.angle' needs it")),
        ("lamp.x, lamp.y", "lamp.yaw, lamp.y", ("lamp", "is not frozen: the output 'lamp.yaw' needs its attitude")),
    ],
)
def test_what_is_asked_for_is_not_frozen(old: str, new: str, note: tuple[str, str]) -> None:
    outcome = freeze_idle(*lamp(old, new))
    assert outcome.done == ()
    assert note in words(outcome).items()


def test_joints_that_move_are_not_frozen() -> None:
    outcome = freeze_idle(*lamp("value: 1.0e+6", "value: 1.0e+3"))
    assert (outcome.done, outcome.left) == ((), ())


@pytest.mark.heavy
def test_a_standing_car_is_one_body() -> None:
    """Nothing moves: the frozen car stands as the full one does."""
    model = read_model(MODELS / "iltis.yaml")
    scene = model.scenes["iavsd_equilibrium"]
    scene = replace(scene, outputs=tuple(o for o in scene.outputs if o.element == "chassis"))
    variants = reduction_sequence(model, scene, approximate=True)
    assert ("frozen", 6) in [(r.name, r.unknowns) for r in variants]
    full = run(model, scene)
    for variant in variants[1:]:
        assert distance(run(variant.model, variant.scene), full) < 1e-7
