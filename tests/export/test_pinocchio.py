"""Tests of Pinocchio alone; `test_peers.py` has the tests of all peers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import JointKind
from cutjoint.run.scenes import find_scene
from cutjoint_bench.export.mechanism import build_mechanism
from cutjoint_bench.export.peers import PEERS
from cutjoint_bench.export.pinocchio_tree import build_tree
from cutjoint_bench.peers.run import run_peer
from tests.export.cases import turning_loop
from tests.export.own import Case, case_of, exported, needs, vehicle


@pytest.mark.heavy
@needs("pinocchio")
def test_runge_kutta_is_of_fourth_order(tmp_path: Path) -> None:
    """Against its own run with a small step: a universal joint and a loop."""
    folder = exported("pinocchio", case_of("slider_crank"), tmp_path)
    runs = [run_peer(PEERS["pinocchio"], folder, dt=dt, end=1.0, integrator="rk4", output_step=0.1) for dt in (1e-2, 5e-3, 5e-4)]
    coarse, fine = (np.abs(run["slider.x"] - runs[2]["slider.x"]).max() for run in runs[:2])
    assert 12 < coarse / fine < 20


@pytest.mark.heavy
@needs("pinocchio")
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


def test_the_differences_are_reported(tmp_path: Path) -> None:
    case = turning_loop(JointKind.UNIVERSAL, "ground", 3)
    differences = PEERS["pinocchio"].export(case.model, case.scene, {}, ()).differences
    assert differences[0].startswith("Loops are closed on accelerations")
    assert differences[1] == "Body 'body_2' is in equal parts for cut joint 'cut_3': one moves on the joint and is welded to the other."
