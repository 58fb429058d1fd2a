"""Starts at rest with coordinates that the scene holds: nothing else pulls, and a guide that holds the same makes no difference.

The mechanisms are planar, of links on hinges and a carriage, with springs at joints, some closed to loops.  Their potential is worked
out here.  Most are settled: they rest where they are assembled, for held joints carry what they must and springs are as tight as the others
need, so that a refusal is wrong.
"""

from __future__ import annotations

import json
import random
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.results import MechanismState
from cutjoint.run.simulation import simulate
from cutjoint.tasks.states import NoEquilibriumError, find_scene_equilibrium

from .drivers import build_interpreters

Node = dict[str, Any]
Array = npt.NDArray[Any]

GRAVITY = 9.81
#: The largest force at rest, as a share of the weights and moments that act.
AT_REST = 1e-5


def make(rng: random.Random) -> str:
    """A model file, and what the check needs of it."""
    build_interpreters()
    links: list[Node] = []
    count = rng.randint(2, 5)
    for k in range(count):
        base = rng.choice([-1, *range(k)]) if k and rng.random() < 0.4 else k - 1
        start = links[base]["end"] if base >= 0 else _place(rng, 0.5)
        end = [round(s + x, 3) for s, x in zip(start, _place(rng, 1.0), strict=True)]
        links.append({"base": base, "start": start, "end": end, "mass": round(10 ** rng.uniform(-1, 1), 3), "stiffness": _stiffness(rng)})
    if rng.random() < 0.3:
        links[0] |= {"slides": rng.choice([[1, 0], [0.8, 0.6]]), "base": -1, "stiffness": round(10 ** rng.uniform(1.5, 3), 2)}
    tips = [k for k in range(count) if all(link["base"] != k for link in links)]
    closed = [k for k in tips if k > 2 and rng.random() < 0.7][:1]
    free = count - 2 * len(closed)
    held = {k: round(rng.uniform(-0.5, 0.5), 3) for k in sorted(rng.sample(range(count), rng.randint(1, free)))}
    method, settled = rng.choice(sorted(METHODS)), rng.random() < 0.8
    if settled:
        held = {k: 0.0 if closed else value for k, value in _independent(links, closed, held).items()}
        _tighten(links, held)
    case = {
        "links": links, "closed": closed, "held": list(held.items()), "method": method, "guides": rng.random() < 0.3, "settled": settled,
    }  # fmt: skip
    return json.dumps(case, indent=1)


def _independent(links: list[Node], closed: list[int], held: Mapping[int, float]) -> dict[int, float]:
    """The held coordinates without those that loops and others determine: no mechanics shares a load between them."""
    chosen: dict[int, float] = {}
    for k, value in held.items():
        across = _ways({"links": links, "closed": closed, "held": [(j, 0.0) for j in (*chosen, k)]}, np.zeros(len(links)))
        if np.linalg.matrix_rank(across, rtol=1e-3) == across.shape[1]:
            chosen[k] = value
    return chosen


def _tighten(links: list[Node], held: Mapping[int, float]) -> None:
    """Give the springs of joints that are not held the force or moment that carries the weight, with all others as in the design."""
    at = np.array([held.get(k, 0.0) for k in range(len(links))])
    slope = _gradient(lambda relative: _potential(links, _absolute(links, relative)), at)
    for k, link in enumerate(links):
        link["preload"] = 0.0 if k in held else float(slope[k])


def model_text(case: Node, *, guided: bool) -> str:
    """The model file of a case; ``guided`` joints hold what is held otherwise."""
    model: Node = {
        "cutjoint": 1, "name": "fuzzed", "gravity": [0, 0, -GRAVITY], "points": {}, "bodies": {}, "joints": {}, "forces": {},
        "reactions": {}, "outputs": [], "scenes": {"run": {"end": 0.01, "output_step": 0.01, "pose": "equilibrium", "positions": {}}},
    }  # fmt: skip
    for k, link in enumerate(case["links"]):
        name, base = f"link{k}", "ground" if link["base"] < 0 else f"link{link['base']}"
        model["points"] |= {f"S{k}": _spatial(link["start"]), f"E{k}": _spatial(link["end"])}
        model["bodies"][name] = {"shapes": [{"rod": {"from": f"S{k}", "to": f"E{k}"}, "mass": link["mass"]}]}
        slides = "slides" in link
        axis = _spatial(link["slides"]) if slides else [0, 1, 0]
        model["joints"][f"j{k}"] = {"kind": "prismatic" if slides else "revolute", "bodies": [base, name], "at": f"S{k}", "axis": axis}
        model["outputs"] += [f"{name}.{quantity}" for quantity in ("x", "z", "roll", "pitch", "yaw")]
        if link["stiffness"] or link.get("preload"):
            law = f"{link.get('preload', 0.0)!r} - {link['stiffness']}*position"
            model["forces"][f"spring{k}"] = {"kind": "joint_force", "joint": f"j{k}", "law": law}
            model["outputs"].append(f"spring{k}.force")
        model["reactions"][f"r{k}"] = {"joint": f"j{k}", "body": name, "direction": [1, 0, 0]}
        model["reactions"][f"m{k}"] = {"joint": f"j{k}", "body": name, "direction": [0, 1, 0]}
    for k in case["closed"]:
        model["joints"][f"c{k}"] = {"kind": "revolute", "bodies": [f"link{k}", "ground"], "at": f"E{k}", "axis": [0, 1, 0]}
    for k, value in case["held"]:
        name = "displacement" if "slides" in case["links"][k] else "angle"
        if guided:
            model["joints"][f"j{k}"]["guide"] = value
        else:
            model["scenes"]["run"]["positions"][f"j{k}.{name}"] = value
    return json.dumps({name: part for name, part in model.items() if part or name == "outputs"}, indent=1)


def check(text: str) -> tuple[str, ...]:
    """The reason for no equilibrium; fails where a settled pose is refused, the pose is none, a run starts elsewhere, or reactions are not
    those beside guides.
    """
    case = json.loads(text)
    model = read_model_text(model_text(case, guided=False), "fuzzed.yaml")
    scene = model.scenes["run"]
    try:
        found = find_scene_equilibrium(model, scene)
        run = simulate(compile_interpreted(model, scene, method=case["method"]), check=False, error=False)
    except (NoEquilibriumError, RunError) as error:
        return _refused(case, str(error))
    if run.failure is not None:
        return _refused(case, f"{run.failure.message}; {run.failure.advice}")
    require_rest(case, found)
    if len(run["link0.x"]):
        begun = {name: float(column[0]) for name, column in run.columns.items()}
        apart = max(abs(value - found.values[name]) for name, value in begun.items() if name[-2:] in (".x", ".z"))
        assert apart < 1e-7 or not case.get("settled"), f"{case['method']} starts {apart:.1e} m beside the pose that is at rest"
        if apart >= 1e-7:  # a mechanism may rest in several poses
            require_rest(case, replace(found, values={**found.values, **begun}))
    return _beside_guides(case, found) if case["guides"] else ()


def _refused(case: Node, message: str) -> tuple[str, ...]:
    assert not case.get("settled"), f"a mechanism that rests where it is assembled is refused: {message}"
    return (message,)


def _beside_guides(case: Node, found: MechanismState) -> tuple[str, ...]:
    """Compare with the same mechanism whose joints are guided, where it comes to the same pose."""
    model = read_model_text(model_text(case, guided=True), "fuzzed.yaml")
    try:
        guided = find_scene_equilibrium(model, model.scenes["run"])
    except (NoEquilibriumError, RunError) as error:
        return (str(error),)
    require_rest(case, guided)
    if max(abs(guided.values[name] - found.values[name]) for name in found.values if name[-2:] in (".x", ".z")) > 1e-6:
        return ("the guided mechanism rests in another pose",)
    scale = GRAVITY * sum(link["mass"] for link in case["links"])
    for name, value in found.values.items():
        apart = abs(value - guided.values[name])
        assert apart < 10 * AT_REST * scale or not name.endswith((".force", ".moment")), f"{name} is {apart:.1e} off beside guides"
    return ()


def require_rest(case: Node, found: MechanismState) -> None:
    """Fail where held coordinates have other values, a loop gapes, or the potential falls along what is neither held nor closed."""
    links = case["links"]
    u = np.array([_coordinate(k, link, found) for k, link in enumerate(links)])
    for k, link in enumerate(links):
        if link["stiffness"] and "slides" not in link:  # a spring knows how often its joint has gone round
            stretch = (link.get("preload", 0.0) - found.values[f"spring{k}.force"]) / link["stiffness"]
            turns = (stretch - _relative(links, u, k)) / (2 * np.pi)
            u[k] += 2 * np.pi * np.round(turns)
    for k, value in case["held"]:
        gap = _relative(links, u, k) - value
        gap -= 0 if "slides" in links[k] else 2 * np.pi * np.round(gap / (2 * np.pi))
        assert abs(gap) < 1e-9, f"joint {k} is {gap:.1e} from where it is held"
    gaps, across = np.array(_gaps(case, u)), _ways(case, u)
    assert np.abs(gaps).max(initial=0.0) < 1e-8, f"a loop gapes by {np.abs(gaps).max():.1e} m"
    slope = _gradient(lambda x: _potential(links, x), u)
    rest = slope - across @ np.linalg.lstsq(across, slope, rcond=1e-10)[0]
    scale = GRAVITY * sum(link["mass"] for link in links)
    assert np.abs(rest).max() < AT_REST * scale, f"a force or moment of {np.abs(rest).max():.1e} moves what is not held"


def _coordinate(k: int, link: Node, found: MechanismState) -> float:
    """The displacement of a carriage, or the turn of a link about y, from the place of its middle."""
    middle = (np.array(link["start"]) + link["end"]) / 2
    if "slides" in link:
        return float((np.array([found.values[f"link{k}.x"], found.values[f"link{k}.z"]]) - middle) @ link["slides"])
    roll, pitch, yaw = (found.values[f"link{k}.{name}"] for name in ("roll", "pitch", "yaw"))
    upright = np.cos(yaw) * np.cos(roll)  # of a turn about y alone, roll and yaw are both zero or both pi
    return float(pitch if upright > 0 and abs(yaw) < 1 else np.pi - pitch)


def _turned(vector: Array, angle: Any) -> Array:
    """A vector (x, z) after a turn about y."""
    x, z = vector
    return np.array([x * np.cos(angle) + z * np.sin(angle), -x * np.sin(angle) + z * np.cos(angle)])


def _ends(links: list[Node], u: Array) -> tuple[list[Array], list[Array]]:
    """Start and end of each link."""
    starts: list[Array] = []
    ends: list[Array] = []
    for link, x in zip(links, u, strict=True):
        start = np.array(link["start"]) if link["base"] < 0 else ends[link["base"]]
        along = np.subtract(link["end"], link["start"])
        if "slides" in link:
            start, along = start + x * np.array(link["slides"]), along
        else:
            along = _turned(along, x)
        starts.append(start)
        ends.append(start + along)
    return starts, ends


def _relative(links: list[Node], u: Array, k: int) -> Any:
    """The coordinate of a joint: a link's turn beside its base, of which a carriage has none."""
    base = links[k]["base"]
    return u[k] - (0 if base < 0 or "slides" in links[base] else u[base])


def _absolute(links: list[Node], relative: Array) -> Array:
    """The turns and displacements of links by the coordinates of their joints."""
    u = np.array(relative)
    for k, link in enumerate(links):
        if link["base"] >= 0 and "slides" not in links[link["base"]]:
            u[k] += u[link["base"]]
    return u


def _potential(links: list[Node], u: Array) -> Any:
    starts, ends = _ends(links, u)
    weight = sum(GRAVITY * link["mass"] * (start[1] + end[1]) / 2 for link, start, end in zip(links, starts, ends, strict=True))
    ways = [_relative(links, u, k) for k in range(len(links))]
    return weight + sum((link["stiffness"] * way / 2 - link.get("preload", 0.0)) * way for link, way in zip(links, ways, strict=True))


def _gaps(case: Node, u: Array) -> list[Any]:
    ends = _ends(case["links"], u)[1]
    return [x for k in case["closed"] for x in ends[k] - case["links"][k]["end"]]


def _ways(case: Node, u: Array) -> Array:
    """The derivatives of gaps and held coordinates by all, column by column."""
    gaps = [_gradient(lambda x, n=n: _gaps(case, x)[n], u) for n in range(len(case["closed"]) * 2)]
    held = [_gradient(lambda x, k=k: _relative(case["links"], x, k), u) for k, _ in case["held"]]
    return np.array([*gaps, *held]).reshape(-1, len(u)).T


def _gradient(f: Any, u: Array) -> Array:
    """By a complex step, which rounds nothing away."""
    return np.array([f(u + 1e-30j * unit).imag * 1e30 for unit in np.eye(len(u))])


def _place(rng: random.Random, size: float) -> list[float]:
    return [round(rng.uniform(-size, size), 3) for _ in range(2)]


def _stiffness(rng: random.Random) -> float:
    return round(10 ** rng.uniform(0, 2), 2) if rng.random() < 0.5 else 0.0


def _spatial(point: Any) -> list[float]:
    return [point[0], 0, point[1]]
