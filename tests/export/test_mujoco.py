"""MuJoCo as a peer: it runs what is exported, and agrees with cutjoint's recursive method.

Trees have hard joints in MuJoCo, so that accelerations agree to rounding.  Loops are closed by soft constraints, of which 1e-4 of the
unconstrained acceleration remains, times the constraints' condition: accelerations agree to a percent of the largest.  Gaps close within
a step, so that trajectories agree to what the square of the step leaves.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cutjoint.export.peers import PEERS
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint_bench.peers.run import run_peer
from tests.conftest import MODELS
from tests.export.own import Case, both_accelerations, case_of, exported, largest_differences, moving, vehicle, wheel
from tests.mechanisms.random_models import random_tree

pytest.importorskip("mujoco")

#: The largest relative difference of accelerations: of trees rounding, or the inertia 1e-9 m2 that the pendulum's mass point is given.
ACCELERATIONS = {"pendulum": 2e-9, "flyball": 1e-13, "four_bar": 0.01, "andrews": 0.01, "slider_crank": 0.01}

#: Steps of both (s), the end (s), and the largest differences of places (m) and velocities (m/s).  The trapezoidal rule's error is the
#: larger part for pendulum and four-bar; with soft loops the square of MuJoCo's step for the others.
RUNS = {
    "pendulum": (1e-3, 1e-4, 2.0, 1e-7, 5e-7),
    "flyball": (1e-4, 1e-5, 0.2, 5e-10, 5e-9),
    "four_bar": (1e-3, 1e-4, 0.5, 3e-8, 2e-7),
    "andrews": (5e-6, 1e-6, 0.02, 1e-8, 0.0),
    "slider_crank": (5e-4, 5e-5, 1.0, 5e-6, 1e-3),
}


@pytest.mark.parametrize("name", ACCELERATIONS)
def test_accelerations_at_the_start(name: str, tmp_path: Path) -> None:
    found, own = both_accelerations("mujoco", case_of(name), tmp_path)
    assert np.abs(found - own).max() < ACCELERATIONS[name] * np.abs(own).max()


@pytest.mark.parametrize("name", RUNS)
def test_short_trajectories(name: str, tmp_path: Path) -> None:
    dt, own_dt, end, place, velocity = RUNS[name]
    differences = largest_differences("mujoco", case_of(name), tmp_path, dt=dt, own_dt=own_dt, end=end, integrator="rk4")
    for column, difference in differences.items():
        assert difference < (velocity if ".v" in column else place), column


#: Seeds of trees, and the largest relative difference: rounding; with guides the millionth that their armature lets through; with screws
#: the softness of the constraint between advance and angle.
TREES = {5: 1e-13, 8: 1e-13, 14: 1e-12, 0: 2e-6, 3: 2e-6, 6: 2e-6, 11: 1e-3}


@pytest.mark.parametrize("seed", TREES)
def test_random_trees_with_all_forces(seed: int, tmp_path: Path) -> None:
    model = random_tree(seed)
    found, own = both_accelerations("mujoco", Case(model=model, scene=moving(model, seed), parameters={}), tmp_path)
    assert np.abs(found - own).max() < TREES[seed] * np.abs(own).max()


@pytest.mark.parametrize("speed", ["8", "0.05"])
@pytest.mark.parametrize("road", ["point", "disc"])
def test_a_wheel_on_a_road(road: str, speed: str, tmp_path: Path) -> None:
    found, own = both_accelerations("mujoco", wheel(road, speed), tmp_path)
    np.testing.assert_allclose(found, own, rtol=1e-12, atol=1e-10)


def test_the_vehicle_on_a_bump(tmp_path: Path) -> None:
    """The links carry tons: softness leaves a tenth of a millimetre, and half the step a quarter of it."""
    case, how = vehicle("iavsd_inphase_5"), {"own_dt": 2.5e-4, "end": 0.3}
    coarse, fine = (largest_differences("mujoco", case, tmp_path, dt=dt, integrator="rk4", **how)["chassis.z"] for dt in (1e-3, 5e-4))
    assert coarse < 2e-4
    assert 3 < coarse / fine < 6


def test_a_guided_rack_steers(tmp_path: Path) -> None:
    """Softness lets the wheels give way, by the square of the step."""
    case, how = vehicle("iavsd_sine_2mm", rack=0.5), {"own_dt": 2.5e-4, "end": 0.3}
    coarse, fine = (largest_differences("mujoco", case, tmp_path, dt=dt, integrator="rk4", **how)["chassis.y"] for dt in (5e-4, 2.5e-4))
    assert fine < 1e-4
    assert 3 < coarse / fine < 5


def test_a_standing_guide_needs_no_mass(tmp_path: Path) -> None:
    folder = exported("mujoco", vehicle("iavsd_inphase_5"), tmp_path)
    names = [body.get("name") for body in ElementTree.parse(folder / "iltis.xml").iter("body")]
    assert len(names) == 17
    assert "rack" not in names


def test_a_run_that_breaks_down_keeps_its_rows(tmp_path: Path) -> None:
    folder = exported("mujoco", case_of("flyball"), tmp_path)
    run = run_peer(PEERS["mujoco"], folder, dt=1e-3, end=1.0, integrator="rk4", output_step=1e-3)
    assert run.failure is not None
    assert run.failure.message == "the state is no longer finite, or too large"
    assert 0 < run.steps < 1000
    assert run.t.size == run.steps + 1


@pytest.mark.parametrize("integrator", PEERS["mujoco"].integrators)
def test_every_integrator_swings_a_pendulum(integrator: str, tmp_path: Path) -> None:
    """Those of first order err by about ten steps."""
    differences = largest_differences("mujoco", case_of("pendulum"), tmp_path, dt=1e-4, own_dt=1e-3, end=1.0, integrator=integrator)
    assert all(x < 3e-3 for x in differences.values()), differences


def test_a_body_called_world(tmp_path: Path) -> None:
    text = (MODELS / "pendulum.yaml").read_text(encoding="utf-8").replace("bob", "world")
    model = read_model_text(text, "pendulum.yaml")
    found, own = both_accelerations("mujoco", Case(model=model, scene=find_scene(model, None), parameters={}), tmp_path)
    np.testing.assert_allclose(found, own, atol=1e-7)


WELDED = """
cutjoint: 1
name: welded
gravity: [0, 0, -9.81]
bodies:
  left: {mass: 1, centre_of_mass: [0.1, 0, -0.5], inertia: [0.1, 0.1, 0.1]}
  right: {mass: 2, centre_of_mass: [0.9, 0, -0.5], inertia: [0.1, 0.1, 0.1]}
joints:
  first: {kind: spherical, bodies: [ground, left], at: [0, 0, 0]}
  second: {kind: universal, bodies: [ground, right], at: [1, 0, 0], axis: [1, 0, 0], axis_2: [0, 0, 1]}
  weld: {kind: fixed, bodies: [right, left], at: [0.5, 0, -0.5], cut: true}
outputs: [left.x]
scenes: {fall: {end: 1, rates: {second.angle_1_rate: 1}, numerics: {penalty: 1.0e+6}}}
"""


def test_a_loop_closed_by_a_weld(tmp_path: Path) -> None:
    """Soft constraints leave 1e-4 of the unconstrained acceleration, which is that of gravity."""
    model = read_model_text(WELDED, "welded.yaml")
    found, own = both_accelerations("mujoco", Case(model=model, scene=find_scene(model, None), parameters={}), tmp_path)
    assert np.abs(found - own).max() < 0.01


PRESS = """
cutjoint: 1
name: press
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0, 0.1], inertia: [1, 1, 1]}
  slider: {mass: 1, centre_of_mass: [0, 0, 0.2], inertia: [1, 1, 1]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0, 0, 0.2], axis: [1, 0, 0]}
  eye: {kind: point_on_line, bodies: [crank, slider], at: [0, 0, 0.2], axis: [0, 0, 1], cut: true}
outputs: [crank.x]
scenes: {turn: {end: 1}}
"""


def test_a_cut_joint_that_mujoco_does_not_have() -> None:
    model = read_model_text(PRESS, "press.yaml")
    with pytest.raises(ModelError) as refused:
        PEERS["mujoco"].export(model, find_scene(model, None), {}, ())
    assert str(refused.value) == (
        "press.yaml:11:3: joint 'eye': MuJoCo has no equality constraint for a cut joint of kind point_on_line; close the loop with a "
        "joint of kind revolute or spherical: 'cut: true' there"
    )
