"""A run of a compiled model: Binary -> Trajectory."""

from collections.abc import Mapping

from cutjoint.package.locations import AnyPath
from cutjoint.run.accuracy import run_accurately
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.failures import FailedRunError, describe_failure, describe_rest
from cutjoint.run.inputs import InputLike
from cutjoint.run.results import Trajectory
from cutjoint.run.settings import Options
from cutjoint.run.simulator import Progress


def simulate(
    artifact: Artifact, *, out: AnyPath | None = None, steps: AnyPath | None = None,
    parameters: Mapping[str, float] | None = None, progress: Progress | None = None, dt: float | None = None, end: float | None = None,
    penalty: float | None = None, tolerance: float | None = None, iterations: int | None = None, solver: str | None = None,
    integrator: str | None = None, events: str | None = None, error: bool = True, check: bool = True,
    inputs: Mapping[str, InputLike] | None = None, coordinates: bool = False, accuracy: float | Mapping[str, float] | None = None,
) -> Trajectory:  # fmt: skip
    """Run a compiled model; arguments and errors are those of `cutjoint.simulate`."""
    targets, accuracy = (accuracy, None) if isinstance(accuracy, Mapping) else ({}, accuracy)
    options = Options(dt=dt, end=end, penalty=penalty, tolerance=tolerance, iterations=iterations, solver=solver, integrator=integrator,
                      events=events, accuracy=accuracy, targets=targets, once=not error)  # fmt: skip
    plan = make_simulator_run(artifact, options, parameters, inputs=inputs, coordinates=coordinates)
    run = run_accurately(plan, out=out, steps=steps, progress=progress, estimate=error, advise=check)
    if check and run.failure is not None:
        held = {name: value for name, value in (inputs or {}).items() if not isinstance(value, Mapping)}
        where = describe_failure(run.failure, artifact.scene.name, artifact.places, artifact, {**(parameters or {}), **held})
        raise FailedRunError(f"{where}; {describe_rest(run.table)}", run)
    return run
