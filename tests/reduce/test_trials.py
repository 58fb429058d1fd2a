"""Runs of a calibration: interpreted or by generated code, with the same motion."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from cutjoint.compile.derivation import schedule_method
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import DEFAULT_INTEGRATOR, INTEGRATORS, METHODS
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Numerics, Scene
from cutjoint.reduce.choose import Candidate, Choice, chosen_model, find_step, find_tolerated, searches, trials_by
from cutjoint.reduce.measure import Reference, distance, find_reference
from cutjoint.reduce.sequence import ReducedModel, reduction_sequence
from cutjoint.reduce.trials import Steps, Trials, run_at
from cutjoint.run.settings import find_closure
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp


def turn() -> tuple[Model, Scene]:
    model = read_model(MODELS / "slider_crank.yaml")
    return model, replace(next(iter(model.scenes.values())), end=0.2, accuracy=1e-3)


def trials_of(variant: ReducedModel) -> Trials:
    return Trials(variant.model, variant.scene, variant.method, scheduled=variant.scheduled)


@pytest.mark.parametrize("method", METHODS)
def test_a_run_is_the_same_when_its_code_is_compiled(method: str) -> None:
    """Rounding and the tolerance of iterations apart.  Its instructions are those of its evaluations."""
    model, scene = turn()
    trials = Trials(model, scene, method)
    first = trials.run(Steps(dt=1e-3), {})
    assert not trials.is_compiled
    assert trials.compiled.method == method
    assert trials.is_compiled
    again = trials.run(Steps(dt=1e-3), {})
    assert distance(first, again) < 1e-8
    if not METHODS[method].has_system:
        _, program = schedule_method(model, scene, scene.outputs, method=method)
        assert trials.instructions(again) == again.statistics.iterations * program.instructions("evaluate")


def test_long_runs_are_compiled() -> None:
    model, scene = turn()
    trials = Trials(model, scene, "recursive")
    trials.run(Steps(dt=1e-3), {})
    trials._left = 0.0
    trials.run(Steps(dt=1e-3), {})
    assert trials.is_compiled


def test_a_model_of_many_instructions_is_given_up_before_it_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    model, scene = turn()
    truth: Reference = find_reference(model, scene, {})
    (full, *_) = reduction_sequence(model, scene, "recursive")

    def compiles(*args: object, **how: object) -> None:
        raise AssertionError

    monkeypatch.setattr("cutjoint.reduce.trials.compile_scene", compiles)
    fastest = Candidate(variant="full", method="augmented", dt=1e-3, error=0.0, seconds=1e-3, instructions=1.0)
    found = find_step(full, scene, {}, truth, trials_of(full), fastest=fastest)
    assert found.seconds == inf
    assert found.failure == "more than 1.5 times the instructions of another at longer steps already"


@pytest.mark.parametrize(
    ("seconds", "instructions", "failure"),
    [(inf, 1.0, "more than 1.5 times the instructions of another"), (1e-9, inf, "slower than another")],
)
def test_a_compiled_model_is_given_up_too(seconds: float, instructions: float, failure: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.reduce.trials.compiling_seconds", lambda operations, method: 0.0)
    model, scene = turn()
    (full, *_) = reduction_sequence(model, scene, "recursive")
    fastest = Candidate(variant="full", method="augmented", dt=1e-3, error=0.0, seconds=seconds, instructions=instructions)
    found = find_step(full, scene, {}, find_reference(model, scene, {}), trials_of(full), fastest=fastest)
    assert found.failure == f"{failure} at longer steps already"


def test_a_tolerance_is_found_as_a_step_is() -> None:
    """It keeps the accuracy, and a larger one does not; a scene that names its integrator has none."""
    model, scene = turn()
    free = replace(scene, numerics=Numerics(), accuracy=1e-5)
    (full, *_) = reduction_sequence(model, free, "recursive")
    found = find_tolerated("dormand-prince", full, free, {}, find_reference(model, free, {}), trials_of(full))
    assert (found.integrator, found.failure) == ("dormand-prince", "")
    assert found.error <= 0.8e-5
    artifact, goal = compile_interpreted(model, free), 0.8e-5
    exact = simulate(artifact, integrator="dormand-prince", tolerance=1e-12, error=False)
    errors = [distance(run_at(artifact, replace(found.steps, tolerance=found.tolerance * factor), {}), exact) for factor in (1, 10**0.5)]
    assert errors[0] < 1.1 * goal
    assert errors[1] > 0.9 * goal
    (named, *_) = reduction_sequence(model, replace(scene, numerics=Numerics(integrator="trapezoidal")), "recursive")
    assert (len(searches(full)), searches(named)) == (3, ((find_step, DEFAULT_INTEGRATOR),))


def test_integrators_hold_loops_as_in_runs_of_their_own() -> None:
    """While they are tried, and where one of them is chosen."""
    model, scene = turn()
    free = replace(scene, numerics=Numerics())
    (full, *_) = reduction_sequence(model, free, "recursive")
    by = trials_by(full)
    for _, integrator in searches(full):
        adaptive = INTEGRATORS[integrator].adaptive
        picked = Candidate(
            variant=full.name, method="recursive", dt=0.0 if adaptive else 1e-3, error=0.0, seconds=1.0,
            integrator=integrator if adaptive else "", tolerance=1e-6,
        )  # fmt: skip
        chosen = chosen_model(model, free, Choice(chosen=picked, evidence=(), reference_change=0.0, reduced=full))
        tried = by(integrator)._scene
        assert {find_closure(s.numerics, METHODS["recursive"]).name for s in (tried, chosen.scene)} == {INTEGRATORS[integrator].closure}
