"""Shafts with inertia about their axes and no mass, by the equations of all methods, and beside the dense oracle.

A crank without mass drives a slider; on a body that turns every way a rotor spins across two gears.
"""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.reduce.weld import merged
from cutjoint.topology.build import build_topology
from tests.formulate.test_against_dense import SOFT, assert_agree
from tests.formulate.test_implicit import make_system, verify_tangent
from tests.formulate.test_natural import compare
from tests.mechanisms import random_models
from tests.model.pendulum import problems
from tests.oracles.dense import Instant
from tests.oracles.evaluation import both

SHAFTS = """\
cutjoint: 1
name: shafts
gravity: [0.3, 0, -9.81]
parameters:
  J: {value: 0.02, unit: kg*m^2, binding: param}
bodies:
  crank: {massless: true, inertia: {axial: 0.03, axis: [0, 2, 0]}}
  rod: {mass: 0.8, centre_of_mass: [0.4, 0, 0], inertia: [0.001, 0.02, 0.02]}
  slider: {mass: 0.5, centre_of_mass: [0.7, 0, 0], inertia: [0.001, 0.002, 0.003]}
  carrier: {mass: 3, centre_of_mass: [0, 2, 0.2], inertia: [0.05, 0.06, 0.04, 0.002, 0.001, -0.003]}
  rotor: {mass: 0, centre_of_mass: [0, 0, 0], inertia: {axial: J, axis: [1, 1, 0]}}
  idler: {mass: 0, centre_of_mass: [0, 0, 0], inertia: [0.001, 0.002, 0.004, 0.0005, 0, 0]}
joints:
  journal: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  big_end: {kind: revolute, bodies: [crank, rod], at: [0.1, 0, 0.05], axis: [0, 1, 0]}
  small_end: {kind: spherical, bodies: [rod, slider], at: [0.7, 0, 0], cut: true}
  bore: {kind: prismatic, bodies: [ground, slider], at: [0.7, 0, 0], axis: [1, 0, 0]}
  gimbal: {kind: universal, bodies: [ground, carrier], at: [0, 2, 0], axis: [1, 0, 0], axis_2: [0, 1, 0]}
  bearing: {kind: revolute, bodies: [carrier, rotor], at: [0, 2, 0.3], axis: [1, 1, 0]}
  second: {kind: revolute, bodies: [carrier, idler], at: [0.1, 2, 0.3], axis: [1, 0, 1]}
gears:
  mesh: {joints: [bearing, second], ratio: -3}
forces:
  gas: {kind: joint_force, joint: bore, law: "-200 - 5*rate"}
  drive: {kind: joint_force, joint: bearing, law: "2 - 0.1*rate"}
scenes:
  run: {end: 1}
"""


@pytest.fixture(scope="module")
def shafts() -> Model:
    return read_model_text(SHAFTS, "shafts.yaml")


def test_they_turn_as_the_dense_oracle_says(shafts: Model) -> None:
    blocks, dense = both(build_topology(shafts), shafts.scenes["run"])
    rng = np.random.default_rng(1)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    at, multipliers = Instant(q=q, v=v, t=0.37, motion=1.0), 10 * rng.standard_normal(dense.m)
    assert_agree(blocks.solve(at, multipliers, SOFT), dense.solve(at, multipliers, SOFT), SOFT)


def test_natural_coordinates_agree(shafts: Model) -> None:
    compare(shafts, 2, shafts.scenes["run"])


def test_the_tangent_of_newtons_iteration(shafts: Model) -> None:
    assert verify_tangent(make_system(shafts, shafts.scenes["run"]), 4) > 0


def test_a_shaft_that_is_welded_to_a_body_adds_its_inertia(shafts: Model) -> None:
    bodies = {body.name: body for body in shafts.bodies}
    for one, other in (("carrier", "crank"), ("crank", "carrier")):
        welded = merged(bodies[one], bodies[other])
        assert (welded.name, welded.mass) == (one, 3)
        assert [float(x) for x in welded.centre_of_mass] == pytest.approx([0, 2, 0.2])
        assert [float(x) for x in welded.inertia] == pytest.approx([0.05, 0.09, 0.04, 0.002, 0.001, -0.003], abs=1e-15)
    assert [float(x) for x in merged(bodies["crank"], bodies["idler"]).inertia] == pytest.approx([0.001, 0.032, 0.004, 0.0005, 0, 0])


def test_inertia_about_an_axis_alone_is_of_no_body_with_mass() -> None:
    text = SHAFTS.replace("rotor: {mass: 0,", "rotor: {mass: 1,")
    assert problems(text) == [
        "m.yaml:11:3: body 'rotor': a principal moment of inertia is larger than the sum of the other two: 0, 0, 0.02 kg m2"
    ]
    found = problems(SHAFTS.replace("axial: 0.03", "axial: -0.03"))
    assert found == ["m.yaml:7:3: body 'crank': a principal moment of inertia is negative: -0.03, 0, 0 kg m2"]
