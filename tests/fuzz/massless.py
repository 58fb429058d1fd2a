"""Massless bodies between joints, in chains, loops and gears: every method moves them as bodies of hardly any mass, or says that no mass
resists them.

They are interpreted, so that nothing is compiled for them.
"""

from __future__ import annotations

import json
import random
from typing import Any

import numpy as np

from cutjoint.analysis.inertia import NoInertiaError
from cutjoint.analysis.mobility import find_mobility
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.physics.test_massless_middles import HARDLY_ANY, JOINTS

from .drivers import build_interpreters

Node = dict[str, Any]

#: The error of places that runs keep by default, m, how many times that is taken for an estimate's uncertainty, and how many times what a
#: run tells no error is, as docs/background/accuracy.md promises.
GOAL, UNCERTAIN, PROMISED = 1e-4, 3.0, 10.0
#: The most by which the run with hardly any mass may be wrong, m.
EXACT = 1e-5


def make(rng: random.Random) -> str:
    """A model file whose middle bodies are massless."""
    build_interpreters()
    model: Node = {
        "cutjoint": 1, "name": "middles", "gravity": [0, 0, -9.81], "points": {"P0": [0, 0, 0], "end": [0.9, 0.3, -0.3]}, "bodies": {},
        "joints": {}, "outputs": ["bob.x", "bob.y", "bob.z"], "scenes": {"run": {"end": 0.4, "output_step": 0.05}},
    }  # fmt: skip
    count, base, at = rng.choice((1, 1, 1, 2)), "ground", "P0"
    kinds = rng.choices(tuple(JOINTS), k=count + 1)
    for k, kind in enumerate(kinds):
        name = "bob" if k == count else f"middle{k}"
        if k and rng.random() < 0.6:
            at = f"P{k}"
            model["points"][at] = [round(0.3 * k * (j == 0) + rng.uniform(-0.2, 0.2), 3) for j in range(3)]
        model["joints"][f"joint{k}"] = {**JOINTS[kind], "bodies": [base, name], "at": at}
        model["bodies"][name], base = {"massless": True}, name
    model["bodies"]["bob"] = {
        "mass": round(10 ** rng.uniform(-1, 1), 3), "centre_of_mass": [round(0.7 + rng.uniform(-0.1, 0.1), 3), 0.2, -0.3],
        "inertia": [0.05, 0.04, 0.03],
    }  # fmt: skip
    {"chain": _leave, "rod": _tie, "ball": _close, "gear": _gear}[rng.choice(("chain", "rod", "rod", "ball", "gear"))](model, rng)
    return json.dumps(model, indent=1)


def _leave(model: Node, rng: random.Random) -> None:
    """An open chain."""


def _tie(model: Node, rng: random.Random) -> None:
    """A rod from the bob, or from the last middle body, to the ground."""
    model["points"]["foot"] = [round(0.9 + rng.uniform(-0.3, 0.3), 3), round(rng.uniform(-0.3, 0.3), 3), -0.8]
    body = rng.choice(("bob", "bob", max(name for name in model["bodies"] if name != "bob")))
    model["joints"]["rod"] = {"kind": "distance", "bodies": ["ground", body], "at": "foot", "to": "end"}


def _close(model: Node, rng: random.Random) -> None:
    """A crank with mass that carries the bob's end."""
    model["points"]["foot"] = [round(0.9 + rng.uniform(-0.2, 0.2), 3), 0.3, -0.7]
    model["bodies"]["crank"] = {"shapes": [{"rod": {"from": "foot", "to": "end"}, "mass": 0.5}]}
    model["joints"]["pivot"] = {**JOINTS[rng.choice(("revolute", "skew"))], "bodies": ["ground", "crank"], "at": "foot"}
    model["joints"]["ball"] = {"kind": "spherical", "bodies": ["crank", "bob"], "at": "end"}


def _gear(model: Node, rng: random.Random) -> None:
    """A gear between two hinges, on one axis or on parallel ones."""
    axis = rng.choice(("revolute", "crossing", "skew"))
    for name in ("joint0", "joint1"):
        joint = model["joints"][name]
        model["joints"][name] = {**JOINTS[axis], "bodies": joint["bodies"], "at": joint["at"]}
    joints = rng.sample(("joint0", "joint1"), 2)
    model["gears"] = {"mesh": {"joints": joints, "ratio": rng.choice((-2.5, -0.4, 0.5, 3))}}


def check(text: str) -> tuple[str, ...]:
    """Motions that no mass resists; fails where a method ends without naming one, or is far from a mechanism of hardly any mass."""
    model = read_model_text(text, "middles.yaml")
    scene = model.scenes["run"]
    try:
        exact = compile_interpreted(model, scene)
    except NoInertiaError as error:
        return tuple(str(error).splitlines())
    redundant = bool(find_mobility(exact.mechanism).redundant)
    said, runs = {}, {}
    for method in METHODS:
        said[method], runs[method] = _try(model, method, redundant=redundant)
    # both stop in poses that do not determine the motion
    if not said["classical"] and not said["recursive"] and (limit := _limit(text)) is not None:
        stopped = {method: reason for method, reason in said.items() if reason}
        assert not stopped, f"classical and recursive move the mechanism, others do not: {stopped}"
        for method, run in runs.items():
            _compare(method, run, limit)
    return tuple(reason for reason in said.values() if reason)


def _try(model: Model, method: str, *, redundant: bool) -> tuple[str, Trajectory | None]:
    """The reason why a method does not move a model to the end, or "", and its run."""
    try:
        run = simulate(compile_interpreted(model, model.scenes["run"], method=method), check=False)
    except RunError as error:
        said = str(error)
        if not redundant and "mass" not in said:
            raise AssertionError(f"{method} refuses loops whose equations are independent: {said}") from error
        return said, None
    if run.failure is not None:
        said = f"{method}: {run.failure.message}: {run.failure.advice}"
        assert "mass" in said or "depend" in said, f"neither a motion without mass is named nor equations that depend on each other: {said}"
        return said, None
    return "", run


def _compare(method: str, run: Trajectory | None, limit: Trajectory) -> None:
    """Fail where a run that has converged is farther from the limit than it says."""
    if run is not None and run.error.converged:
        apart = max(float(np.abs(run[name] - limit[name]).max()) for name in limit.columns)
        expected = max(run.error.max_error.values())
        assert apart <= max(UNCERTAIN * GOAL, PROMISED * expected), f"{method} is {apart:.1e} m off and says {expected:.1e}"


def _limit(text: str) -> Trajectory | None:
    """The run with hardly any mass; None where that is not exact either."""
    node = json.loads(text)
    for name, body in node["bodies"].items():
        if body.get("massless"):
            at = next(joint["at"] for joint in node["joints"].values() if joint["bodies"][1] == name)
            node["bodies"][name] = {"mass": HARDLY_ANY, "centre_of_mass": at, "inertia": [HARDLY_ANY / 100] * 3}
    model = read_model_text(json.dumps(node), "light.yaml")
    run = simulate(compile_interpreted(model, model.scenes["run"]), integrator="dormand-prince", tolerance=1e-9, check=False)
    return run if run.failure is None and max(run.error.max_error.values()) <= EXACT else None
