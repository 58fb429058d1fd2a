"""The truth that reduced models are measured by: the full model at steps that are halved until nothing changes any more."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil, floor, inf

from cutjoint.methods import METHODS
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.measure import distance
from cutjoint.reduce.trials import Trials
from cutjoint.run.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulator import SimulatorError

#: The share that the last halving of the truth's step may move it by: at order two a third of that is left.
SETTLED = 0.1

#: The truth's step is halved at most so often.
MOST_HALVINGS = 9


@dataclass(frozen=True, kw_only=True)
class Truth:
    """A run of the full model that halving its step moves by ``settled`` (m, rad) only."""

    run: Trajectory
    settled: float


def find_truth(model: Model, scene: Scene, parameters: Mapping[str, float], *, when_running: Callable[[], None] | None = None) -> Truth:
    """The full model of a scene with a tolerance by the first method that settles.

    Methods with a linear system come first: they hold loops by the equations.  ``when_running`` is called as the runs of a method begin,
    which leave this program little to do.

    Raises:
        RunError: none settles.
    """
    assert scene.tolerance is not None
    reasons = []
    for method in sorted(METHODS, key=lambda name: not METHODS[name].has_system):
        try:
            step = scene.numerics.of_method(method).step
            trials = Trials(model, scene, method)
            if when_running is not None:
                when_running()
            return _settle(trials, step, scene, parameters)
        except (ModelError, RunError, SimulatorError) as error:
            reasons.append(f"{method}: {error}")
    raise RunError(f"{scene.span}: scene '{scene.name}': no truth to measure by: " + "; ".join(reasons))


def _settle(trials: Trials, step: float, scene: Scene, parameters: Mapping[str, float]) -> Truth:
    assert scene.tolerance is not None
    before: Trajectory | None = None
    moved, problem = inf, ""
    for halving in range(MOST_HALVINGS + 1):
        dt = fraction(scene.output_step, step * 2.0**-halving)
        run = trials.run(dt, parameters)
        if run.failure is not None:
            problem = str(run.failure)
            if before is not None:
                break
            continue
        moved = distance(before, run) if before is not None else inf
        before = run
        if moved <= SETTLED * scene.tolerance:
            return Truth(run=run, settled=moved)
    raise RunError(f"the motion still changes by {moved:.2g} at the smallest step" if moved < inf else problem)


def fraction(row: float, about: float) -> float:
    """The whole fraction or multiple of the rows' distance that is next below a step."""
    return row * floor(about / row * (1 + 1e-9)) if about >= row else row / ceil(row / about * (1 - 1e-9))
