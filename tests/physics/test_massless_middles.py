"""Massless bodies between two joints: they move as bodies of hardly any mass, by every method, and runs say where no mass resists them."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest

from cutjoint.analysis.closing import explore
from cutjoint.analysis.inertia import describe_momentary, find_momentary_motions
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.topology.build import build_topology
from tests.conftest import needs_cpp

Node = dict[str, Any]

#: The error of places that runs keep by default, m, and a mass that changes less, kg.
GOAL, HARDLY_ANY = 1e-4, 1e-7

JOINTS: dict[str, Node] = {
    "revolute": {"kind": "revolute", "axis": [0, 1, 0]},
    "crossing": {"kind": "revolute", "axis": [1, 0, 0]},
    "skew": {"kind": "revolute", "axis": [1, 2, 0.5]},
    "universal": {"kind": "universal", "axis": [0, 1, 0], "axis_2": [0, 0, 1]},
    "spherical": {"kind": "spherical"},
    "prismatic": {"kind": "prismatic", "axis": [1, 0, 0.2]},
}

#: Pairs with a body between that masses and equations determine; those at "A" have both joints at one point.
PAIRS = (
    "revolute revolute B", "revolute crossing A", "revolute crossing B", "crossing skew A", "revolute universal B", "crossing universal A",
    "universal crossing A", "universal skew B", "universal universal B", "revolute spherical B", "spherical crossing B",
    "universal spherical B", "revolute prismatic A", "prismatic crossing B", "prismatic universal A", "spherical prismatic B",
)  # fmt: skip

#: Pairs at one point whose middle body no mass resists in the design position: three turns about two directions.
IN_LINE: dict[str, tuple[Node, Node]] = {
    "constant velocity": (JOINTS["crossing"], {"kind": "constant_velocity", "axis": [0, 1, 0]}),
    "universal": (JOINTS["crossing"], {"kind": "universal", "axis": [0, 0, 1], "axis_2": [1, 0, 0]}),
}


def model_text(inner: Node, outer: Node, at: str, middle: Node) -> str:
    """A body on a middle one on the ground."""
    return json.dumps({
        "cutjoint": 1, "name": "middles", "gravity": [0, 0, -9.81], "points": {"A": [0, 0, 0], "B": [0.3, 0.1, -0.05]},
        "bodies": {"middle": middle, "bob": {"mass": 2, "centre_of_mass": [0.7, 0.2, -0.3], "inertia": [0.05, 0.04, 0.03, 0.004, 0, 0]}},
        "joints": {
            "inner": {**inner, "bodies": ["ground", "middle"], "at": "A"}, "outer": {**outer, "bodies": ["middle", "bob"], "at": at},
        },
        "outputs": ["bob.x", "bob.y", "bob.z"], "scenes": {"run": {"end": 0.4, "output_step": 0.05}},
    })  # fmt: skip


def in_line_text(pair: str) -> str:
    """A pair that no mass resists, whose singular tangent has a pivot below zero by rounding."""
    model = json.loads(model_text(*IN_LINE[pair], "A", {"massless": True}))
    model["bodies"]["bob"] = {"mass": 0.32, "centre_of_mass": [0.39, 0.22, -0.18], "inertia": [0.02, 0.03, 0.025]}
    model["joints"]["inner"]["bodies"].reverse()
    return json.dumps(model)


def run(text: str, method: str, **settings: Any) -> Trajectory:
    """An interpreted run."""
    model = read_model_text(text, "middles.yaml")
    return simulate(compile_interpreted(model, model.scenes["run"], method=method), check=False, **settings)


@needs_cpp
@pytest.mark.parametrize("pair", PAIRS)
def test_every_method_moves_a_massless_body_as_one_of_hardly_any_mass(pair: str) -> None:
    inner, outer, at = pair.split()
    light = {"mass": HARDLY_ANY, "centre_of_mass": "A", "inertia": [HARDLY_ANY / 100] * 3}
    limit = run(model_text(JOINTS[inner], JOINTS[outer], at, light), "recursive", integrator="dormand-prince", tolerance=1e-9)
    assert limit.failure is None
    for method in METHODS:
        moved = run(model_text(JOINTS[inner], JOINTS[outer], at, {"massless": True}), method)
        assert moved.failure is None, f"{method}: {moved.failure}"
        apart = max(float(np.abs(moved[name] - limit[name]).max()) for name in limit.columns)
        assert apart <= GOAL, f"{method} is {apart:.1e} m off"


@needs_cpp
@pytest.mark.parametrize("pair", IN_LINE)
def test_augmented_says_that_no_mass_resists_a_massless_body(pair: str) -> None:
    """A negative stiffness has no part in it: nothing in these models has one."""
    failure = run(in_line_text(pair), "augmented").failure
    assert failure is not None
    assert "negative stiffness" not in failure.advice
    assert "massless" in failure.advice


@pytest.mark.parametrize("pair", IN_LINE)
def test_check_names_the_body_before_a_run(pair: str) -> None:
    model = read_model_text(in_line_text(pair), "middles.yaml")
    equations = formulate_recursive(build_topology(model), model.scenes["run"], ())
    (motion,) = find_momentary_motions(equations, explore(equations))
    assert "body 'middle': in the design position no mass resists its motion" in describe_momentary(model, motion)


def test_classical_sends_nobody_to_methods_that_no_mass_stops_too() -> None:
    """A ball, a slide and a hinge at one point: two massless bodies, which slide and turn without the bob."""
    model = json.loads(model_text(JOINTS["spherical"], JOINTS["crossing"], "A", {"massless": True}))
    model["bodies"]["slider"] = {"massless": True}
    model["joints"]["slide"] = {**JOINTS["prismatic"], "bodies": ["middle", "slider"], "at": "A"}
    model["joints"]["outer"]["bodies"] = ["slider", "bob"]
    with pytest.raises(RunError) as caught:
        run(json.dumps(model), "classical")
    assert "use --method" not in str(caught.value)
    assert re.search("body '(middle|slider)': in the design position no mass resists its motion", str(caught.value))
