"""Mechanisms of random sizes and masses, without numerics in the file: by every method they move as by the most exact one.

They are interpreted, so that nothing is compiled for them.
"""

from __future__ import annotations

import json
import random
from math import cos, pi, sin
from typing import Any

import numpy as np

from cutjoint.analysis.inertia import NoInertiaError
from cutjoint.analysis.mobility import find_mobility
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate

from .drivers import build_interpreters

Node = dict[str, Any]

#: The error of places that runs keep by default, m, and how many times that is taken for an estimate's uncertainty.
GOAL, UNCERTAIN = 1e-4, 3.0

#: The most by which the run that others are compared with may be wrong, m.
EXACT = 1e-6


def make(rng: random.Random) -> str:
    """A model file."""
    build_interpreters()
    model: Node = {
        "cutjoint": 1, "name": "fuzzed", "gravity": [0, 0, -9.81], "points": {}, "bodies": {}, "joints": {}, "forces": {}, "outputs": [],
        "scenes": {"run": {"end": 1, "output_step": 0.02}},
    }  # fmt: skip
    rng.choice((ring, spatial_four_bar, six_bar, platform, tree))(model, rng)
    return json.dumps({name: part for name, part in model.items() if part or name == "outputs"}, indent=1)


def check(text: str) -> tuple[str, ...]:
    """Methods that did not keep their goal, and said so; fails where one says that it did and is far from the most exact run."""
    model = read_model_text(text, "fuzzed.yaml")
    scene = model.scenes["run"]
    try:
        exact = compile_interpreted(model, scene)
    except NoInertiaError as error:
        return tuple(str(error).splitlines())
    truth = simulate(exact, integrator="dormand-prince", tolerance=1e-10, check=False)
    if truth.failure is not None or _estimate(truth) > EXACT:
        return (f"no exact run: {truth.failure.message if truth.failure else 'its error is large'}",)
    problems, refusing = [], []
    for method in METHODS:
        try:
            run = simulate(compile_interpreted(model, scene, method=method), check=False)
        except RunError as error:
            problems.append(str(error))
            refusing.append(method)
            continue
        if run.failure is not None or not run.error.converged:
            problems.append(f"{method}: {run.failure.message if run.failure else 'its steps do not converge'}")
            continue
        apart = max(float(np.abs(run[name] - truth[name]).max()) for name in truth.columns)
        assert apart <= UNCERTAIN * GOAL, f"{method} is {apart:.1e} m off and says {_estimate(run):.1e}"
    redundant = find_mobility(exact.mechanism).redundant
    assert redundant or not refusing, f"{refusing} refuse loops whose equations are independent: {problems}"
    return tuple(problems)


def _estimate(run: Trajectory) -> float:
    return max(run.error.max_error.values())


def _mass(rng: random.Random) -> float:
    return round(10 ** rng.uniform(-1.3, 0.7), 4)


def _vector(rng: random.Random, size: float = 1.0) -> list[float]:
    return [round(rng.uniform(-size, size), 3) for _ in range(3)]


def _rod(start: str, end: str, rng: random.Random, *, round_it: bool) -> Node:
    """A slender rod, which resists no turn about its line, or one with a ball in its middle."""
    mass = _mass(rng)
    ball = [{"sphere": 0.03, "mass": round(mass / 5, 4), "at": {"midpoint": [start, end]}}] if round_it else []
    return {"shapes": [{"rod": {"from": start, "to": end}, "mass": mass}, *ball]}


def _revolute(base: str, follower: str, at: str, axis: Any = (0, 1, 0)) -> Node:
    return {"kind": "revolute", "bodies": [base, follower], "at": at, "axis": list(axis)}


def ring(model: Node, rng: random.Random) -> None:
    """Four to seven links in a plane, the ground one of them."""
    count, base = rng.randint(4, 7), "ground"
    for k in range(count):
        angle, radius = 2 * pi * k / count + rng.uniform(-0.2, 0.2), rng.uniform(0.3, 0.8)
        model["points"][f"P{k}"] = [round(radius * cos(angle), 3), 0, round(radius * sin(angle), 3)]
    for k in range(count - 1):
        model["bodies"][f"link{k}"] = _rod(f"P{k}", f"P{k + 1}", rng, round_it=False)
        model["joints"][f"j{k}"] = _revolute(base, f"link{k}", f"P{k}")
        base = f"link{k}"
    model["joints"][f"j{count - 1}"] = _revolute(base, "ground", f"P{count - 1}")
    model["forces"]["friction"] = {"kind": "joint_force", "joint": "j0", "law": "-0.05*rate"}
    model["outputs"] = ["link0.x", "link0.z", f"{base}.x"]


def spatial_four_bar(model: Node, rng: random.Random) -> None:
    """Crank and rocker with a rod between them: a body between two balls or a ball and a cross, or a distance."""
    model["points"] = {
        "O": [0, 0, 0], "A": [0, 0.02, round(rng.uniform(0.05, 0.15), 3)], "C": [0.55, round(rng.uniform(0.2, 0.4), 3), 0],
        "B": [round(rng.uniform(0.4, 0.6), 3), round(rng.uniform(0.1, 0.3), 3), round(rng.uniform(0.2, 0.3), 3)],
    }  # fmt: skip
    model["bodies"] = {name: _rod(start, end, rng, round_it=True) for name, start, end in (("crank", "O", "A"), ("rocker", "C", "B"))}
    axis = rng.choice(((1, 0, 0), (0, 1, 0), (1, 1, 0)))
    model["joints"] = {"motor": _revolute("ground", "crank", "O"), "pivot": _revolute("ground", "rocker", "C", axis)}
    first = rng.choice(("spherical", "universal", "distance"))
    if first == "distance":
        model["joints"]["rod"] = {"kind": first, "bodies": ["crank", "rocker"], "at": "A", "to": "B"}
    else:
        model["bodies"]["rod"] = _rod("A", "B", rng, round_it=True)
        axes = {"axis": [0, 1, 0], "axis_2": [0, 0, 1]} if first == "universal" else {}
        model["joints"]["a"] = {"kind": first, "bodies": ["crank", "rod"], "at": "A", **axes}
        model["joints"]["b"] = {"kind": "spherical", "bodies": ["rod", "rocker"], "at": "B"}
    model["scenes"]["run"]["rates"] = {"motor.angle_rate": round(rng.uniform(3, 15), 2)}
    model["outputs"] = ["crank.z", "rocker.x", "rocker.z"]


def six_bar(model: Node, rng: random.Random) -> None:
    """Stephenson's third kind with a motor."""
    model["points"] = {
        "A": [0, 0, 0], "B": [0.1, 0, round(rng.uniform(0.1, 0.2), 3)], "C": [round(rng.uniform(0.4, 0.5), 3), 0, 0.35], "D": [0.5, 0, 0],
        "E": [round(rng.uniform(0.25, 0.35), 3), 0, 0.5], "F": [round(rng.uniform(0.7, 0.8), 3), 0, 0.4], "G": [0.9, 0, 0],
    }  # fmt: skip
    rods = (("crank", "A", "B"), ("rocker", "D", "C"), ("link", "E", "F"), ("last", "G", "F"))
    model["bodies"] = {name: _rod(start, end, rng, round_it=False) for name, start, end in rods}
    sides = [{"rod": {"from": start, "to": "C"}, "mass": _mass(rng)} for start in "BE"]
    model["bodies"]["coupler"] = {"shapes": sides}
    pairs = ("ground crank A", "crank coupler B", "coupler rocker C", "rocker ground D", "coupler link E", "link last F", "last ground G")
    model["joints"] = {f"pin_{at}": _revolute(base, follower, at) for base, follower, at in map(str.split, pairs)}
    model["forces"] = {
        "friction": {"kind": "joint_force", "joint": "pin_G", "law": f"-{round(rng.uniform(0, 0.3), 3)}*rate"},
        "motor": {"kind": "joint_force", "joint": "pin_A", "law": f"{round(rng.uniform(0.1, 3), 3)}*sin(3*t)"},
    }  # fmt: skip
    model["outputs"] = ["crank.x", "last.x", "link.z"]


def platform(model: Node, rng: random.Random) -> None:
    """A plate on three legs that each move in a plane, or on six that stand on crosses."""
    legs = rng.choice((3, 6))
    model["points"]["T"] = [0, 0, 0.5]
    model["bodies"]["plate"] = {"mass": 2 * _mass(rng), "centre_of_mass": "T", "inertia": [0.02, 0.02, 0.03]}
    for k in range(legs):
        angle = 2 * pi * k / legs + rng.uniform(-0.2, 0.2)
        above = angle + (0.0 if legs == 3 else 0.5 * (-1) ** k)
        foot = [round(0.5 * cos(angle), 3), round(0.5 * sin(angle), 3), 0]
        head = [round(0.25 * cos(above), 3), round(0.25 * sin(above), 3), 0.5]
        line, across = np.subtract(head, foot), [round(-sin(angle), 4), round(cos(angle), 4), 0]
        model["points"] |= {f"L{k}": foot, f"U{k}": head}
        up = {"from": f"L{k}", "to": f"U{k}"}
        for name, radius, at in ((f"cylinder{k}", 0.02, f"L{k}"), (f"piston{k}", 0.015, f"U{k}")):
            cylinder = {"cylinder": {"radius": radius, "length": 0.2}, "mass": _mass(rng) / 3, "at": at, "axis": up}
            model["bodies"][name] = {"shapes": [cylinder]}
        cross = {"kind": "universal", "axis_2": np.cross(across, line).tolist()} if legs == 6 else {}
        model["joints"] |= {
            f"foot{k}": {**_revolute("ground", f"cylinder{k}", f"L{k}", across), **cross},
            f"stroke{k}": {"kind": "prismatic", "bodies": [f"cylinder{k}", f"piston{k}"], "at": f"L{k}", "axis": up},
            f"head{k}": {"kind": "spherical", "bodies": [f"piston{k}", "plate"], "at": f"U{k}"},
        }  # fmt: skip
        law = f"-3000*(position - 0.03*sin({2 + k}*t)) - 60*rate"
        model["forces"][f"motor{k}"] = {"kind": "joint_force", "joint": f"stroke{k}", "law": law}
    model["outputs"] = ["plate.x", "plate.z", "stroke0.displacement"]


def tree(model: Node, rng: random.Random) -> None:
    """Two to four bodies with joints of all kinds, some on springs."""
    model["points"]["ground_end"] = [0, 0, 0]
    bodies = ["ground"]
    for k, kind in enumerate(rng.choices(tuple(_AXES), k=rng.randint(2, 4))):
        name, base = f"body{k}", rng.choice(bodies)
        start, end = f"{base}_end", f"{name}_end"
        model["points"][end] = {"sum": [start, _vector(rng, 0.5)]}
        model["bodies"][name] = _rod(start, end, rng, round_it=True)
        fields = {field: _vector(rng) if value is None else value for field, value in _AXES[kind].items()}
        model["joints"][f"joint{k}"] = {"kind": kind, "bodies": [base, name], "at": start, **fields}
        if kind in _SLIDING:
            law = {"stiffness": round(10 ** rng.uniform(1, 3.3), 1), "damping": round(rng.uniform(0, 5), 2), "free_length": 0.5}
            spring = {"kind": "point_spring", "bodies": ["ground", name], "from": _vector(rng), "to": end, "law": law}
            model["forces"][f"spring{k}"] = spring
        bodies.append(name)
    model["outputs"] = [f"{name}.{place}" for name in bodies[1:] for place in "xz"]


#: The fields of joints in trees; None for any vector.
_AXES: dict[str, Node] = {
    "revolute": {"axis": None}, "prismatic": {"axis": None}, "cylindrical": {"axis": None}, "planar": {"axis": None},
    "screw": {"axis": None, "pitch": 0.02}, "spherical": {}, "universal": {"axis": [1, 0, 0], "axis_2": [0, 1, 0]},
    "constant_velocity": {"axis": [0, 0, 1]},
}  # fmt: skip
_SLIDING = ("prismatic", "cylindrical", "planar")
