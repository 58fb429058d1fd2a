"""Two shafts in bearings, coupled by a joint: a constant-velocity joint hands on the angle at any bend, a Hooke joint does not."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from cutjoint.model.read import read_model_text
from cutjoint.topology.build import build_topology
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import both

NUMERICS = Numerics(penalty=1e4, damping_ratio=1.0, frequency=10.0)
AXES = [0.0, 0.0, 1.0], [0.0, float(np.sin(0.6)), float(np.cos(0.6))]


def shafts(coupling: dict[str, Any]) -> str:
    """Two shafts with a bend of 0.6 rad between their bearings' axes."""
    inertia = {"mass": 1, "centre_of_mass": [0, 0, 0], "inertia": [0.5, 0.6, 0.7]}
    joints = {
        name: {"kind": "revolute", "bodies": ["ground", name], "at": [0, 0, 0], "axis": axis, "cut": False}
        for name, axis in zip(("inner", "outer"), AXES, strict=True)
    }
    for name in list(joints):
        joints[f"{name}_bearing"] = joints.pop(name)
    joints["coupling"] = {"bodies": ["inner", "outer"], "at": [0, 0, 0], "cut": True, **coupling}
    return json.dumps({
        "cutjoint": 1, "name": "drive", "gravity": [0, 0, -9.81], "bodies": {"inner": inertia, "outer": inertia}, "joints": joints,
        "scenes": {"run": {"end": 1}},
    })  # fmt: skip


def residual(coupling: dict[str, Any], inner: float, outer: float) -> float:
    """The largest of the coupling's equations when the shafts have turned by these angles."""
    model = read_model_text(shafts(coupling), "drive.yaml")
    blocks, dense = both(build_topology(model), model.scenes["run"])
    q = np.zeros(dense.nq)
    for name, angle in (("inner_bearing", inner), ("outer_bearing", outer)):
        q[dense.layout[name].q_slice] = angle
    found = blocks.solve(Instant(q=q, v=np.zeros(dense.nv)), np.zeros(dense.m), NUMERICS)
    return float(np.abs(found.residual).max())


CONSTANT = {"kind": "constant_velocity", "axis": AXES[0], "axis_2": AXES[1]}
HOOKE = {"kind": "universal", "axis": [1, 0, 0], "axis_2": [0, float(np.cos(0.6)), -float(np.sin(0.6))]}


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.9, -2.0])
def test_both_shafts_turn_by_one_angle(angle: float) -> None:
    assert residual(CONSTANT, angle, angle) < 1e-15
    assert residual(CONSTANT, angle, angle + 0.1) > 0.05


def test_a_hooke_joint_does_not() -> None:
    """The tangents of its angles are to each other as one to the cosine of the bend."""
    assert residual(HOOKE, 0.8, 0.8) > 0.05
    assert residual(HOOKE, 0.8, float(np.arctan(np.tan(0.8) * np.cos(0.6)))) < 1e-15
