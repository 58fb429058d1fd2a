"""`cutjoint simulate --view`, which reads the model again, since a cached run knows its program alone.

A failed run is repeated with a sample at each of its steps: the last ones show how it failed.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cutjoint.commands.preparing import FinishedRun, read_request
from cutjoint.compile.derivation import with_requested_loops
from cutjoint.compile.prepared import Request
from cutjoint.methods import INTEGRATORS
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import Evaluator, parameter_values
from cutjoint.run.simulator import SimulatorError
from cutjoint.run.simulator_run import SimulatorRun, start
from cutjoint.view.mesh_files import require_meshes
from cutjoint.view.views import read_ghost, show_run, write_shown

#: Runs of more steps are not repeated for their last ones; an adaptive integrator gets this many samples.
_MOST_STEPS, _ROWS = 20_000, 400


def require_replay(request: Request, parameters: Mapping[str, float], view: Path | None, ghost: Path | None) -> None:
    """Check that the wanted view can be shown.

    Raises:
        ModelError: the model is wrong, or a mesh of it.
        RunError, OutputError: the file has an unknown ending, or the ghost's page or run is missing.
    """
    read_ghost(ghost, view)
    model, *_ = read_request(request)
    require_meshes(model, Evaluator(model, parameter_values(model, parameters)))


def write_replay(
    request: Request, ran: FinishedRun | None, view: Path, ghost: Path | None, parameters: Mapping[str, float], plan: SimulatorRun,
    run: Trajectory, display: tuple[str, ...] = (),
) -> Path:  # fmt: skip
    """Write a run as a page or a glTF file, over the run of an earlier page (``ghost``); a failed run with its last steps.

    ``ran`` is None for a cached run, whose model is read again. Raises ModelError, OutputError: the model has been changed meanwhile, or
    the file cannot be written.
    """
    ran = FinishedRun(*read_request(request), parameters) if ran is None else ran
    end = request.options.end
    scene = ran.scene if end is None else replace(ran.scene, end=end)
    steps = with_each_step(replace(plan, with_coordinates=True), run)
    model = with_requested_loops(ran.model, scene, ran.method)
    shown = show_run(model, scene, ran.method, ran.parameters, steps, variant=ran.variant)
    return write_shown(view, replace(shown, display=display), ghost=read_ghost(ghost, view))


def with_each_step(plan: SimulatorRun, run: Trajectory) -> Trajectory:
    """Repeat a failed run with a sample at each step; with an adaptive integrator, at 400 or more times at which steps end.

    The first run is returned if the second one does not fail, has fewer samples, or is not possible. Raises Interrupted, Terminated: a
    signal has ended the run.
    """
    failure, settings = run.failure, plan.run_file.settings
    if failure is None or not (0 < failure.step <= _MOST_STEPS and failure.time > 0):
        return run
    adaptive = INTEGRATORS[settings.integrator].adaptive
    dt = min(settings.dt, failure.time / _ROWS) if adaptive else failure.time / failure.step
    try:
        again = start(replace(plan, run_file=replace(plan.run_file.with_settings(dt=dt), output_step=dt)))
    except SimulatorError:
        return run
    return replace(again, failure=failure) if again.failure is not None and again.t.size > run.t.size else run
