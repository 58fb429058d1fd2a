"""The coordinates of a run's rows: those of the method, with a row for each of the table, also where rows are taken back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.run.accuracy import run_accurately
from cutjoint.run.artifact import make_simulator_run
from cutjoint.run.results import Trajectory
from cutjoint.run.settings import Options
from cutjoint.run.simulator_run import start
from cutjoint.topology.reading import read_model_text
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_scene
from tests.physics.test_energy import CART

#: Two links that swing.
SWING = """
cutjoint: 1
name: swing
gravity: [0, 0, -9.81]
bodies:
  upper: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1]}
  lower: {mass: 1, centre_of_mass: [1.5, 0, 0], inertia: [0.01, 0.1, 0.1]}
joints:
  shoulder: {kind: revolute, bodies: [ground, upper], at: [0, 0, 0], axis: [0, 1, 0]}
  elbow: {kind: revolute, bodies: [upper, lower], at: [1, 0, 0], axis: [0, 1, 0]}
outputs: [shoulder.angle, elbow.angle]
scenes: {fall: {end: 0.5, output_step: 0.05, numerics: {dt: 0.005}}}
"""


def simulate(method: str, integrator: str, *, wanted: bool = True) -> Trajectory:
    model = read_model_text(SWING, "swing.yaml")
    artifact = compile_scene(model, model.scenes["fall"], CompileOptions(method=method))
    return start(replace(make_simulator_run(artifact, Options(integrator=integrator)), with_coordinates=wanted))


@needs_cpp
@pytest.mark.parametrize(("method", "integrator"), [
    ("recursive", "trapezoidal"), ("recursive", "dormand-prince"), ("recursive-newton", "trapezoidal"), ("recursive-newton", "radau5"),
])  # fmt: skip
def test_they_are_those_of_the_rows(method: str, integrator: str) -> None:
    run = simulate(method, integrator)
    assert run.coordinates is not None
    assert run.coordinates.shape == (11, 2)
    assert np.array_equal(run.coordinates, np.stack([run["shoulder.angle"], run["elbow.angle"]], axis=1))
    assert np.ptp(run.coordinates, axis=0).min() > 0.1


@needs_cpp
def test_rows_that_are_taken_back_are_taken_back_here_too() -> None:
    model = read_model_text(CART, "cartpole.yaml")
    artifact = compile_scene(model, next(iter(model.scenes.values())))
    plan = make_simulator_run(artifact, Options(integrator="rk4", dt=1e-2))
    run = run_accurately(replace(plan, with_coordinates=True))
    assert run.failure is not None
    assert "the motion runs away" in run.failure.message
    assert run.coordinates is not None
    assert len(run.coordinates) == run.t.size
    slide, turn = run.coordinates.T
    assert run["pole.x"] == pytest.approx(slide + 0.5 * np.sin(turn))


@needs_cpp
def test_there_are_none_that_nobody_wants() -> None:
    assert simulate("recursive", "trapezoidal", wanted=False).coordinates is None
