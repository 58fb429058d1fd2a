"""Chains of equal and mirrored parts in a tilted plane: values computed side by side equal those computed one by one."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from cutjoint.compile.derivation import derive
from cutjoint.compile.systems import formulate_system
from cutjoint.formulate.lanes import find_corresponding
from cutjoint.formulate.records import Equations, Function
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.program.blocks import Block
from cutjoint.program.fold import fold
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import reachable_blocks
from cutjoint.program.schedule import schedule
from tests.oracles.scalars import interpret_scalars

Node = dict[str, Any]

#: The largest distance of results, as a share of the largest.
ROUNDING = 1e-7


def make(rng: random.Random) -> str:
    """A model file of bars that equal cranks carry, one on the other, with equal and mirrored pendulums on them."""
    axis, along, up = _plane(rng)
    model: Node = {
        "cutjoint": 1, "name": "fuzzed", "gravity": [0, 0, -9.81], "points": {}, "bodies": {}, "joints": {}, "outputs": [],
        "scenes": {rng.choice(sorted(METHODS)).replace("-", "_"): {"end": 1}},
    }  # fmt: skip
    base, foot = "ground", np.zeros(3)
    for stage in range(rng.choice((1, 1, 2, 3))):
        crank = rng.uniform(-1, 1) * along + rng.uniform(-1, 1) * up
        bar, weight = f"bar{stage}", round(rng.uniform(0.2, 3), 2)
        for k in range(rng.randint(2, 5)):
            at = foot + (k + rng.uniform(0, 0.5)) * along + rng.uniform(-0.1, 0.1) * up
            _link(model, f"crank{stage}_{k}", base, at, at + crank, axis, weight)
            model["joints"][f"top{stage}_{k}"] = _hinge(f"crank{stage}_{k}", bar, at + crank, axis)
        foot = foot + crank
        model["bodies"][bar] = {"mass": 2, "centre_of_mass": (foot + along).tolist(), "inertia": [1, 1, 1]}
        for k in range(rng.choice((0, 2, 2, 3, 4))):
            at, sense = foot + rng.uniform(0, 4) * along, rng.choice((1, 1, -1))
            _link(model, f"hanging{stage}_{k}", bar, at, at + rng.uniform(-1, 1) * along - up, sense * axis, weight)
        base = bar
    return json.dumps(model, indent=1)


def check(text: str) -> tuple[str, ...]:
    """The reason why the model was refused; fails where lanes change a result."""
    model = read_model_text(text, "fuzzed.yaml")
    ((name, scene),) = model.scenes.items()
    equations: Equations = derive(model, scene, ())
    method = name.replace("_", "-")
    if METHODS[method].has_system:
        try:
            equations = formulate_system(derive(model, scene, ()).starting, method, ())[0]
        except RunError as error:
            return (str(error),)
    families = find_corresponding(equations.builder.quantities, equations.topology)
    for function in equations.functions:
        if function.name not in ("report", "energy", "scene_inputs"):
            folded = fold(equations.builder, families, function.results)
            _require_the_same(equations, function, folded)
    return ()


def _require_the_same(equations: Equations, function: Function, folded: Mapping[str, Block]) -> None:
    rng = np.random.default_rng(0)
    program = schedule(equations.builder, [(function.name, folded)], lanes=True)
    symbols = {
        block.data: rng.uniform(0.5, 1.5, block.shape[0]) for block in reachable_blocks(function.results.values()) if block.op == "symbol"
    }
    plain, lanes = (interpret_blocks(r.values(), symbols, {}) for r in (function.results, folded))
    results = program.functions[0].results
    scalars = interpret_scalars(program.graph, [r.scalar for r in results], symbols, {})
    largest = max((float(np.abs(plain[block]).max(initial=0.0)) for block in function.results.values()), default=0.0)
    for target, block in function.results.items():
        alone = plain[block].ravel()
        for found in (lanes[folded[target]].ravel(), np.array([scalars[r.scalar] for r in results if r.target == target])):
            apart = float(np.abs(found - alone).max(initial=0.0))
            assert apart <= ROUNDING * largest, f"{function.name}: lanes change {target} by {apart:.1e}"


def _plane(rng: random.Random) -> Iterator[np.ndarray]:
    """A normal and two directions across it, of no round numbers."""
    axes = np.linalg.qr([[rng.uniform(-1, 1) for _ in range(3)] for _ in range(3)])[0]
    return iter(axes.T)


def _hinge(base: str, follower: str, at: np.ndarray, axis: np.ndarray) -> Node:
    return {"kind": "revolute", "bodies": [base, follower], "at": at.tolist(), "axis": axis.tolist()}


def _link(model: Node, name: str, base: str, start: np.ndarray, end: np.ndarray, axis: np.ndarray, weight: float) -> None:
    model["points"] |= {f"{name}_start": start.tolist(), f"{name}_end": end.tolist()}
    rod = {"rod": {"from": f"{name}_start", "to": f"{name}_end"}, "mass": weight}
    model["bodies"][name] = {"shapes": [rod, {"sphere": 0.1, "mass": weight / 3, "at": f"{name}_end"}]}
    model["joints"][f"foot_{name}"] = _hinge(base, name, start, axis)
