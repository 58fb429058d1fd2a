"""The image of a mechanism moves as the mirror shows it: joints of every kind with springs, stops, bushings and guides."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cutjoint.elements.force import Mirror
from cutjoint.model.elements.mirror import coordinate_signs
from cutjoint.model.read import read_model_text
from cutjoint.model.records import COORDINATES, Output
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.joint_examples import EXAMPLES
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import both

NUMERICS = Numerics(penalty=1e4, damping_ratio=1.0, frequency=10.0)
GUIDABLE = tuple(map(str, random_models.GUIDABLE))


def document(kind: str, axis: str, is_guided: bool) -> str:
    """An arm on a joint of one kind that carries a hand, and the image of both."""
    names = COORDINATES[kind]
    joint = {"kind": kind, "bodies": ["ground", "arm"], "at": [0.1, 0.3, 0.2], "cut": False, **EXAMPLES[kind]}
    if is_guided:
        laws = ["0.2 + 0.3*sin(t)", "0.5*t**2", "t - 0.1", "0.1*cos(t)"][: len(names)]
        joint["guide"] = laws if len(laws) > 1 else laws[0]
    elif names:
        joint["spring"] = {"stiffness": 9, "damping": 1, "free_position": 0.3, "coordinate": names[0]}
        joint["limits"] = {"lower": -0.01, "upper": 0.02, "stiffness": 50, "coordinate": names[-1]}
    spring = {"stiffness": 5, "damping": 1, "free_rotation": [0.2, -0.3, 0.4]}
    hand = {"kind": "spherical", "bodies": ["arm", "hand"], "at": [0.3, 0.5, 0.1], "spring": spring}
    forces = {
        "mount": {"kind": "bushing", "bodies": ["arm", "hand"], "at": [0.3, 0.5, 0.1], "x": [1, 2, 2], "z": [2, 1, -2],
                  "laws": ["3 - position", "1 - 2*position**2", "2 - rate", "1 - position", "-3*position**2", "2 + rate"]},
        "twist": {"kind": "load", "body": "hand", "torque": ["1 - wx*wy", "2 - wy", "3 + wz**2"], "axes": "body"},
    }  # fmt: skip
    bodies = {
        name: {"mass": m, "centre_of_mass": [0.2, y, 0.3], "inertia": [0.5, 0.6, 0.7, 0.01, 0.02, -0.03]}
        for name, m, y in (("arm", 2, 0.4), ("hand", 1, 0.6))
    }
    side = {"bodies": bodies, "joints": {"arm_joint": joint, "wrist": hand}, "forces": forces}
    gravity = [0 if name == axis else g for name, g in zip("xyz", (1, 2, -9.81), strict=True)]
    return json.dumps({
        "cutjoint": 1, "name": "pair", "gravity": gravity, "submodels": {"side": side},
        "instances": {"left": {"use": "side"}, "right": {"use": "side", "mirror": axis}}, "scenes": {"run": {"end": 1}},
    })  # fmt: skip


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize(("kind", "is_guided"), [*((kind, False) for kind in EXAMPLES), *((kind, True) for kind in GUIDABLE)])
def test_the_image_moves_as_the_mirror_shows(kind: str, is_guided: bool, axis: str) -> None:
    model = read_model_text(document(kind, axis, is_guided), "pair.yaml")
    topology = build_topology(model)
    quantities = [f"{q}{x}" for q in ("", "v", "a") for x in "xyz"]
    outputs = tuple(Output(element=f"{s}.hand", quantity=q, span=model.span) for s in ("left", "right") for q in quantities)
    blocks, dense = both(topology, model.scenes["run"], outputs=outputs)
    rng = np.random.default_rng(3)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    signs = np.array([-1 if name == axis else 1 for name in "xyz"])
    for name in ("arm_joint", "wrist"):
        joint = next(j for j in model.joints if j.name == f"left.{name}")
        if joint.name not in dense.layout:
            continue
        one, other = dense.layout[joint.name], dense.layout[f"right.{name}"]
        own = list(coordinate_signs(Mirror(tuple(signs.tolist())), joint).values())
        q[other.q_slice] = q[one.q_slice] * np.array(own + ([1, *-signs] if one.ball else []))
        v[other.v_slice] = v[one.v_slice] * np.array(own + ([*-signs] if one.ball else []))
    at = Instant(q=q, v=v, t=0.4)
    solution = blocks.solve(at, np.zeros(0), NUMERICS)
    found = np.array(list(blocks.report(at, solution.vdot, np.zeros(0), NUMERICS).values())).reshape(2, 3, 3)
    np.testing.assert_allclose(found[1], found[0] * signs, rtol=1e-10, atol=1e-9)
