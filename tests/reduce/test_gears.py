"""Passes on models with gears: what they take, why they stop, and that the motion stays."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.reduce.reach import drop_unreached
from cutjoint.reduce.sequence import ReducedModel, reduction_sequence
from cutjoint.reduce.weld import weld_bodies
from cutjoint.run.artifact import Artifact
from cutjoint.run.simulation import simulate
from cutjoint_bench.generic.artifact import compile_generic
from tests.conftest import needs_cpp, with_heavy

#: A pinion drives a rack with a plate on it and a rocker, whose end a massless rod holds to the rack; the pinion drives a flywheel, which
#: nobody asks about, as nobody does about the pendulum.
TEXT = """\
cutjoint: 1
name: geared
gravity: [0.5, 0, -9.81]
bodies:
  wheel: {mass: 2, centre_of_mass: [0.05, 0, 0], inertia: [0.03, 0.05, 0.03]}
  bar: {mass: 3, centre_of_mass: [0, 0, 0.1], inertia: [0.05, 0.06, 0.03]}
  plate: {mass: 1, centre_of_mass: [0.2, 0.1, 0.2], inertia: [0.02, 0.03, 0.02]}
  rocker: {mass: 1, centre_of_mass: [1, 0, 0.3], inertia: [0.1, 0.1, 0.02]}
  rod: {massless: true}
  flywheel: {mass: 1, centre_of_mass: [0, 3, 0], inertia: [0.05, 0.1, 0.05]}
  pendulum: {mass: 1, centre_of_mass: [0, 5, -1], inertia: [0.1, 0.1, 0.1]}
  still: {mass: 1, centre_of_mass: [0, 6, -1], inertia: [0.1, 0.1, 0.1]}
joints:
  pinion: {kind: revolute, bodies: [ground, wheel], at: [0, 0, 0], axis: [0, 1, 0]}
  rack: {kind: prismatic, bodies: [ground, bar], at: [0, 0, 0.1], axis: [1, 0, 0]}
  weld: {kind: fixed, bodies: [bar, plate], at: [0.2, 0, 0.1]}
  rocker_pin: {kind: revolute, bodies: [ground, rocker], at: [1, 0, 0], axis: [0, 1, 0]}
  rod_start: {kind: spherical, bodies: [plate, rod], at: [0.3, 0, 0.3], cut: true}
  rod_end: {kind: universal, bodies: [rocker, rod], at: [1, 0, 0.5], axis: [0, 1, 0], axis_2: [0, 0, 1]}
  fly_pin: {kind: revolute, bodies: [ground, flywheel], at: [0, 3, 0], axis: [0, 1, 0]}
  swing: {kind: revolute, bodies: [ground, pendulum], at: [0, 5, 0], axis: [0, 1, 0]}
  stop: {kind: revolute, bodies: [ground, still], at: [0, 6, 0], axis: [0, 1, 0], guide: 0}
gears:
  mesh: {joints: [rack, pinion], ratio: 0.1 m/rad}
  train: {joints: [fly_pin, pinion], ratio: -2}
  lock: {joints: [swing, stop], ratio: 1}
outputs: [pinion.angle, rack.displacement, rocker.x, rocker.z, mesh.force]
scenes:
  run:
    {end: 0.4, output_step: 0.05, rates: {rack.displacement_rate: 0.5}, numerics: {closure: penalty, dt: 1 ms, solver_tolerance: 1.0e-10}}
"""


def model() -> Model:
    return read_model_text(TEXT, "geared.yaml")


@cache
def sequence() -> tuple[ReducedModel, ...]:
    full = model()
    return tuple(reduction_sequence(full, full.scenes["run"], approximate=True))


def test_passes_that_know_gears() -> None:
    *_, last = sequence()
    done = [note.element for note in last.done]
    assert done == ["pendulum", "weld", "stop", "rod"]
    assert [gear.name for gear in last.model.gears] == ["mesh", "train"]
    words = "rules out the passes planar, frozen, which know no gears"
    assert [(note.element, note.text) for note in last.left[:3]] == [(name, words) for name in ("mesh", "train", "lock")]


@needs_cpp
@pytest.mark.parametrize("made", with_heavy([compile_interpreted, compile_generic], compile_generic))
def test_motion_stays(made: Callable[..., Artifact]) -> None:
    """By a method that holds all equations at the end of every step; its steps end within a tolerance of 1e-10."""
    runs = [
        simulate(made(variant.model, variant.scene, method="classical"))
        for variant in (sequence()[0], sequence()[-1])
    ]
    assert all(run.failure is None for run in runs)
    full, reduced = runs
    assert abs(full["rocker.x"][-1] - full["rocker.x"][0]) > 0.01
    for name, values in full.columns.items():
        assert reduced[name] == pytest.approx(values, abs=1e-8), name


def test_what_an_output_of_a_gear_feels_stays() -> None:
    full = read_model_text(TEXT.replace("[pinion.angle, rack.displacement, rocker.x, rocker.z, mesh.force]", "[lock.force]"), "geared.yaml")
    outcome = drop_unreached(full, full.scenes["run"])
    assert [body.name for body in outcome.model.bodies] == ["pendulum", "still"]
    assert [gear.name for gear in outcome.model.gears] == ["lock"]


def test_a_joint_at_rest_that_a_gear_couples_stays() -> None:
    full = model()
    outcome = weld_bodies(full, full.scenes["run"])
    assert [(note.element, note.text) for note in outcome.left] == [("stop", "stays: the gear 'lock' couples it")]


def test_a_link_whose_joint_a_gear_couples_stays() -> None:
    text = TEXT.replace("joints: [fly_pin, pinion]", "joints: [fly_pin, rod_end.angle_1]")
    full = read_model_text(text, "geared.yaml")
    *_, last = reduction_sequence(full, full.scenes["run"])
    assert "stays: the gear 'train' couples its joint 'rod_end'" in [note.text for note in last.left if note.element == "rod"]
