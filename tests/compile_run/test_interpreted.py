"""Interpreted programs: their values, the runs that follow, and refusals."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.analysis.closing import FlatRoad, design_coordinates, evaluate_scene_inputs
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.pipeline import generate
from cutjoint.elements.joints import JOINTS
from cutjoint.methods import INTEGRATORS, METHODS, names_of
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import JointKind, Model, Numerics, Road, Scene
from cutjoint.program.records import Program
from cutjoint.program.schedule import schedule
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import SimulatorError, call_simulator
from tests.compile_run.generated import examined_interpreter, interpret_program, random_states, run_evaluate
from tests.conftest import MODELS, needs_cpp
from tests.hash_seeds import outputs
from tests.mechanisms import random_models
from tests.mechanisms.bouncing import bouncing_text, exact_bounces
from tests.oracles.scalars import interpret_scalars
from tests.physics.simulation import completed
from tests.runtime.test_domains import MESSAGE, check, falling

pytestmark = needs_cpp

#: Programs are run as they are rounded: what is left are sines and the like of another library, one unit in the last place each.
EXACT = 1e-13

#: Values that the penalty of 1e4 N/m against masses from 1 kg on multiplies have ten times as much (2.2e-13 was seen).
STIFF = {"vdot": 1e-12, "correction": 1e-12, "dz": 1e-12}


def interpreted(name: str) -> Artifact:
    """A model with a single scene, for the interpreter."""
    model = read_model(MODELS / f"{name}.yaml")
    (scene,) = model.scenes.values()
    return compile_interpreted(model, scene)


def agree(artifact: Artifact, scene: Scene) -> None:
    """Check what an interpreted program gives against the interpreter of scalars."""
    equations: Any = replace(artifact.equations, scene=scene)
    states = random_states(equations, 2, seed=3)
    found = run_evaluate(examined_interpreter("recursive"), artifact.topology.model, scene, states, artifact.description)
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
    for kind in JOINTS:
        yield random_models.tree_with(kind, True, 1)
        if kind is not JointKind.FREE:
            yield random_models.loop_with(kind, "roots", 1)
    yield random_models.random_tree(1)
    yield random_models.random_loops(3)
    yield random_models.with_gears(random_models.random_tree(3), 3)
    yield random_models.with_gears(random_models.random_tree(2), 2, bent=True)


def test_all_kinds_as_their_programs_say() -> None:
    for model in kinds():
        scene = replace(random_models.scene(), numerics=Numerics(penalty=1e4, closure="penalty"))
        agree(compile_interpreted(model, scene), scene)


@pytest.mark.parametrize("method", names_of(METHODS, lambda m: m.has_system))
@pytest.mark.parametrize("name", ["slider_crank", "car"])
def test_systems_as_their_programs_say(method: str, name: str) -> None:
    """All functions of a system, and the solution by its tangent, at a state near the design position."""
    model = read_model(MODELS / f"{name}.yaml")
    artifact = compile_interpreted(model, next(iter(model.scenes.values())), method=method)
    equations: Any = artifact.equations
    state = system_state(equations, np.random.default_rng(4))
    run_file = make_run_file(model, replace(artifact.scene, road=Road()), {}, task="evaluate", method=method, options=PLAIN_STEPS)
    at = {key: value.tolist() for key, value in state.items() if key in ("q", "v", "vdot", "lambda", "w", "right")}
    at |= {"t": 0.3, "penalty": 1e4, "weights": {"damping": 2e-3, "stiffness": 1e-6, "constraint": 0.6}}
    at["relative"] = {key: state[f"relative_{key}"].tolist() for key in "qv"}
    entries = {**run_file.entries(), "states": [at], "model": artifact.description}
    (found,) = call_simulator(examined_interpreter("lagrangian"), entries)["results"]
    pattern: Any = artifact.description["description"]["pattern"] if artifact.description else {}
    for function, names in RESULTS.items():
        for array, values in system_results(artifact.program, equations, function, state).items():
            result = np.array(found["placed"][array] if function == "initial_coordinates" else found[names.get(array, array)])
            assert np.abs(result - values).max(initial=0.0) <= STIFF["vdot"] * max(1.0, float(np.abs(values).max(initial=0.0))), array
    rows, first, tangent = np.array(pattern["row"]), pattern["first"], np.zeros((pattern["size"],) * 2)
    for j in range(pattern["size"]):
        column = slice(first[j], first[j + 1])
        tangent[rows[column], j] = np.array(found["tangent"])[column]
    matrix = tangent + np.tril(tangent, -1).T if pattern["symmetric"] else tangent
    assert found["breakdown"] == -1
    assert np.linalg.norm(matrix @ found["solution"] - state["right"]) < 1e-9 * np.abs(matrix).max() * np.linalg.norm(found["solution"])


#: The functions of a system, and what the task "evaluate" calls results that others have too.
RESULTS: dict[str, dict[str, str]] = {
    "initial_coordinates": {}, "dynamic_residual": {}, "constraint_residual": {"residual": "closed_residual"},
    "linearise": {"force_residual": "linearised_force_residual", "residual": "linearised_residual"},
    "apply_jacobian_transposed": {}, "apply_jacobian": {}, "report": {"column": "columns"},
}  # fmt: skip


def system_state(equations: Any, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """The arrays that a system's functions read: near the design position, with unit matrices for balls."""
    start, n, m = equations.start, len(equations.coordinate_names), len(equations.equation_names)
    unknowns = len(equations.speed_names) if equations.charts else n
    state = {"relative_q": design_coordinates(start) + 0.01 * rng.standard_normal(start.coordinates)}
    state |= {"relative_v": rng.standard_normal(start.speeds), "penalty": np.array([1e4]), "weights": np.array([2e-3, 1e-6, 0.6])}
    state |= {"vdot": rng.standard_normal(unknowns), "lambda": rng.standard_normal(m), "w": rng.standard_normal(m)}
    state |= {"t": np.array([0.3]), "weights.ball_tangents": np.tile(np.eye(3).ravel(), sum(c.ball for c in equations.charts))}
    program = schedule(equations.builder, [(f.name, f.results) for f in equations.functions])
    placed = system_results(program, equations, "initial_coordinates", state)
    size = len(equations.row_names)
    return {**state, **placed, "right": rng.standard_normal(size)}


def system_results(program: Program, equations: Any, function: str, state: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays that a function of a system fills, by the interpreter of scalars."""
    inputs = {**state, "motion": np.ones(1), "parameters": np.array([p.value for p in equations.parameters])}
    inputs |= {
        symbol: state[slot.array][slot.offset : slot.offset + len(slot.names)]
        for symbol, slot in equations.slots.items() if slot.array in state and not symbol.startswith("placed")
    }  # fmt: skip
    inputs |= evaluate_scene_inputs(equations, inputs["parameters"], 0.3)
    results = program.function(function).results
    values = interpret_scalars(program.graph, [r.scalar for r in results], inputs, dict.fromkeys(equations.roads, FlatRoad()))
    found: dict[str, dict[int, float]] = {}
    for r in results:
        slot = equations.slots[r.target]
        found.setdefault(slot.array, {})[slot.offset + r.index] = values[r.scalar]
    return {array: np.array([numbers[i] for i in range(len(numbers))]) for array, numbers in found.items()}


@pytest.mark.parametrize("method", METHODS)
def test_what_was_generated_is_interpreted_the_same(method: str) -> None:
    """It is not derived again, and the interpreter reads the same."""
    model = read_model(MODELS / "slider_crank.yaml")
    scene = next(iter(model.scenes.values()))
    made = generate(model, scene, scene.outputs, method=method)[:2]
    anew, again = (compile_interpreted(model, scene, method=method, scheduled=m) for m in (None, made))
    assert anew.description == again.description


@cache
def bounce(method: str = "recursive") -> Artifact:
    model = read_model_text(bouncing_text(0.0, 0.5), "bounce.yaml")
    return compile_interpreted(model, model.scenes["drop"], method=method)


@pytest.mark.parametrize(("method", "integrator"), [
    (m.name, i.name) for m in METHODS.values() if m.events for i in INTEGRATORS.values() if m.name in i.methods
])  # fmt: skip
def test_all_integrators_find_a_bounce(method: str, integrator: str) -> None:
    """Located events, work and energy: without damping the mass comes back, and its energy stays."""
    run = completed(simulate(bounce(method), integrator=integrator, dt=2e-4, events="located"))
    heights, switched = exact_bounces(run.t, 0.0, 0.5)
    assert run["mass.z"] == pytest.approx(heights, abs=1e-4)
    assert run.statistics.events == switched
    assert run.energy is not None
    assert run.energy.share < 1e-4


def test_a_law_without_a_value_is_named() -> None:
    artifact = compile_interpreted(falling(), falling().scenes["fall"])
    check(simulate(artifact, check=False).failure, MESSAGE, 0.39)


def test_the_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    program = (
        "import json; from tests.compile_run.test_interpreted import interpreted; "
        "print(json.dumps(interpreted('pendulum').description))"
    )
    one, other = outputs(program, "1", "2")
    assert one == other
    artifact = interpreted("pendulum")
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


#: Documents of another version, and what is said of them; the compiler's own need no check.
OTHERS = {
    "unknown operation": (put(["hypot", 1], "operations", 0), 'the operation \\["hypot",1\\] is unknown'),
    "three lanes": (put(["add", 3], "operations", 0), 'the operation \\["add",3\\] is unknown'),
    "no function": (lambda d: d["functions"].pop("report"), "key 'report' not found"),
    "text for a number": (put("1", "registers"), "type must be number"),
}  # fmt: skip


def check_refusal(artifact: Artifact, change: Callable[[Any], None], message: str) -> None:
    run = make_simulator_run(artifact, PLAIN_STEPS)
    description = json.loads(json.dumps(run.description))
    change(description)
    with pytest.raises(SimulatorError, match=message):
        call_simulator(run.simulator, {**run.run_file.entries(), "model": description})


@pytest.mark.parametrize("other", OTHERS)
def test_a_program_of_another_version_is_refused(other: str) -> None:
    check_refusal(bounce(), *OTHERS[other])


def test_a_system_needs_its_start() -> None:
    check_refusal(bounce("recursive-newton"), lambda d: d.pop("start"), "key 'start' not found")
