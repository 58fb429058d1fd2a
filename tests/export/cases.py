"""Cases that several peers are tried at: random closed loops, a spring that winds up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import sympy

from cutjoint.model.read import read_model_text
from cutjoint.model.records import SPEEDS, JointKind
from cutjoint.run.scenes import find_scene, with_settings
from cutjoint.topology.build import build_topology
from tests.export.own import Case
from tests.mechanisms.gears import TEXT as GEARED
from tests.mechanisms.random_models import TIME, loop_with, scene


def turning_loop(kind: JointKind, closing: str, seed: int) -> Case:
    """A loop of ``loop_with``: its first joint moves with all its speeds, its second has the first speed given.

    A penalty of 1e9 would lose cutjoint five digits on these bodies of about 2 kg; one of 1e5 leaves nine.
    """
    model = loop_with(kind, closing, seed)
    first, second, *_ = (t.joint for t in build_topology(model).tree if t.joint.guide is None)
    names = [f"{first.name}.{q}" for q in SPEEDS[first.kind]] + [f"{second.name}.{q}" for q in SPEEDS[second.kind][:1]]
    values = np.random.default_rng(seed).uniform(-1, 1, len(names))
    rates = {name: sympy.Float(value) for name, value in zip(names, values, strict=True)}
    plain = scene({"drive": sympy.Float(0.2) + sympy.sin(TIME)})
    return Case(model=model, scene=with_settings(replace(plain, rates=rates), "recursive", {"penalty": 1e5}), parameters={})


def geared() -> Case:
    """Racks, trains and a differential; a penalty of 1e6, since wheels are light."""
    model = read_model_text(GEARED, "gears.yaml")
    return Case(model=model, scene=with_settings(model.scenes["run"], "recursive", {"penalty": 1e6}), parameters={})


ROTOR = """
cutjoint: 1
name: rotor
gravity: [0, 0, -9.81]
bodies: {rotor: {mass: 1, centre_of_mass: [0.1, 0, 0], inertia: [0.01, 0.01, 0.01]}}
joints: {pin: {kind: revolute, bodies: [rotor, ground], at: [0, 0, 0], axis: [0, 1, 0]}}
forces: {spring: {kind: joint_force, joint: pin, law: "-0.02*position - 0.001*rate"}}
outputs: [rotor.x, rotor.z]
scenes: {turn: {end: 1, rates: {pin.angle_rate: 30}, positions: {pin.angle: 0.5}, numerics: {solver_tolerance: 1.0e-9}}}
"""


def rotor() -> Case:
    """A wheel out of balance that winds up a spring by four turns."""
    model = read_model_text(ROTOR, "rotor.yaml")
    return Case(model=model, scene=find_scene(model, None), parameters={})
