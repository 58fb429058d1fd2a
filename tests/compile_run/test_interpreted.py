"""Interpreted programs: what they compute, the runs that follow, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.interpreted import compile_interpreted, compile_interpreted_model
from cutjoint.methods import INTEGRATORS, METHODS, names_of
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import JointKind, Model, Numerics, Scene
from cutjoint.pipeline import simulate
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.errors import RunError
from cutjoint.run.options import PLAIN_STEPS
from cutjoint.run.simulator import SimulatorError, call_simulator
from tests.compile_run.generated import interpret_program, random_states, run_evaluate
from tests.conftest import MODELS, needs_cpp
from tests.hash_seeds import outputs
from tests.mechanisms import random_models
from tests.mechanisms.bouncing import bouncing_text, exact_bounces
from tests.physics.simulation import completed
from tests.runtime.test_domains import MESSAGE, check, falling

pytestmark = needs_cpp

#: Programs are run as they are rounded: what is left are sines and the like of another library, one unit in the last place each.
EXACT = 1e-13

#: What the penalty of 1e4 N/m against masses from 1 kg on multiplies has ten times as much (2.2e-13 was seen).
STIFF = {"vdot": 1e-12, "correction": 1e-12, "dz": 1e-12}


def agree(artifact: Artifact, scene: Scene) -> None:
    """Check what an interpreted program gives against the interpreter of scalars."""
    equations: Any = replace(artifact.equations, scene=scene)
    states = random_states(equations, 2, seed=3)
    found = run_evaluate(artifact.binary.path, artifact.topology.model, scene, states, artifact.description)
    for state, results in zip(states, found, strict=True):
        for name, values in interpret_program(artifact.program, equations, state).items():
            scale = max(1.0, float(np.abs(values).max(initial=0.0)))
            assert np.abs(results[name] - values).max(initial=0.0) <= STIFF.get(name, EXACT) * scale, name


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda path: path.stem)
def test_models_as_their_programs_say(path: Path) -> None:
    model = read_model(path)
    scene = next(iter(model.scenes.values()))
    flat = replace(scene, road=replace(scene.road, left=(), right=()))
    agree(compile_interpreted(model, flat), replace(flat, numerics=replace(flat.numerics, penalty=1e4, frequency=10.0)))


def kinds() -> Iterator[Model]:
    """A tree and a loop with each joint kind, and all kinds of forces between bodies of others."""
    for kind in JointKind:
        yield random_models.tree_with(kind, True, 1)
        if kind is not JointKind.FREE:
            yield random_models.loop_with(kind, "roots", 1)
    yield random_models.random_tree(1)
    yield random_models.random_loops(3)
    yield random_models.with_gears(random_models.random_tree(3), 3)


def test_all_kinds_as_their_programs_say() -> None:
    for model in kinds():
        scene = replace(random_models.scene(), numerics=Numerics(penalty=1e4, closure="penalty"))
        agree(compile_interpreted(model, scene), scene)


@cache
def bounce() -> Artifact:
    model = read_model_text(bouncing_text(0.0, 0.5), "bounce.yaml")
    return compile_interpreted(model, model.scenes["drop"])


@pytest.mark.parametrize("integrator", names_of(INTEGRATORS, lambda i: "recursive" in i.methods and i.in_files))
def test_all_integrators_find_a_bounce(integrator: str) -> None:
    """Located events, work and energy: without damping the mass comes back, and its energy stays."""
    run = completed(simulate(bounce(), integrator=integrator, dt=2e-4, events="located"))
    heights, switched = exact_bounces(run.t, 0.0, 0.5)
    assert run["mass.z"] == pytest.approx(heights, abs=1e-4)
    assert run.effort.events == switched
    assert run.energy is not None
    assert run.energy.share < 1e-4


def test_a_law_without_a_value_is_named() -> None:
    artifact = compile_interpreted(falling(), falling().scenes["fall"])
    check(simulate(artifact, check=False).failure, MESSAGE, 0.39)


def test_the_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    program = (
        "import json; from cutjoint.interpreted import compile_interpreted_model as c; "
        f"print(json.dumps(c({str(MODELS / 'pendulum.yaml')!r}).description))"
    )
    one, other = outputs(program, "1", "2")
    assert one == other
    artifact = compile_interpreted_model(MODELS / "pendulum.yaml")
    assert json.dumps(artifact.description) == one
    for name in ("one.csv", "other.csv"):
        simulate(artifact, out=tmp_path / name, error=False)
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "other.csv").read_bytes()


def put(value: Any, *keys: Any) -> Callable[[Any], None]:
    """Sets a value of a document."""

    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = value

    return change


EVALUATE = ("functions", "evaluate")

#: Damages to a program, and what is said of them.
DAMAGES = {
    "no operation": (put(10**6, *EVALUATE, "code", 0), "an instruction has no operation"),
    "negative operation": (put(-1, *EVALUATE, "code", 0), "an instruction has no operation"),
    "register beyond": (put(10**6, *EVALUATE, "code", 1), "there is no register 1000000"),
    "negative register": (put(-7, *EVALUATE, "code", 2), "there is no register -7"),
    "cut off": (lambda d: d["functions"]["evaluate"]["code"].pop(), "the last instruction is not whole"),
    "result beyond": (put(10**6, *EVALUATE, "results", "vdot", 0), "there is no register 1000000"),
    "a result less": (lambda d: d["functions"]["evaluate"]["results"]["vdot"].pop(), "a wrong number of elements of vdot"),
    "unknown operation": (put(["hypot", 1], "operations", 0), 'the operation \\["hypot",1\\] is unknown'),
    "three lanes": (put(["add", 3], "operations", 0), 'the operation \\["add",3\\] is unknown'),
    "array beyond": (put(10**6, "arrays", "q"), "has no room for q"),
    "no memory": (put(2**60, "registers"), "has no memory of 1152921504606846976 registers"),
    "chart beyond": (put(9, "description", "charts", 0, 0), "has no place 9"),
    "switch of no road": (put(0, "description", "switches", 0, 2), "has no place 0"),
    "no function": (lambda d: d["functions"].pop("report"), "key 'report' not found"),
    "text for a number": (put("1", "registers"), "type must be number"),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_program_is_refused(damage: str) -> None:
    change, message = DAMAGES[damage]
    run = make_simulator_run(bounce(), PLAIN_STEPS)
    description = deepcopy(run.description)
    change(description)
    with pytest.raises(SimulatorError, match=message):
        call_simulator(run.simulator, {**run.run_file, "model": description})


def test_other_methods_are_refused() -> None:
    name = next(name for name in METHODS if not METHODS[name].interpreted)
    with pytest.raises(RunError, match=f"{name} is not interpreted: use --method recursive"):
        compile_interpreted_model(MODELS / "pendulum.yaml", method=name)
