"""The work of workers: chunks of runs, from values to rows, and workers that are threads of this process.

A worker needs this module, the libraries and NumPy, but no compiler.  The libraries' code runs without Python's lock.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from queue import Empty, Queue
from time import perf_counter

import numpy as np

from cutjoint.package.errors import CutjointError
from cutjoint.sweeps.kernel import Kernel, KernelResults
from cutjoint.sweeps.objectives import reduce_series
from cutjoint.sweeps.records import Array, Counts, Objective

#: The largest size of series in a worker's memory, bytes, unless one run, or those in lanes, need more.
_HELD = 32_000_000


def in_lanes(runs: int, lanes: int) -> int:
    """The number of runs, increased so that all lanes are used."""
    return -(-runs // lanes) * lanes


@dataclass(frozen=True, kw_only=True)
class Chunk:
    """Runs from the number ``first`` on, with their ``values`` (runs, variables).
    ``faults`` are reasons, by places, why runs cannot begin."""

    first: int
    values: Array
    faults: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Rows:
    """The results of a chunk.

    ``objectives`` (runs, objectives) are NaN for none; ``failures`` and ``times`` (s) tell why and when runs failed.  ``trajectories`` have
    the values run by run, ``lengths`` how many each run has (runs,); ``seconds`` of work.
    """

    first: int
    values: Array
    objectives: Array
    failures: Sequence[str | None]
    times: Array
    trajectories: Sequence[Array]
    lengths: Counts
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Work:
    """The work on each run of a study.

    A run's library is chosen by the number of the scene, the first of its values where ``has_scenes``.  ``objectives`` and ``trajectories``
    are made of its series.  ``tasks`` gives the objectives of other tasks, by their places, of a scene's number and values (variables,),
    ``starts`` what a trim adds to these.
    """

    kernels: tuple[Kernel, ...]
    has_scenes: bool
    objectives: tuple[Objective, ...]
    trajectories: tuple[int, ...]
    every: int
    tasks: Callable[[int, Array], Mapping[int, float]] | None = None
    starts: Callable[[int, Array], Array] | None = None

    def perform(self, chunk: Chunk) -> Rows:
        """The rows of a chunk. Raises OSError: a library cannot be loaded here."""
        begin, values, runs = perf_counter(), chunk.values, len(chunk.values)
        scenes = values[:, 0].astype(int) if self.has_scenes else np.zeros(runs, dtype=int)
        objectives, times = np.full((runs, len(self.objectives)), np.nan), np.full(runs, np.nan)
        failures: list[str | None] = [chunk.faults.get(run) for run in range(runs)]
        times[list(chunk.faults)] = 0.0
        begins = np.array([failure is None for failure in failures])
        longest = max((len(self._kept_rows(kernel)) for kernel in self.kernels), default=0)
        shown, lengths = np.full((len(self.trajectories), runs, longest), np.nan), np.zeros(runs, dtype=np.int64)
        begun = list(values)
        if self.tasks is not None or self.starts is not None:
            for run in np.flatnonzero(begins).tolist():
                try:
                    found = self.tasks(int(scenes[run]), values[run]) if self.tasks is not None else {}
                    objectives[run, list(found)] = list(found.values())
                    begun[run] = values[run] if self.starts is None else self.starts(int(scenes[run]), values[run])
                except (CutjointError, ValueError, np.linalg.LinAlgError) as error:
                    failures[run] = " ".join(str(error).split())
        begins = np.array([failure is None for failure in failures])
        for number in np.unique(scenes[begins]) if self.kernels else ():
            kernel, places = self.kernels[number], np.flatnonzero(begins & (scenes == number))
            for at in np.split(places, range(self._runs_per_chunk(kernel), len(places), self._runs_per_chunk(kernel))):
                left = kernel.run(np.array([begun[run] for run in at]))
                self._reduce(kernel, left, objectives, at)
                times[at] = left.times
                for run, failure in left.failures.items():
                    failures[at[run]] = failure
                if self.trajectories:
                    rows = self._kept_rows(kernel)
                    shown[:, at, : len(rows)] = left.series[:, self.trajectories][:, :, rows].transpose(1, 0, 2)
                    lengths[at] = np.searchsorted(rows, left.reached)
        there = np.arange(longest) < lengths[:, np.newaxis]
        return Rows(
            first=chunk.first, values=values, objectives=objectives, failures=failures, times=times,
            trajectories=[values[there] for values in shown], lengths=lengths, seconds=perf_counter() - begin,
        )  # fmt: skip

    def _runs_per_chunk(self, kernel: Kernel) -> int:
        together = 8 * kernel.rows * max(1, kernel.series) * kernel.lanes
        return max(1, _HELD // together) * kernel.lanes

    def _reduce(self, kernel: Kernel, left: KernelResults, objectives: Array, at: Counts) -> None:
        done = [run for run in range(len(at)) if run not in left.failures] if left.failures else slice(None)
        for j, objective in ((j, o) for j, o in enumerate(self.objectives) if o.asked is None):
            objectives[at[done], j] = reduce_series(objective, left.series[done, objective.series], kernel.times, kernel.row_step)

    def _kept_rows(self, kernel: Kernel) -> Counts:
        """The rows of a trajectory that are stored: every n-th and the last."""
        rows: Counts = np.unique([*range(0, kernel.rows, self.every), kernel.rows - 1])
        return rows


class Threads:
    """Threads of this process."""

    def __init__(self, work: Work, number: int) -> None:
        self.number = number
        self._work, self._done = work, Queue[Future[Rows]]()
        self._pool = ThreadPoolExecutor(number)

    def submit(self, chunk: Chunk) -> None:
        """Begin to perform a chunk."""
        self._pool.submit(self._work.perform, chunk).add_done_callback(self._done.put)

    def take(self, seconds: float) -> Rows | None:
        """The rows of a completed chunk; None if there is none in this time."""
        try:
            return self._done.get(timeout=seconds).result()
        except Empty:
            return None

    def close(self) -> None:
        """Start no more chunks, and wait for those that are running."""
        self._pool.shutdown(cancel_futures=True)
