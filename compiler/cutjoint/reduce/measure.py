"""The costs of the models of a reduction sequence, and the distances of their motions from the truth.

The truth is the full model at steps that are halved until nothing changes any more.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor, inf

import numpy as np

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import DEFAULT_INTEGRATOR, METHODS
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.reduce.sequence import ReducedModel
from cutjoint.reduce.trials import Steps, Trials
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import with_default_closure
from cutjoint.run.settings import accuracy_of
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import SimulatorError

# Truth

#: The largest change of the reference by the last halving, as a share of the accuracy; at order 2 a third of it remains.
CONVERGED = 0.1

MOST_HALVINGS = 9  #: the largest number of halvings of the reference's step
#: Units of places and angles, by which runs are compared, and quantities in them that are ratios of speeds or follow from a road.
PLACES, OTHERS = ("m", "rad"), ("slip", "camber", "deflection")
REPETITIONS = 5  #: timed runs, of which the fastest counts


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A run of the full model; halving its step changes it by ``change`` (m, rad) only."""

    run: Trajectory
    change: float


def find_reference(
    model: Model, scene: Scene, parameters: Mapping[str, float], *, when_running: Callable[[], None] | None = None
) -> Reference:  # fmt: skip
    """The full model of a scene by the first method that settles.
    Methods with a linear system come first: they hold loops by the equations. ``when_running`` is called as the runs of a method begin,
    which leave this program little to do. Raises RunError: none settles."""
    reasons = []
    for method in sorted(METHODS, key=lambda name: not METHODS[name].has_system):
        try:
            step = scene.numerics.of_method(method).step
            trials = Trials(model, with_default_closure(scene, method, DEFAULT_INTEGRATOR), method)
            if when_running is not None:
                when_running()
            return _converge(trials, step, scene, parameters)
        except (ModelError, RunError, SimulatorError) as error:
            reasons.append(f"{method}: {error}")
    raise RunError(f"{scene.span}: scene '{scene.name}': no converged reference run: " + "; ".join(reasons))


def _converge(trials: Trials, step: float, scene: Scene, parameters: Mapping[str, float]) -> Reference:
    before: Trajectory | None = None
    moved, problem = inf, ""
    for halving in range(MOST_HALVINGS + 1):
        dt = fraction(scene.output_step, step * 2.0**-halving)
        run = trials.run(Steps(dt=dt), parameters)
        if run.failure is not None:
            problem = str(run.failure)
            if before is not None:
                break
            continue
        moved = distance(before, run) if before is not None else inf
        before = run
        if moved <= CONVERGED * accuracy_of(scene):
            return Reference(run=run, change=moved)
    raise RunError(f"the motion still changes by {moved:.2g} at the smallest step" if moved < inf else problem)


def fraction(row: float, about: float) -> float:
    """The largest step not above a given one that is a whole fraction or multiple of the sample interval."""
    return row * floor(about / row * (1 + 1e-9)) if about >= row else row / ceil(row / about * (1 - 1e-9))


# Costs and distances


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A model's run at one step: the fastest of several in ``seconds``, and the distance from another run, see `distance`."""

    seconds: float
    error: float
    failure: str = ""


def distance(run: Trajectory, reference: Trajectory) -> float:
    """The largest difference of a column in m or rad over the rows that both runs have; infinite where there is none.
    Raises RunError: no column is a place or an angle."""
    names = [name for name, unit in reference.units.items() if unit in PLACES and name.rpartition(".")[2] not in OTHERS]
    if not names:
        raise RunError("no output is a position or an angle, by which runs are compared; add one to the scene's outputs, such as body.x")
    if run.failure is not None:
        return inf
    apart = reference.t[1] - reference.t[0] if len(reference.t) > 1 else 1.0
    nearest = np.clip(np.searchsorted(reference.t, run.t - apart / 2), 0, len(reference.t) - 1)
    same = np.abs(reference.t[nearest] - run.t) < 1e-3 * apart
    if not same.any():
        return inf
    return max(float(np.abs(run[name][same] - reference[name][nearest[same]]).max()) for name in names)


def measure_reduced(
    variants: Sequence[ReducedModel], *, dt: float | None = None, parameters: Mapping[str, float] | None = None
) -> list[Cost]:
    """Compile and run models at the same step (s); errors are distances from the run of the first, which is the full model.
    Raises RunError: the full model does not run to its end; or as for `distance`."""
    costs: list[Cost] = []
    reference: Trajectory | None = None
    for variant in variants:
        artifact = compile_scene(variant.model, variant.scene, CompileOptions(method=variant.method))
        run = simulate(artifact, dt=dt, parameters=parameters, check=False)
        if reference is None and run.failure is not None:
            joint = run.failure.element.rpartition(".")[0]
            place = next((j.span for j in variant.model.joints if j.name == joint), variant.scene.span)
            raise RunError(f"{place}: scene '{variant.scene.name}': the full model has no run to measure by: {run.failure}")
        reference = reference or run
        costs.append(replace(time_run(artifact, None if dt is None else Steps(dt=dt), parameters), error=distance(run, reference)))
    return costs


def time_run(artifact: Artifact, steps: Steps | None, parameters: Mapping[str, float] | None = None) -> Cost:
    """The fastest of several runs; without given steps they keep the scene's accuracy."""
    options = {} if steps is None else steps.options
    runs = [simulate(artifact, parameters=parameters, error=steps is None, check=False, **options) for _ in range(REPETITIONS)]
    failure = next((str(run.failure) for run in runs if run.failure is not None), "")
    return Cost(seconds=min(run.seconds for run in runs), error=inf, failure=failure)
