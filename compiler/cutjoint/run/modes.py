"""The state that a simulator reaches, and the mechanism linearised there."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.analysis.linearise import Linearisation, Point, linearise
from cutjoint.formulate.implicit.equations import ImplicitEquations
from cutjoint.formulate.inputs import discrete_state_name
from cutjoint.methods import LINEARISED
from cutjoint.model.ranges import StepsError, count_steps
from cutjoint.model.records import Scene
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.record import RunFile
from cutjoint.run.results import FailureReport, read_locking_forces
from cutjoint.run.road_field import surface_of
from cutjoint.run.roads import WheelRoad
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import with_settings
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.run.simulator import Progress, call_simulator, failure_of
from cutjoint.toolchain.temporary import temporary_folder


class NotReachedError(RuntimeError):
    """The run or the search for the equilibrium failed; ``report`` says where."""

    def __init__(self, report: FailureReport) -> None:
        super().__init__(str(report))
        self.report = report


def linearise_at(
    artifact: Artifact, equations: ImplicitEquations, at: float | None, parameters: Mapping[str, float], progress: Progress | None
) -> tuple[float, Linearisation]:  # fmt: skip
    """The time and the linearisation at the static equilibrium, or ``at`` a time (s) of a run of the scene, computed by a simulator.

    ``equations`` are those of the same model and scene.

    Raises:
        NotReachedError: there is no equilibrium near the design position, or the run fails before.
        RunError: a parameter that cannot be set, or a locked coordinate has a constraint force at the equilibrium.
    """
    with temporary_folder() as folder:
        run_file = _run_file(artifact, at, parameters, folder)
        entries = {**run_file.entries(), "with_state": True}
        summary = call_simulator(artifact.binary.path, entries, progress, description=artifact.description)
    if (failure := failure_of(summary)) is not None:
        raise NotReachedError(failure)
    if at is None:
        require_free(equations.scene, read_locking_forces(summary))
    point = point_of(artifact, equations, run_file, summary["state"])
    return point.t, linearise(equations, point, at_rest=at is None)


def point_of(artifact: Artifact, equations: ImplicitEquations, run_file: RunFile, state: Mapping[str, Any]) -> Point:
    """The point at which to linearise, from the ``state`` in a summary."""
    sampled = zip(artifact.topology.model.discrete_states, state.get("discrete_states") or [], strict=False)
    held = {discrete_state_name(value): number for value, number in sampled if number is not None}
    return Point(
        t=state["t"], q=np.array(state["q"]), v=np.array(state["v"]), vdot=np.array(state["vdot"]),
        parameters=np.array([run_file.parameters[p.name] for p in equations.parameters]), held={**(run_file.inputs or {}), **held},
        roads={tyre: WheelRoad.of(**road, on_it=surface_of(artifact.scene.road)) for tyre, road in run_file.roads.items()},
    )  # fmt: skip


def _run_file(artifact: Artifact, at: float | None, parameters: Mapping[str, float], folder: Path) -> RunFile:
    model, scene, out = artifact.topology.model, artifact.scene, str(folder / "table.csv")
    if at is None:
        at_rest = replace(scene, pose="equilibrium")
        return make_run_file(model, at_rest, parameters, task="equilibrium", method=artifact.method, options=PLAIN_STEPS)
    if at:
        scene = _with_step_ending_at(scene, at)
    return make_run_file(model, replace(scene, end=at), parameters, task="simulate", method=artifact.method, options=PLAIN_STEPS, out=out,
                         fits_samples=False)  # fmt: skip


def _with_step_ending_at(scene: Scene, at: float) -> Scene:
    """The scene with a step that ends at ``at`` (s), and none longer than its own."""
    dt = scene.numerics.of_method(LINEARISED).step
    try:
        steps = count_steps(min(dt, at), at, at).number
    except StepsError as error:
        raise RunError(f"{scene.span}: scene '{scene.name}': {error}") from None
    return replace(with_settings(scene, LINEARISED, {"dt": at / steps}), output_step=at)


def require_free(scene: Scene, held: Mapping[str, tuple[float, str]]) -> None:
    """Check that no coordinate that the scene locks has a constraint force: the linear model would have no equilibrium."""
    if not held:
        return
    name, (force, unit) = max(held.items(), key=lambda item: abs(item[1][0]))
    raise RunError(
        f"{scene.span}: scene '{scene.name}': {force:.3g} {unit} hold '{name}', so that small motions have no "
        "equilibrium; leave its coordinate out of positions, guide its joint, or linearise about a motion with --at"
    )
