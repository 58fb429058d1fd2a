"""Pinocchio as a peer: it runs what is exported, and agrees with cutjoint's recursive method.

Both have the joints of the tree in relative coordinates and close loops on accelerations, Pinocchio by a proximal method without penalty.
What accelerations differ by is rounding, in loops times cutjoint's penalty; what trajectories differ by is the error of cutjoint's
trapezoidal rule, where the steps of Pinocchio's Runge-Kutta rule of fourth order are small enough.  The first test compiles what all models
share, which takes a minute; it is kept.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.export.mechanism import build_mechanism
from cutjoint.export.peers import PEERS
from cutjoint.export.pinocchio_tree import build_tree
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import JointKind
from cutjoint.run.scenes import find_scene
from cutjoint_bench.peers.run import run_peer
from tests.export.cases import rotor, turning_loop
from tests.export.own import Case, both_accelerations, case_of, exported, largest_differences, moving, vehicle, wheel
from tests.mechanisms.random_models import random_tree

pytest.importorskip("pinocchio")


@pytest.mark.parametrize("name", ["pendulum", "four_bar", "andrews", "slider_crank", "flyball"])
def test_accelerations_at_the_start(name: str, tmp_path: Path) -> None:
    found, own = both_accelerations("pinocchio", case_of(name), tmp_path)
    assert np.abs(found - own).max() < 1e-11 * np.abs(own).max()


#: The steps of both (s), the end (s), and the largest difference of a column (SI units).
RUNS = {
    "pendulum": (5e-3, 1e-4, 1.0, 1e-7),
    "four_bar": (5e-3, 1e-4, 0.5, 1e-7),
    "andrews": (4e-5, 1e-6, 0.01, 2e-9),
    "slider_crank": (5e-4, 1e-4, 1.0, 1e-5),
    "flyball": (1e-4, 5e-5, 0.2, 1e-7),
}


@pytest.mark.parametrize("name", RUNS)
def test_short_trajectories(name: str, tmp_path: Path) -> None:
    dt, own_dt, end, largest = RUNS[name]
    differences = largest_differences("pinocchio", case_of(name), tmp_path, dt=dt, own_dt=own_dt, end=end, integrator="rk4")
    assert all(x < largest for x in differences.values()), differences


def test_runge_kutta_is_of_fourth_order(tmp_path: Path) -> None:
    """Against its own run with a small step: a universal joint and a loop."""
    folder = exported("pinocchio", case_of("slider_crank"), tmp_path)
    runs = [run_peer(PEERS["pinocchio"], folder, dt=dt, end=1.0, integrator="rk4", output_step=0.1) for dt in (1e-2, 5e-3, 5e-4)]
    coarse, fine = (np.abs(run["slider.x"] - runs[2]["slider.x"]).max() for run in runs[:2])
    assert 12 < coarse / fine < 20


def test_balls_are_integrated_in_fourth_order(tmp_path: Path) -> None:
    """A free body that tumbles, whose quaternion the stages carry."""
    folder = exported("pinocchio", tumbling(), tmp_path)
    runs = [run_peer(PEERS["pinocchio"], folder, dt=dt, end=1.0, integrator="rk4", output_step=0.1) for dt in (2e-2, 1e-2, 1e-3)]
    coarse, fine = (np.abs(run["tip.x"] - runs[2]["tip.x"]).max() for run in runs[:2])
    assert 12 < coarse / fine < 20


TUMBLING = """
cutjoint: 1
name: tumbling
gravity: [0, 0, 0]
bodies: {brick: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 2, 3]}}
joints: {sky: {kind: free, bodies: [ground, brick], at: [0, 0, 0]}}
markers: {tip: {body: brick, at: [1, 0, 0]}}
outputs: [tip.x]
scenes: {tumble: {end: 1, rates: {sky.wx: 1, sky.wy: 5, sky.wz: 0.5}}}
"""


def tumbling() -> Case:
    model = read_model_text(TUMBLING, "tumbling.yaml")
    return Case(model=model, scene=find_scene(model, None), parameters={})


def test_semi_implicit_euler(tmp_path: Path) -> None:
    """Of first order: half the step, half the difference."""
    euler = "semi_implicit_euler"
    coarse, fine = (
        max(largest_differences("pinocchio", case_of("pendulum"), tmp_path, dt=dt, own_dt=1e-4, end=1.0, integrator=euler).values())
        for dt in (2e-3, 1e-3)
    )
    assert fine < 0.01
    assert 1.8 < coarse / fine < 2.2


#: Trees with all kinds of joints, and the largest relative difference: rounding, or with guides the billionth that armature lets through.
TREES = {5: 1e-13, 8: 1e-13, 9: 1e-12, 11: 1e-13, 0: 1e-9, 3: 1e-9, 6: 1e-9}


@pytest.mark.parametrize("seed", TREES)
def test_random_trees_with_all_forces(seed: int, tmp_path: Path) -> None:
    model = random_tree(seed)
    found, own = both_accelerations("pinocchio", Case(model=model, scene=moving(model, seed), parameters={}), tmp_path)
    assert np.abs(found - own).max() < TREES[seed] * np.abs(own).max()


#: A random loop closed by each kind of cut joint.
LOOPS = {
    JointKind.FIXED: ("branch", 0), JointKind.REVOLUTE: ("branch", 3), JointKind.PRISMATIC: ("ground", 0),
    JointKind.CYLINDRICAL: ("branch", 0), JointKind.SCREW: ("ground", 4), JointKind.UNIVERSAL: ("ground", 3),
    JointKind.PLANAR: ("branch", 4), JointKind.SPHERICAL: ("ground", 0), JointKind.POINT_ON_LINE: ("ground", 1),
    JointKind.DISTANCE: ("branch", 2),
}  # fmt: skip


@pytest.mark.parametrize("kind", LOOPS)
def test_random_loops(kind: JointKind, tmp_path: Path) -> None:
    """Contacts for balls, hinges and welds; bodies in parts, welded together, for the rest."""
    found, own = both_accelerations("pinocchio", turning_loop(kind, *LOOPS[kind]), tmp_path)
    assert np.abs(found - own).max() < 1e-8 * np.abs(own).max()


@pytest.mark.parametrize("speed", ["8", "0.05"])
@pytest.mark.parametrize("road", ["point", "disc"])
def test_a_wheel_on_a_road(road: str, speed: str, tmp_path: Path) -> None:
    found, own = both_accelerations("pinocchio", wheel(road, speed), tmp_path)
    np.testing.assert_allclose(found, own, rtol=1e-12, atol=1e-10)


def test_an_angle_goes_on_beyond_a_turn(tmp_path: Path) -> None:
    differences = largest_differences("pinocchio", rotor(), tmp_path, dt=1e-3, own_dt=1e-4, end=1.0, integrator="rk4")
    assert all(x < 1e-4 for x in differences.values()), differences


def test_the_vehicle_on_a_bump(tmp_path: Path) -> None:
    """To the error of cutjoint's second order at steps of 0.5 ms."""
    differences = largest_differences("pinocchio", vehicle("iavsd_inphase_5"), tmp_path, dt=1e-3, own_dt=5e-4, end=0.3, integrator="rk4")
    assert differences["chassis.x"] < 2e-7
    assert differences["chassis.z"] < 4e-7


def test_a_guided_rack_steers(tmp_path: Path) -> None:
    case = vehicle("iavsd_sine_2mm", rack=0.5)
    differences = largest_differences("pinocchio", case, tmp_path, dt=1e-3, own_dt=5e-4, end=0.3, integrator="rk4")
    assert differences["chassis.y"] < 2e-7


def test_hinges_of_a_planar_loop_are_held_in_one_point() -> None:
    """Three equations each, of which two are independent; a spatial loop needs two points."""
    planar, spatial = case_of("four_bar"), vehicle("iavsd_inphase_5")
    contacts = [
        build_tree(c.model, c.scene, build_mechanism(c.model, c.scene, c.parameters)).contacts for c in (planar, spatial)
    ]
    assert [contact.name for contact in contacts[0]] == ["closure_1", "closure_2"]
    assert [c.name for c in contacts[1] if "front_left" in c.name] == [
        "front_left.leaf_hinge.first", "front_left.leaf_hinge.second", "front_left.tie_rod_ball"
    ]  # fmt: skip


def test_a_run_that_breaks_down_keeps_its_rows(tmp_path: Path) -> None:
    """The fastest eigenvalue is -8075 1/s: the rule of fourth order is stable up to 2.785/8075 s."""
    folder = exported("pinocchio", case_of("flyball"), tmp_path)
    run = run_peer(PEERS["pinocchio"], folder, dt=1e-3, end=1.0, integrator="rk4", output_step=1e-3)
    assert run.failure is not None
    assert run.failure.message == "the accelerations are not finite: the step is too large, or a motion moves no mass"
    assert 0 < run.steps < 1000
    assert run.t.size == run.steps + 1


KITE = """
cutjoint: 1
name: kite
gravity: [0, 0, -9.81]
bodies: {kite: {mass: 1, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}}
joints: {sky: {kind: free, bodies: [ground, kite], at: [0, 0, 0.3]}}
forces: {lift: {kind: joint_force, joint: sky, coordinate: z, law: 9.81}}
"""


def test_what_is_not_exported() -> None:
    model = read_model_text(KITE, "kite.yaml")
    with pytest.raises(ModelError) as refused:
        PEERS["pinocchio"].export(model, find_scene(model, None), {}, ())
    assert str(refused.value) == (
        "kite.yaml:7:10: force 'lift': a force on a coordinate of a joint of kind free is not exported; write a load or a point_spring "
        "instead"
    )


def test_the_differences_are_told(tmp_path: Path) -> None:
    case = turning_loop(JointKind.UNIVERSAL, "ground", 3)
    differences = PEERS["pinocchio"].export(case.model, case.scene, {}, ()).differences
    assert differences[0].startswith("Loops are closed on accelerations")
    assert differences[1] == "Body 'body_2' is in equal parts for cut joint 'cut_3': one moves on the joint and is welded to the other."
