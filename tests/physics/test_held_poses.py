"""Starts at rest with held coordinates, by every host that seeks one: forces hold them, as a guide would; others carry none of that.

Random mechanisms are those of the fuzzer's kind `poses`.
"""

from __future__ import annotations

import json
from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.elements.joints import JOINTS
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.report.tables import locking_force_facts
from cutjoint.run.results import read_locking_forces
from cutjoint.run.simulation import simulate
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from cutjoint.tasks.states import find_scene_equilibrium, find_scene_modes
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

HELD = pi / 6

TEXT = """\
cutjoint: 1
name: hanging
gravity: [0, 0, -9.81]
points: {A: [0, 0, 0], B: [0, 0, -1], C: [0, 0, -2]}
parameters: {mass: {value: 1 kg, binding: param}}
bodies:
  upper: {shapes: [{rod: {from: A, to: B}, mass: 1}]}
  lower: {shapes: [{rod: {from: B, to: C}, mass: mass}]}
joints:
  top: {kind: revolute, bodies: [ground, upper], at: A, axis: [0, 1, 0]}
  middle: {kind: revolute, bodies: [upper, lower], at: B, axis: [0, 1, 0]}
reactions:
  holding: {joint: top, axes_of: upper, direction: [0, 1, 0]}
outputs: [upper.pitch, lower.pitch, lower.x]
scenes:
  start: {end: 0.01, output_step: 0.01, pose: equilibrium, positions: {top.angle: 30 deg}}
"""


def hanging() -> Model:
    return read_model_text(TEXT, "hanging.yaml")


def near(top: float, middle: float) -> str:
    """The model with a start that is sought near angles."""
    positions = f"positions: {{top.angle: {top}, middle.angle: {middle}}}, near: [top.angle, middle.angle]"
    return TEXT.replace("positions: {top.angle: 30 deg}", positions).replace("lower.x]", "lower.x, upper.z, lower.z]")


def test_a_force_holds_what_is_held() -> None:
    """Two hanging rods, the upper one held aslant: the lower one hangs, and the moment at the top carries both."""
    found = find_scene_equilibrium(hanging(), hanging().scenes["start"]).values
    assert found["upper.pitch"] == pytest.approx(HELD, abs=1e-12)
    assert found["lower.pitch"] == pytest.approx(0.0, abs=1e-8)
    assert found["holding.moment"] == pytest.approx(9.81 * (0.5 + 1.0) * sin(HELD), rel=1e-8)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("compiled", [False, True])
def test_runs_begin_there(method: str, compiled: bool) -> None:
    model = hanging()
    start = model.scenes["start"]
    generated = compile_scene(model, start, CompileOptions(method=method)) if compiled else None
    run = simulate(generated or compile_interpreted(model, start, method=method), check=False)
    assert run["lower.pitch"][0] == pytest.approx(0.0, abs=1e-8)
    assert run["lower.x"][0] == pytest.approx(-sin(HELD), abs=1e-8)
    assert run["upper.pitch"][-1] < HELD  # released, it falls


#: Two bodies without a common motion: a crank with a slider, where 8000 N push, and 4 t in a plane guide, which is pushed down too.
PUSHED = """\
cutjoint: 1
name: pushed
gravity: [0, 0, -9.81]
points: {A: [0, 0, 0], B: [0.3, 0, 0.4], C: [1.5, 0, 0]}
bodies:
  crank: {massless: true}
  rod: {massless: true}
  slider: {mass: 1, inertia: [1, 1, 1], centre_of_mass: C}
  block: {mass: 4000, inertia: [1, 1, 1], centre_of_mass: A}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: A, axis: [0, 1, 0]}
  elbow: {kind: revolute, bodies: [crank, rod], at: B, axis: [0, 1, 0], cut: true}
  wrist: {kind: revolute, bodies: [rod, slider], at: C, axis: [0, 1, 0]}
  rail: {kind: prismatic, bodies: [ground, slider], at: C, axis: [1, 0, 0]}
  plane: {kind: planar, bodies: [ground, block], at: A, axis: [0, 1, 0]}
forces: {push: {kind: joint_force, joint: rail, law: -8000}}
outputs: [slider.x, block.z]
scenes:
  start:
    {end: 0.01, output_step: 0.01, pose: equilibrium, positions: {pin.angle: 0, plane.displacement_1: 0, plane.displacement_2: 0}}
"""


def test_a_run_reports_what_holds_its_start(tmp_path: Path) -> None:
    """The moment at the crank by virtual work, with dx/dphi of the slider; in the plane the weight along one of its axes."""
    model = read_model_text(TEXT, "hanging.yaml")
    start = model.scenes["start"]
    run, rest = simulate(compile_interpreted(model, start)), find_scene_equilibrium(model, start)
    for held in (run.locking_forces, rest.locking_forces):
        assert held == {"top.angle": (pytest.approx(9.81 * 1.5 * sin(HELD), rel=1e-8), "N*m")}
    model = read_model_text(PUSHED, "pushed.yaml")
    run = simulate(compile_interpreted(model, model.scenes["start"]), error=False)
    slope = 0.4 + 0.4 * 0.3 / 1.2  # of x = 0.5 cos(a) + sqrt(l^2 - (0.5 sin(a))^2), where phi turns from z to x
    assert run.locking_forces["pin.angle"] == (pytest.approx(8000 * slope, rel=1e-8), "N*m")
    ((name, (force, unit)),) = ((name, found) for name, found in run.locking_forces.items() if name.startswith("plane"))
    assert (name.partition("_")[0], abs(force), unit) == ("plane.displacement", pytest.approx(4000 * 9.81, rel=1e-8), "N")
    assert [words.split()[1:3] for _, words in locking_force_facts(run.locking_forces) if words.startswith("plane")] == [["-39.24", "kN,"]]
    path = tmp_path / "hanging.yaml"
    path.write_text(TEXT, encoding="utf-8")
    done = CliRunner().invoke(main, ["simulate", str(path), "--implementation", "interpreted", "--out", str(tmp_path / "run.csv")])
    assert "locked at the start by: top.angle 7.358 N*m, released at t = 0\n" in done.output
    free = read_model_text(near(0.1, 0.1), "hanging.yaml")
    assert not simulate(compile_interpreted(free, free.scenes["start"]), error=False).locking_forces


@pytest.mark.parametrize("kind", JOINTS)
def test_forces_along_coordinates_have_the_names_and_units_of_these(kind: str) -> None:
    joint = JOINTS[kind]
    found = read_locking_forces({"locking_forces": dict.fromkeys((f"a.{rate}" for rate in joint.speeds), 2.0)})
    units = [unit for _, unit in found.values()]
    assert units == ["N" if joint.units[rate] == "m/s" else "N*m" for rate in joint.speeds]
    assert list(found)[: len(joint.coordinates)] == [f"a.{name}" for name in joint.coordinates]


@pytest.mark.parametrize("method", METHODS)
def test_positions_may_be_where_a_rest_is_sought(method: str) -> None:
    """Two rods have four poses at rest; each is found from near it, and nothing holds it there."""
    for upper, lower in ((0.0, 0.0), (0.0, pi), (pi, 0.0), (pi, -pi)):
        model = read_model_text(near(upper - 0.2, lower + 0.3), "hanging.yaml")
        run = simulate(compile_interpreted(model, model.scenes["start"], method=method), check=False)
        heights = -cos(upper) / 2, -cos(upper) - cos(upper + lower) / 2
        assert (run["upper.z"][0], run["lower.z"][0]) == pytest.approx(heights, abs=1e-12)
        assert (run["upper.z"][-1], run["lower.z"][-1]) == pytest.approx(heights, abs=1e-12)
        assert find_scene_equilibrium(model, model.scenes["start"]).values["holding.moment"] == pytest.approx(0.0, abs=1e-6)


def test_hosts_seek_a_rest_near_positions(tmp_path: Path) -> None:
    """Folders tell positions that lead from those that hold; a host's own value of one that leads does so too."""
    path = tmp_path / "hanging.yaml"
    path.write_text(near(0.2, 3.0), encoding="utf-8")
    sim = cutjoint.load(path).reset()
    assert (sim.outputs["upper.z"], sim.outputs["lower.z"]) == pytest.approx((-0.5, -0.5), abs=1e-12)
    sim.reset(coordinates={"top.angle": 3.0})
    assert (sim.outputs["upper.z"], sim.outputs["lower.z"]) == pytest.approx((0.5, 0.5), abs=1e-12)


def test_batches_begin_there() -> None:
    model = hanging()
    batch = simulate_batch(compile_scene_batch(model, model.scenes["start"]), [{"mass": 1.0 + k} for k in range(3)])
    assert batch.maximum["lower.pitch"] == pytest.approx(0.0, abs=1e-3)  # 0.01 s after the release


def test_simulations_of_a_host_begin_there(tmp_path: Path) -> None:
    """From Python, on the interface in C of folders and FMUs: coordinates held by the scene, and others held by the host."""
    path = tmp_path / "hanging.yaml"
    path.write_text(TEXT, encoding="utf-8")
    sim = cutjoint.load(path).reset()
    assert sim.outputs["lower.pitch"] == pytest.approx(0.0, abs=1e-8)
    sim.reset(coordinates={"top.angle": -0.2, "middle.angle": 0.5})
    assert sim.outputs["lower.pitch"] == pytest.approx(0.3, abs=1e-12)
    sim.reset(coordinates={"top.angle": -0.2})
    assert sim.outputs["lower.pitch"] == pytest.approx(0.0, abs=1e-8)


def test_a_host_is_reported_where_a_scene_is_not_made_for_that(tmp_path: Path) -> None:
    """Without the pose in its scene a simulation knows no masses: what carries a force is named."""
    path = tmp_path / "hanging.yaml"
    path.write_text(TEXT.replace("pose: equilibrium, ", ""), encoding="utf-8")
    sim = cutjoint.load(path)
    with pytest.raises(cutjoint.SimulationError, match=r"top\.angle_rate"):
        sim.reset(equilibrium=True)
    assert sim.reset(equilibrium=True, coordinates={"top.angle": 0.0}).outputs["lower.pitch"] == pytest.approx(0.0, abs=1e-8)


def test_modes_say_why_there_are_none() -> None:
    model = hanging()
    with pytest.raises(RunError, match=r"hanging.yaml:16:3: scene 'start': .* N\*m hold 'top.angle', so that small motions have no"):
        find_scene_modes(model, model.scenes["start"])


def test_a_washing_machine_stands_as_its_drum_is_held() -> None:
    """A tub on two springs with an unbalanced drum, whose angle is held: the tub tilts by the moment of the unbalanced mass."""
    mass, arm, stiffness, half = 4.0, 0.25, 3.0e4, 0.3
    spring = {"kind": "point_spring", "bodies": ["ground", "tub"], "law": {"stiffness": stiffness, "free_length": 0.4}}
    text = json.dumps({
        "cutjoint": 1, "name": "washer", "gravity": [0, 0, -9.81],
        "bodies": {
            "tub": {"mass": 40, "centre_of_mass": [0, 0, 0], "inertia": [2, 2, 2]},
            "drum": {"mass": mass, "centre_of_mass": [0, 0, -arm], "inertia": [0.1, 0.1, 0.1]},
        },
        "joints": {
            "mount": {"kind": "planar", "bodies": ["ground", "tub"], "at": [0, 0, 0], "axis": [0, 1, 0]},
            "bearing": {"kind": "revolute", "bodies": ["tub", "drum"], "at": [0, 0, 0], "axis": [0, 1, 0]},
        },
        "forces": {
            "left": {**spring, "from": [-half, 0, 0.4], "to": [-half, 0, 0]},
            "right": {**spring, "from": [half, 0, 0.4], "to": [half, 0, 0]},
        },
        "scenes": {"spin": {"end": 1, "pose": "equilibrium", "positions": {"bearing.angle": pi / 2}}}, "outputs": ["tub.pitch"],
    })  # fmt: skip
    model = read_model_text(text, "washer.yaml")
    found = find_scene_equilibrium(model, model.scenes["spin"]).values
    tilt = found["tub.pitch"]
    # the moment of the two tensions and of the weights about the tub's centre, worked out by hand
    centre = np.array([found["tub.x"], found["tub.z"]])
    turn = np.array([[cos(tilt), sin(tilt)], [-sin(tilt), cos(tilt)]])
    moment, force = -mass * 9.81 * (turn @ [-arm, 0.0])[0], np.array([0.0, -(40 + mass) * 9.81])
    for side in (-half, half):
        end = turn @ [side, 0.0]
        way = np.array([side, 0.4]) - (centre + end)
        pull = stiffness * (np.hypot(*way) - 0.4) * way / np.hypot(*way)
        force, moment = force + pull, moment + end[0] * pull[1] - end[1] * pull[0]
    assert np.abs(force).max() < 1e-3
    assert abs(moment) < 1e-3
    assert abs(tilt) > 1e-3
