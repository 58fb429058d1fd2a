"""The costs of the models of a reduction sequence, and the distances of their motions from the truth.

The truth is the full model with steps that are refined until nothing changes any more.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, inf
from typing import Any

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import DEFAULT_INTEGRATOR, INTEGRATORS, METHODS
from cutjoint.model.expressions.units import PLACES
from cutjoint.model.records import Model, Scene
from cutjoint.model.targets import OBJECTIVES, split_target
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.reduce.sequence import ReducedModel
from cutjoint.reduce.trials import Steps, Trials
from cutjoint.run.accuracy import differences
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory, distance_of
from cutjoint.run.run_file import fitting_interval
from cutjoint.run.scenes import with_closure
from cutjoint.run.settings import accuracy_of
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import watched

# Truth

#: The largest change of the reference by the last refinement, as a share of the accuracy; a third of it remains at most.
CONVERGED = 0.1
#: Methods and integrators of a reference in the order in which they are tried; loops are held by their equations.
REFERENCES = (
    ("recursive", "dop853"), ("recursive-newton", "radau5"), *((name, DEFAULT_INTEGRATOR) for name in sorted(METHODS, reverse=True)),
)  # fmt: skip
#: The largest number of refinements of equal steps, each by half, and of tolerances, each by the second number down to the last one.
MOST_HALVINGS, STRICTER, STRICTEST = 9, 30.0, 1e-12
OTHERS = ("slip", "camber", "deflection")  #: quantities in units of places and angles that are ratios of speeds or follow from a road
REPETITIONS = 5  #: timed runs, of which the fastest counts


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A run of the full model by ``trials`` with ``steps``; the last refinement changed it by ``change`` (m, rad) only."""

    run: Trajectory
    change: float
    trials: Trials
    steps: Steps


def find_reference(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Reference:
    """The full model of a scene by the first method and integrator that settle. Raises RunError: none does."""

    def leave(counts: Mapping[str, Any]) -> None:
        if counts["time"] < scene.end / 2 and counts.get("stiff_steps", 0) > counts["steps"] / 2:
            raise RunError("stability limits its steps, which would take long")

    reasons: dict[str, str] = {}
    for method, integrator in REFERENCES:
        closed = with_closure(scene, INTEGRATORS[integrator].closure) if METHODS[method].closures else scene
        try:
            with watched(leave):
                return _converge(Trials(model, closed, method), integrator, closed, parameters)
        except CutjointError as error:
            reasons.setdefault(str(error), f"{method}, {integrator}")
    words = "; ".join(f"{tried}: {reason}" for reason, tried in reasons.items())
    raise RunError(f"{scene.span}: scene '{scene.name}': no converged reference run: {words}")


def _converge(trials: Trials, integrator: str, scene: Scene, parameters: Mapping[str, float]) -> Reference:
    before: Trajectory | None = None
    moved, problem = inf, "it would take tolerances of rounding errors"
    for steps in _refined(trials, integrator, scene):
        run = trials.run(steps, parameters)
        if run.failure is not None:
            problem = str(run.failure)
            if before is not None:
                break
            continue
        moved = distance(before, run, scene.targets) if before is not None else inf
        before = run
        if moved <= CONVERGED * asked_of(scene):
            return Reference(run=run, change=moved, trials=trials, steps=steps)
    raise RunError(f"the motion still changes by {moved:.2g} at the smallest step" if moved < inf else problem)


def _refined(trials: Trials, integrator: str, scene: Scene) -> list[Steps]:
    if INTEGRATORS[integrator].adaptive:
        tolerances = (min(1e-5, 0.1 * asked_of(scene)) / STRICTER**k for k in range(5))
        return [Steps(integrator=integrator, tolerance=tolerance) for tolerance in tolerances if tolerance >= STRICTEST]
    row, first = fitting_interval(trials.artifact.model, scene), scene.numerics.of_method(trials.artifact.method).step
    return [Steps(integrator=integrator, dt=row / ceil(row / first * 2**k - 1e-9)) for k in range(MOST_HALVINGS + 1)]


# Costs and distances


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A model's run at one step: the fastest of several in ``seconds``, and the distance from another run, see `distance`.

    ``differences`` from the other run are the largest of each output, in its unit.
    """

    seconds: float
    error: float
    failure: str = ""
    differences: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)


def asked_of(scene: Scene) -> float:
    """The largest `distance` that a scene asks for."""
    return 1.0 if scene.targets else accuracy_of(scene)


def distance(run: Trajectory, reference: Trajectory, targets: Mapping[str, float] | None = None) -> float:
    """The largest difference (m, rad) of a place or an angle over the same rows; infinite where a run has not come to its end.
    With ``targets`` it is the largest multiple of one. Raises RunError: no column is a place or an angle."""
    if targets and run.failure is None and len(run.t) == len(reference.t):
        return max(_difference(name, run, reference) / most for name, most in targets.items())
    names = [name for name, unit in reference.units.items() if unit in PLACES and name.rpartition(".")[2] not in OTHERS]
    if not names:
        raise RunError("no output is a position or an angle, by which runs are compared; add one to the scene's outputs, such as body.x")
    if run.failure is not None or len(run.t) != len(reference.t):
        return inf
    return max(PLACES[reference.units[name]] * float(distance_of(name, run[name], reference[name]).max()) for name in names)


def _difference(target: str, run: Trajectory, reference: Trajectory) -> float:
    objective, column = split_target(target)
    if objective:
        return abs(float(OBJECTIVES[objective](run[column]) - OBJECTIVES[objective](reference[column])))
    return float(distance_of(column, run[column], reference[column]).max())


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
        apart = differences((), run, reference) if run.failure is None else {}
        cost = time_run(artifact, {} if dt is None else {"dt": dt}, parameters)
        costs.append(replace(cost, error=distance(run, reference), differences=apart, units=run.units))
    return costs


def time_run(artifact: Artifact, options: Mapping[str, Any], parameters: Mapping[str, float] | None = None) -> Cost:
    """The fastest of several runs; without options they keep the scene's accuracy."""
    runs = [simulate(artifact, parameters=parameters, error=not options, check=False, **options) for _ in range(REPETITIONS)]
    failure = next((str(run.failure) for run in runs if run.failure is not None), "")
    return Cost(seconds=min(run.seconds for run in runs), error=inf, failure=failure)
