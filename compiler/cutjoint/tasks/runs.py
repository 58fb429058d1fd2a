"""A run from Python, of a compiled model or of one that is compiled for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from warnings import warn

from cutjoint.compile.pipeline import take_artifact
from cutjoint.package.locations import AnyPath
from cutjoint.run import simulation
from cutjoint.run.given import Given
from cutjoint.run.inputs import GivenInput
from cutjoint.run.results import Trajectory
from cutjoint.run.simulator import Progress


def simulate(
    model: Given, *, scene: str | None = None, opened: Sequence[str] = (), method: str | None = None, out: AnyPath | None = None,
    steps: AnyPath | None = None, tangents: AnyPath | None = None, parameters: Mapping[str, float] | None = None,
    progress: Progress | None = None, dt: float | None = None, end: float | None = None, penalty: float | None = None,
    accuracy: float | None = None, solver_tolerance: float | None = None, iterations: int | None = None, solver: str | None = None,
    integrator: str | None = None, events: str | None = None, error: bool = True, check: bool = True,
    inputs: Mapping[str, GivenInput] | None = None, coordinates: bool = False, tolerance: float | None = None,
) -> Trajectory:  # fmt: skip
    """Run a scene of a model with ``parameters`` (SI units); what `compile_model` has not made is compiled by it, with numbers ``opened``
    and a ``method``, by default the scene's.  ``accuracy`` (m, rad) and the other settings from ``dt`` on are those of `Options`, by
    default the scene's; ``solver_tolerance`` is the tolerance there, and ``tolerance`` its earlier name.

    ``inputs`` drive the run instead of the scene's laws, as `run.inputs` has them.  ``out`` receives the table, ``steps`` a CSV file with
    iterations and residuals of each step, ``tangents`` a line of JSON for each row, the Jacobians of the accelerations.  With ``error`` the
    run keeps the accuracy and has an ``error``; with ``coordinates`` it has those of each row, by which `write_view` draws it.
    Without ``check`` a run that fails is returned with its failure.

    Raises:
        ModelError, EquationsError, ToolchainError: as of `compile_model`.
        RunError: a parameter or an input that cannot be set, or settings that no run has or that do not go together.
        SimulatorError, OutputError: the simulator could not begin, or a file cannot be written.
        FailedRunError, Interrupted, Terminated: the run failed (the error has its trajectory), or a signal has ended it.
    """
    if tolerance is not None:
        warn("simulate(tolerance=...) is now simulate(solver_tolerance=...)", FutureWarning, stacklevel=2)
    asked = tolerance if solver_tolerance is None else solver_tolerance
    return simulation.simulate(
        take_artifact(model, scene, opened, method), out=out, steps=steps, tangents=tangents, parameters=parameters, progress=progress,
        dt=dt, end=end, penalty=penalty, accuracy=accuracy, tolerance=asked, iterations=iterations, solver=solver, integrator=integrator,
        events=events, error=error, check=check, inputs=inputs, coordinates=coordinates,
    )  # fmt: skip
