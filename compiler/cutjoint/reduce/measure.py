"""The costs of the models of a reduction sequence, and the distances of their motions from that of the full model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from cutjoint.pipeline import compile_scene
from cutjoint.reduce.sequence import ReducedModel
from cutjoint.run.artifact import Artifact
from cutjoint.run.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate

#: Units of places and angles, by which runs are compared, and quantities in them that are ratios of speeds or follow from a road.
PLACES, OTHERS = ("m", "rad"), ("slip", "camber", "deflection")

#: Timed runs, of which the fastest counts.
REPETITIONS = 5


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A model's run at one step: the fastest of several in ``seconds``, and the distance from another run, see `distance`."""

    seconds: float
    error: float
    failure: str = ""


def distance(run: Trajectory, truth: Trajectory) -> float:
    """The largest difference of a column in m or rad over the rows that both runs have; infinite where there is none.

    Raises:
        RunError: no column is a place or an angle.
    """
    names = [name for name, unit in truth.units.items() if unit in PLACES and name.rpartition(".")[2] not in OTHERS]
    if not names:
        raise RunError("no output is a place or an angle to compare runs by; add one to the scene's outputs, such as body.x")
    if run.failure is not None:
        return inf
    apart = truth.t[1] - truth.t[0] if len(truth.t) > 1 else 1.0
    nearest = np.clip(np.searchsorted(truth.t, run.t - apart / 2), 0, len(truth.t) - 1)
    same = np.abs(truth.t[nearest] - run.t) < 1e-3 * apart
    if not same.any():
        return inf
    return max(float(np.abs(run[name][same] - truth[name][nearest[same]]).max()) for name in names)


def measure_reduced(
    variants: Sequence[ReducedModel], *, dt: float | None = None, parameters: Mapping[str, float] | None = None
) -> list[Cost]:
    """Compile and run models at the same step (s); errors are distances from the run of the first, which is the full model.

    Raises:
        RunError: the full model does not run to its end; or as for `distance`.
    """
    costs: list[Cost] = []
    truth: Trajectory | None = None
    for variant in variants:
        artifact = compile_scene(variant.model, variant.scene, method=variant.method)
        run = simulate(artifact, dt=dt, parameters=parameters, check=False)
        truth = truth or _finished(run, variant)
        costs.append(replace(time_run(artifact, dt, parameters), error=distance(run, truth)))
    return costs


def _finished(run: Trajectory, variant: ReducedModel) -> Trajectory:
    if run.failure is None:
        return run
    joint = run.failure.element.rpartition(".")[0]
    place = next((j.span for j in variant.model.joints if j.name == joint), variant.scene.span)
    raise RunError(f"{place}: scene '{variant.scene.name}': the full model has no run to measure by: {run.failure}")


def time_run(artifact: Artifact, dt: float | None, parameters: Mapping[str, float] | None = None) -> Cost:
    """The fastest of several runs, of which those without a given step keep the scene's tolerance."""
    runs = [simulate(artifact, dt=dt, parameters=parameters, error=dt is None, check=False) for _ in range(REPETITIONS)]
    failure = next((str(run.failure) for run in runs if run.failure is not None), "")
    return Cost(seconds=min(run.seconds for run in runs), error=inf, failure=failure)
