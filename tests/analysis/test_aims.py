"""Starts that have given places: `assemble` of a scene, against closed forms and the dense oracle."""

from __future__ import annotations

import pickle
from dataclasses import replace
from math import acos, asin, cos, pi, radians, sqrt
from pathlib import Path

import numpy as np
import pytest
import sympy

from cutjoint.analysis.closing import explore
from cutjoint.compile.options import CompileOptions
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Aim, Model
from cutjoint.package.errors import RunError
from cutjoint.reduce.sequence import reduction_sequence
from cutjoint.run.run_file import make_run_file, parameter_values, with_solved_coordinates
from cutjoint.run.scenes import find_case
from cutjoint.run.simulation import simulate
from cutjoint.stepping.load import load_scene
from cutjoint.sweeps.code import build_kernels
from cutjoint.sweeps.reading import read_study
from cutjoint.tasks.batch import simulate_batch
from tests.analysis.formulated import dense_closures, formulated
from tests.conftest import needs_cpp
from tests.mechanisms.random_models import random_loops, scene
from tests.oracles.dense import DenseMechanism
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

#: A slider-crank, r = 0.1 and l = 0.3, drawn stretched out, where the slider stands still.
CRANK = """
cutjoint: 1
name: lift
gravity: [0, 0, -9.81]
parameters:
  away: {value: 350, unit: mm, binding: param}
  arm: {value: 0.1, unit: m, binding: param}
  heavy: {value: 1, unit: kg, binding: param}
  turn: {value: 0, unit: rad, binding: input}
bodies:
  crank: {mass: heavy, centre_of_mass: [0.05, 0, 0], inertia: [0.01, 0.01, 0.01]}
  rod: {mass: 1, centre_of_mass: [0.2, 0, 0], inertia: [0.01, 0.01, 0.01]}
  slider: {mass: 1, centre_of_mass: [0.3 + arm, 0, 0], inertia: [0.01, 0.01, 0.01]}
joints:
  hinge: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: y}
  pin: {kind: revolute, bodies: [crank, rod], at: [arm, 0, 0], axis: y}
  end: {kind: revolute, bodies: [rod, slider], at: [0.3 + arm, 0, 0], axis: y}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0.3 + arm, 0, 0], axis: x}
forces:
  ram: {kind: point_spring, bodies: [ground, slider], from: [0, 0, 0.2], to: [0.3 + arm, 0, 0], law: 100*(length - 0.4)}
markers:
  elbow: {body: crank, at: [arm, 0, 0]}
  tip: {body: slider, at: [0.3 + arm, 0, 0]}
signals: {gap: tip.x - elbow.x}
outputs: [hinge.angle, tip.x, elbow.z, ram.length, leaning: {value: rod.pitch, unit: deg}]
scenes:
  place: {end: 0.01, assemble: {tip.x: away}}
  length: {end: 0.01, switches: {ram: false}, assemble: {ram.length: 400 mm}}
  lean: {end: 0.01, assemble: {leaning: -10 deg}}
  gap: {end: 0.01, assemble: {gap: 0.29}}
  distance: {end: 0.01, assemble: {"sqrt(tip.x**2 + (tip.z - 0.2)**2)": 0.4}}
  twice: {end: 0.01, assemble: {hinge.angle: 30 deg, elbow.z: -arm/2}}
  held: {end: 0.01, positions: {hinge.angle: 30 deg}, assemble: {tip.x: 0.35}}
  too_far: {end: 0.01, assemble: {tip.x: 450 mm}}
  both: {end: 0.01, assemble: {leaning: 10 deg, hinge.angle: 30 deg}}
"""


def model() -> Model:
    return read_model_text(CRANK, "lift.yaml")


def start_of(name: str, method: str = "recursive", **parameters: float) -> dict[str, float]:
    found = model()
    artifact = compile_scene(found, found.scenes[name], CompileOptions(method=method))
    return {column: float(rows[0]) for column, rows in simulate(artifact, parameters=parameters).columns.items()}


def crank_angle(x: float, arm: float = 0.1) -> float:
    """The angle at which the slider is at x, by the law of cosines."""
    return acos((x * x + arm * arm - 0.09) / (2 * x * arm))


@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented", "classical"])
def test_a_slider_is_where_it_is_wanted_by_all_methods(method: str) -> None:
    """From a dead centre, where no step of the crank moves the slider."""
    start = start_of("place", method)
    assert start["tip.x"] == pytest.approx(0.35, abs=1e-11)
    assert abs(start["hinge.angle"]) == pytest.approx(crank_angle(0.35), abs=1e-10)


def test_places_are_lengths_attitudes_signals_and_expressions() -> None:
    """The ram from 0.2 m above the hinge is as long as the root of x^2 + 0.2^2, whether it is switched on or not."""
    x = sqrt(0.4**2 - 0.2**2)
    for name in ("length", "distance"):
        assert start_of(name)["tip.x"] == pytest.approx(x, abs=1e-11)
    assert start_of("lean")["leaning"] == pytest.approx(-10, abs=1e-9)
    assert abs(start_of("lean")["hinge.angle"]) == pytest.approx(asin(3 * np.sin(radians(10))), abs=1e-10)
    start = start_of("gap")
    assert start["tip.x"] - 0.1 * cos(start["hinge.angle"]) == pytest.approx(0.29, abs=1e-11)


def test_places_that_follow_from_each_other_go_together() -> None:
    """The pitch about y takes the crank's end below the ground, z = -r sin(angle)."""
    start = start_of("twice")
    assert start["hinge.angle"] == pytest.approx(radians(30), abs=1e-11)
    assert start["elbow.z"] == pytest.approx(-0.05, abs=1e-11)


def test_what_cannot_be_had_is_reported_with_the_nearest_that_can() -> None:
    with pytest.raises(RunError, match=r"lift.yaml:\d+:35: scene 'too_far': .* the nearest has tip.x = 400 in place of 450 mm; write"):
        start_of("too_far")
    with pytest.raises(RunError, match=r"hinge.angle = \S+ in place of 30 deg; values wanted: 2, 1 can be chosen there"):
        start_of("both")
    with pytest.raises(RunError, match=r"'held'.*values wanted: [12], 0 can be chosen"):
        start_of("held")


def test_the_nearest_has_the_least_squares() -> None:
    """The sum of both squared distances over the crank's angle, at its least on a fine grid."""
    angles = np.linspace(-pi, pi, 400001)
    leaning = np.arcsin(np.sin(angles) / -3)  # the rod leans against the crank
    least = np.min((leaning - radians(10)) ** 2 + (angles - radians(30)) ** 2)
    found = model()
    with pytest.raises(RunError) as error:
        with_solved_coordinates(found, found.scenes["both"], parameter_values(found, {}))
    numbers = [float(text.split(" in ")[0]) for text in str(error.value).split(" = ")[1:]]
    assert sum(radians(number - wanted) ** 2 for number, wanted in zip(numbers, (10, 30), strict=True)) == pytest.approx(least, rel=1e-4)


def test_runs_with_other_parameters_are_assembled_anew() -> None:
    assert abs(start_of("place", away=0.3)["hinge.angle"]) == pytest.approx(crank_angle(0.3), abs=1e-10)
    assert abs(start_of("place", arm=0.12)["hinge.angle"]) == pytest.approx(crank_angle(0.35, 0.12), abs=1e-10)


def test_each_run_of_a_batch_has_its_own_start() -> None:
    """Without weight and spring nothing moves on from there."""
    found = read_model_text(CRANK.replace("-9.81", "0").replace("law: 100*(length - 0.4)", "law: 0"), "lift.yaml")
    batch = simulate_batch(found, [{"away": 0.3}, {"away": 0.36}], scene="place")
    np.testing.assert_allclose(np.abs(batch.end["hinge.angle"]), [crank_angle(0.3), crank_angle(0.36)], rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", [1, 3, 5, 7])
def test_random_mechanisms_find_a_pose_with_the_places_of_another(seed: int) -> None:
    """Three bodies' places as they are in another pose of closed loops, where the oracle finds them."""
    loops = random_loops(seed)
    equations = formulated(loops)
    dense = DenseMechanism(equations.topology, equations.scene)
    pose = explore(equations)[-1]
    bodies = [body for body in loops.bodies if body.mass][:2]
    wanted = {}
    for body in bodies:
        rotation, shift = dense.poses(pose.q, 0.0)[body.name]
        point = rotation @ dense.vector(body.centre_of_mass) + shift
        wanted.update({(body.name, axis): float(value) for axis, value in zip("xyz", point, strict=True)})
    aims = tuple(
        Aim(name=f"{name}.{axis}", expression=quantity_symbol(name, axis), value=sympy.Float(value), unit="m", size=1.0, span=loops.span)
        for (name, axis), value in wanted.items()
    )
    found = with_solved_coordinates(loops, replace(scene(), assemble=aims), parameter_values(loops, {}))
    q = np.array([float(found.positions[name]) for name in equations.coordinate_names])
    for chart in equations.charts:
        if chart.ball and chart.reversed:
            q[chart.q + chart.scalars + 1 : chart.q + chart.scalars + 4] *= -1
    assert np.abs(dense_closures(equations, q).residual).max(initial=0.0) < 1e-9
    for (name, axis), value in wanted.items():
        rotation, shift = dense.poses(q, 0.0)[name]
        body = next(body for body in bodies if body.name == name)
        assert (rotation @ dense.vector(body.centre_of_mass) + shift)["xyz".index(axis)] == pytest.approx(value, abs=1e-9)


def test_a_guide_is_where_its_input_begins() -> None:
    """The hinge is driven: the angle of the second joint follows."""
    guided = CRANK.replace("at: [0, 0, 0], axis: y}", "at: [0, 0, 0], axis: y, guide: turn}")
    text = guided.partition("scenes:")[0] + "scenes: {place: {end: 0.01, assemble: {tip.x: 0.35}}}"
    found = read_model_text(text, "lift.yaml")
    angle = crank_angle(0.35)
    file = make_run_file(found, found.scenes["place"], {"turn": angle}, task="simulate")
    assert abs(file.positions["pin.angle"]) == pytest.approx(angle + asin(sin_over_three(angle)), abs=1e-9)
    with pytest.raises(RunError, match="0 can be chosen there"):
        make_run_file(found, found.scenes["place"], {"turn": angle / 2}, task="simulate")


def sin_over_three(angle: float) -> float:
    return float(np.sin(angle) / 3)


def test_reduced_models_begin_where_the_full_one_does() -> None:
    for reduced in reduction_sequence(*find_case(model(), "place")):
        assert not reduced.scene.assemble
        run = simulate(compile_scene(reduced.model, reduced.scene))
        assert float(run["tip.x"][0]) == pytest.approx(0.35, abs=1e-9)


@pytest.mark.parametrize(("parameter", "fault"), [("heavy", None), ("arm", "follows from the parameter 'arm'; use cutjoint batch")])
def test_a_study_varies_what_the_start_does_not_follow_from(tmp_path: Path, parameter: str, fault: str | None) -> None:
    (tmp_path / "lift.yaml").write_text(CRANK)
    study = tmp_path / "study.yaml"
    study.write_text(
        f"cutjoint_study: 1\nmodel: lift.yaml\nscenes: [place]\nparameters: {{{parameter}: [0.1, 0.11]}}\ndesign: grid\n"
        "objectives: {first: {end: tip.x}}\n"
    )
    read = read_study(study)
    if fault is None:
        assert build_kernels(read)
    else:
        with pytest.raises(RunError, match=fault):
            build_kernels(read)


def test_a_simulation_that_python_holds_is_assembled_with_its_parameters() -> None:
    """Parameters of the file have the start of the library; a pose is found for others, in a pickled simulation too."""
    text = CRANK.replace("assemble: {tip.x: away}", "assemble: {tip.x: away}, rates: {hinge.angle_rate: 10*heavy}")
    held = load_scene(found := read_model_text(text, "lift.yaml"), found.scenes["place"])
    first, usual = held.reset().snapshot(), held.parameters.array.copy()
    held.parameters["away"], held.parameters["heavy"] = 0.3, 2
    again = pickle.loads(pickle.dumps(held))
    for each in (held, again):
        each.reset()
        assert each.outputs["tip.x"] == pytest.approx(0.3, abs=1e-11)
        assert abs(each.outputs["hinge.angle"]) == pytest.approx(crank_angle(0.3), abs=1e-10)
        assert each.speeds["hinge.angle_rate"] == pytest.approx(20, rel=1e-12)
    held.parameters["away"] = 0.45
    with pytest.raises(RunError, match=r"the nearest has tip.x = 0\.4 in place of 0\.45 m"):
        held.reset()
    held.parameters.array[:] = usual
    assert held.reset().snapshot() == first


@pytest.mark.parametrize(
    ("aims", "said"),
    [
        ("{tip.vx: 0.3}", "assemble: 'tip.vx' is no place; write coordinates of joints"),
        ("{ram.force: 3}", "assemble: 'ram.force' is no place"),
        ("{away: 0.3}", "assemble: 'away' names no place; write joint.coordinate, or an expression of such"),
        ("{tip.x: 3 deg}", "assemble.tip.x needs m, got an angle"),
        ("{wheel.x: 3}", "unknown element 'wheel'"),
    ],
)
def test_what_is_no_place_is_reported(aims: str, said: str) -> None:
    with pytest.raises(ModelError) as error:
        read_model_text(CRANK.replace("{tip.x: away}", aims), "lift.yaml")
    assert said in str(error.value)


def test_an_equilibrium_is_not_assembled() -> None:
    with pytest.raises(ModelError, match="assemble: an equilibrium is where forces balance; remove 'assemble', or hold 'positions'"):
        read_model_text(CRANK.replace("assemble: {tip.x: away}", "pose: equilibrium, assemble: {tip.x: away}"), "lift.yaml")
