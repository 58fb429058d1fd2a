"""A failed run once more, with a row for each of its steps: its last rows show the way to the failure."""

from __future__ import annotations

from dataclasses import replace

from cutjoint.methods import INTEGRATORS
from cutjoint.run.results import Trajectory
from cutjoint.run.simulator import SimulatorError
from cutjoint.run.simulator_run import SimulatorRun, start

#: Runs of more steps are not repeated for their last ones; an adaptive integrator gets so many rows.
_MOST_STEPS, _ROWS = 20_000, 400


def with_each_step(plan: SimulatorRun, run: Trajectory) -> Trajectory:
    """A failed run of a plan, with a row for each step, of an adaptive integrator 400 rows or more, at which its steps end.

    The first run is returned where the second one does not fail, has fewer rows, or cannot be had.

    Raises:
        Interrupted, Terminated: a signal has ended the run.
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
