"""Runs of a calibration: interpreted or by generated code, with the same motion, and their work."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cutjoint.methods import METHODS
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.measure import distance
from cutjoint.reduce.trials import Steps, Trials
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp


def turn() -> tuple[Model, Scene]:
    model = read_model(MODELS / "slider_crank.yaml")
    return model, replace(next(iter(model.scenes.values())), end=0.2, accuracy=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_a_run_is_the_same_when_its_code_is_compiled(method: str) -> None:
    """Rounding and the tolerance of iterations apart.  Runs are compiled once others have taken as long as compiling."""
    trials, steps = Trials(*turn(), method), Steps(integrator="trapezoidal", dt=1e-3)
    first = trials.run(steps, {})
    assert trials.artifact.description is not None
    trials._left = -1.0
    again = trials.run(steps, {})
    assert trials.artifact.description is None
    assert trials.artifact.method == method
    assert distance(first, again) < 1e-8
    assert trials.work(first, steps) == pytest.approx(trials.work(again, steps), rel=0.01)  # iterations that rounding ends earlier or later


@pytest.mark.parametrize("integrator", ["dormand-prince", "dop853", "trapezoidal"])
def test_the_work_is_that_of_all_evaluations_of_a_run(integrator: str) -> None:
    """Not of steps alone, of which explicit integrators make many evaluations each."""
    trials = Trials(*turn(), "recursive")
    steps = Steps(integrator=integrator, **({"dt": 1e-3} if integrator == "trapezoidal" else {"tolerance": 1e-5}))
    run = trials.run(steps, {})
    assert trials.work(run, steps) > run.evaluations * trials.artifact.program.instructions("evaluate")
    assert run.evaluations > 2 * run.steps


def test_rows_between_steps_take_work() -> None:
    """The same steps with ten times the rows: each row has accelerations of its own, an evaluation at least."""
    model, scene = turn()
    steps, works, runs = Steps(integrator="dormand-prince", tolerance=1e-5), [], []
    for output_step in (0.02, 0.002):
        trials = Trials(model, replace(scene, output_step=output_step), "recursive")
        runs.append(trials.run(steps, {}))
        works.append(trials.work(runs[-1], steps))
    assert runs[0].steps == runs[1].steps
    evaluation = trials.artifact.program.instructions("evaluate")
    assert works[1] - works[0] > (len(runs[1].t) - len(runs[0].t)) * evaluation
