"""Runs against the wall clock: how long each step takes, and which ones miss their deadline."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cutjoint.methods import DEFAULT_INTEGRATOR, Implementation
from cutjoint.package.errors import RunError
from cutjoint.package.locations import AnyPath, path_of
from cutjoint.package.renamed import with_old_members
from cutjoint.run.failures import IncompleteError, describe_failure, describe_rest
from cutjoint.run.result_files import RunTables
from cutjoint.run.results import FailureReport, columns_of
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import ModelLike
from cutjoint.run.settings import Options
from cutjoint.run.simulator import call_simulator, failure_of
from cutjoint.tasks.batch import compile_unless_compiled
from cutjoint.toolchain.compiler import find_compiler


@with_old_members
@dataclass(frozen=True, kw_only=True)
class StepTimes:
    """Times of steps that were begun ``period`` (s) apart.

    ``durations`` (n,) is how long each lasted, ``lateness`` (n,) its end less the time at which the next was due, in s;
    negative where it was in time.  A run that failed has the steps up to then.
    ``table`` is the file that has the times, if there is one.
    """

    period: float
    durations: NDArray[np.float64]
    lateness: NDArray[np.float64]
    failure: FailureReport | None
    table: Path | None = None

    def __repr__(self) -> str:
        end = "" if self.failure is None else f"; failed: {self.failure.message}"
        return f"<StepTimes of {self.durations.size} steps each {self.period:g} s: {self.missed} missed{end}>"

    @property
    def missed(self) -> int:
        """The number of steps that ended after the next one was due."""
        return int(np.count_nonzero(self.lateness > 0))

    @property
    def stalls(self) -> int:
        """The number of runs of consecutive late steps: one long wait makes all steps late until the lost time is caught up."""
        late = self.lateness > 0
        return int(np.count_nonzero(late[1:] & ~late[:-1]) + np.count_nonzero(late[:1]))

    @property
    def wakeup_latency(self) -> NDArray[np.float64]:
        """Delay (n,), in s, of each step's start after the step was due and the previous one had ended."""
        begun: NDArray[np.float64] = self.lateness - self.durations + self.period
        before = np.concatenate([np.zeros(1), np.maximum(self.lateness[:-1], 0.0)])[: begun.size]
        woke: NDArray[np.float64] = np.maximum(begun - before, 0.0)
        return woke

    @property
    def missed_by_steps(self) -> int:
        """The number of late steps, without those that were late only because the operating system delayed a start."""
        missed, late = 0, 0.0
        for took in self.durations:
            late = max(late, 0.0) + took - self.period
            missed += late > 0
        return missed

    def percentile(self, share: float) -> float:
        """The time (s) in which ``share`` per cent of the steps ended."""
        return float(np.percentile(self.durations, share, method="higher"))


class FailedRealTimeError(IncompleteError):
    """A run against the wall clock that failed."""

    @property
    def times(self) -> StepTimes:
        """The steps up to then."""
        times: StepTimes = self.args[1]
        return times


def run_in_real_time(
    model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), dt: float | None = None, end: float | None = None,
    iterations: int | None = None, parameters: Mapping[str, float] | None = None, out: AnyPath | None = None, check: bool = True,
    priority: int | None = None, processor: int | None = None,
) -> StepTimes:  # fmt: skip
    """Run a scene by the trapezoidal rule, paced by the wall clock.

    Args:
        out: table with ``duration`` and ``lateness`` (s) of each step.
        iterations: fixed number in each step, of the method recursive.
        priority: 1 to 99, real-time priority of the operating system (SCHED_FIFO).
        processor: the processor to run on.
        check: raise an error if the run fails.

    Raises:
        RunError: a parameter that cannot be set, settings that no run has, steps that cannot be of fixed cost, or a priority or processor
            that the operating system refuses.
        SimulatorError: the simulator could not begin, or could not write a file.
        OutputError: a file cannot be written.
        Interrupted, Terminated: a signal has ended the run.
        FailedRealTimeError: the run failed; it has the times of the steps up to then.
    """
    artifact = compile_unless_compiled(model, scene, tunable)
    if artifact.implementation != Implementation.GENERATED:
        find_compiler()  # raises an error without a compiler
        raise RunError("real-time runs need generated code")
    options = Options(dt=dt, end=end, iterations=iterations, integrator=DEFAULT_INTEGRATOR)
    run_file = make_run_file(
        artifact.topology.model, artifact.scene, parameters or {}, task="realtime", method=artifact.method, options=options
    )
    with RunTables(None, out=path_of(out)) as tables:
        with _scheduled(priority, processor):
            summary = call_simulator(artifact.binary.path, {**run_file.entries(), **tables.places})
        _, columns = columns_of(tables.rows(3), ("duration", "lateness"), summary.get("rows", 0))
        failure = failure_of(summary)
        if failure is not None and failure.message.startswith("the fixed point did not converge"):
            failure = replace(failure, advice=f"{failure.advice}; or --iterations 6, a fixed number in each step, converged or not")
        table = tables.finish(summary.get("bytes")) if failure is None else tables.leave(str(failure))
    times = StepTimes(
        period=run_file.settings.dt, durations=columns["duration"], lateness=columns["lateness"], failure=failure, table=table
    )  # fmt: skip
    if check and failure is not None:
        where = describe_failure(failure, artifact.scene.name, artifact.places, artifact, parameters or {})
        raise FailedRealTimeError(f"{where}; {describe_rest(table)}", times)
    return times


@contextmanager
def _scheduled(priority: int | None, processor: int | None) -> Iterator[None]:
    """Context that gives processes started by this thread a priority and a processor."""
    if (priority is not None or processor is not None) and not hasattr(os, "sched_setscheduler"):
        raise RunError("--priority and --processor: not supported on this operating system; set them outside")
    with ExitStack() as before:
        if processor is not None:
            before.callback(os.sched_setaffinity, 0, os.sched_getaffinity(0))
            fault = f"--processor {processor}: there is no such processor, or this process may not use it"
            _ask(fault, os.sched_setaffinity, 0, {processor})
        if priority is not None:
            usual = os.sched_getscheduler(0), os.sched_getparam(0)
            fault = f"--priority {priority}: this user has no right to it; 'ulimit -r' says the largest, an administrator raises it"
            _ask(fault, os.sched_setscheduler, 0, os.SCHED_FIFO, os.sched_param(priority))
            before.callback(os.sched_setscheduler, 0, *usual)
        yield


def _ask(fault: str, request: Callable[..., None], *arguments: object) -> None:
    try:
        request(*arguments)
    except (OSError, ValueError):
        raise RunError(fault) from None
