"""Outcomes of runs: five of them, and the limits between them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Array, Trajectory
from cutjoint.run.scenes import with_settings
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import SimulatorError
from cutjoint.toolchain.temporary import temporary_folder
from cutjoint_bench.errors import exceeds_from, measure_errors
from cutjoint_bench.measure import WRONG, extent
from cutjoint_bench.records import Case, Errors
from cutjoint_bench.reference import Reference

#: Above this share of the extent of the motion an error of position is inaccurate, and a gap has drifted that is above the same share of it
#: or above ``GAP`` (m).
INACCURATE = 1e-3
GAP = 1e-3

#: The outcomes, from the best to the worst, in words.
OUTCOMES: Mapping[str, str] = {
    "converged": f"it ends, and its error of position is at most {INACCURATE:.1%} of the extent of the motion",
    "inaccurate": f"it ends, and its error is above {INACCURATE:.1%} of the extent",
    "drifted": f"it ends with a constraint open by more than {1e3 * GAP:g} mm or {INACCURATE:.1%} of the extent, whichever is less",
    "diverged": "it stops and says why",
    "wrong": f"it ends silently, and its error is above {WRONG:.0%} of the extent",
}


@dataclass(frozen=True, kw_only=True)
class Finding:
    """The end of a run: its outcome, the largest error of position (m), relative error of energy, and residual at its end (m or rad).

    ``message`` is the failure of one that diverged, ``reached`` the time of its last state in s, ``since`` that from which on its error is
    above ``INACCURATE`` of the extent.
    """

    outcome: str
    position: float = nan
    energy: float = nan
    residual: float = nan
    message: str = ""
    reached: float = 0.0
    since: float = nan

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON; what is unknown or infinite is None."""
        return {name: None if isinstance(x, float) and not isfinite(x) else x for name, x in asdict(self).items()}


@dataclass(frozen=True, kw_only=True)
class Truth:
    """The standard of runs: the true motion ``at`` the times of a run, and its extent in m."""

    at: Callable[[Array], Reference]
    extent: float


def known_truth(reference: Reference) -> Truth:
    """The truth of a reference that has rows of its own."""
    return Truth(at=lambda _: reference, extent=extent(reference))


def exact_truth(motion: Callable[[Array], Mapping[str, Array]], end: float) -> Truth:
    """The truth of a motion that is known at any time."""

    def at(t: Array) -> Reference:
        return Reference(t=t, columns=motion(t), position_apart=nan, velocity_apart=nan, provenance={"exact": True})

    return Truth(at=at, extent=extent(at(np.linspace(0, end, 1001))))


def try_run(
    case: Case, artifact: Artifact, truth: Truth, *, dt: float, row: float, settings: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Finding:  # fmt: skip
    """Run a compiled case with a step and rows of its own and judge how it ends.

    The integrator is the trapezoidal rule whatever the scene says.  ``settings`` are numerical ones instead of the scene's for the method,
    such as its penalty; ``parameters`` those of the model.
    """
    scene = with_settings(artifact.scene, artifact.method, settings or {})
    rerun = replace(artifact, scene=replace(scene, output_step=row))
    with temporary_folder() as folder:
        steps = folder / "steps.csv"
        try:
            run = simulate(
                rerun, dt=dt, parameters={**case.parameters, **(parameters or {})}, steps=steps, integrator="trapezoidal", events="crossed",
                check=False,
            )  # fmt: skip
        except SimulatorError as error:
            return Finding(outcome="diverged", message=str(error))
        residual = _last_residual(steps)
    if not len(run.t):
        return judge(run, Errors(), residual, truth.extent)
    known = truth.at(run.t)
    since = exceeds_from(case, run, known, INACCURATE * truth.extent)
    return replace(judge(run, measure_errors(case, run, known), residual, truth.extent), since=since)


def identify(case: Case, artifact: Artifact) -> dict[str, Any]:
    """The parts of a case and its simulator that a run depends on, for the key of a store."""
    return {"case": case.name, "input": case.input_digest(artifact.method), "binary": artifact.binary.path.parent.name}


def _last_residual(steps: Path) -> float:
    """The column ``position`` of the last step of a table; nan if no step ended."""
    if not steps.exists():
        return nan
    with steps.open(encoding="utf-8") as stream:
        names = stream.readline().rstrip("\n").split(",")
        last = deque(stream, maxlen=1)
    return float(last[0].split(",")[names.index("position")]) if last else nan


def judge(run: Trajectory, errors: Errors, residual: float, size: float) -> Finding:
    """The outcome of a run in a motion of an extent (m); what is not a number is above all limits."""
    reached = float(run.t[-1]) if len(run.t) else 0.0
    found = Finding(outcome="converged", position=errors.position, energy=errors.energy, residual=residual, reached=reached)
    if run.failure is not None:
        return replace(found, outcome="diverged", message=str(run.failure))
    if not errors.position <= WRONG * size:
        return replace(found, outcome="wrong")
    if residual > min(GAP, INACCURATE * size):
        return replace(found, outcome="drifted")
    return found if errors.position <= INACCURATE * size else replace(found, outcome="inaccurate")
