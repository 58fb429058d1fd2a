"""Sweeps from end to end: read this first.

    study.yaml -> Study -> libraries -> chunks -> parts -> table

The manifest tells the origin of a table in plain data: digests, versions, design.  No date, host or folder is in it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from hashlib import sha256
from importlib.metadata import version
from itertools import islice
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import Any, cast

import numpy as np

from cutjoint.package.errors import RunError
from cutjoint.package.locations import AnyPath, __version__
from cutjoint.package.system import processors
from cutjoint.run.settings import StepSettings, require_settings
from cutjoint.run.stopping import StopRequest, stop_requests
from cutjoint.sweeps.cluster import Cluster, require_address, require_scheduler
from cutjoint.sweeps.code import build_kernels
from cutjoint.sweeps.designs import Indices, Masses, Tolerance, find_indices, find_tolerance
from cutjoint.sweeps.kernel import Kernel, find_target
from cutjoint.sweeps.parts import Parts, count_runs, missing
from cutjoint.sweeps.reading import read_study, read_study_text
from cutjoint.sweeps.records import Kind, Study
from cutjoint.sweeps.table import MANIFEST, Layout, arrow, is_whole, require_file, require_room
from cutjoint.sweeps.tasks import Tasks, find_trimmed_start
from cutjoint.sweeps.work import Chunk, Threads, Work, in_lanes

#: Seconds of work that a chunk has, if there are runs enough: at least, and usually.  By Dask a chunk costs 10 to 20 ms besides.
LEAST_WORK, USUAL_WORK = 0.1, 1.0

#: Chunks a second that a scheduler and one client are given, usually and towards the end; with more workers chunks are larger.
_USUAL_RATE, _LAST_RATE = 64, 256

#: Seconds of work after which the duration of a run is known.
_ENOUGH = 0.02

#: The largest size of a chunk's rows, bytes, unless one run has more.
_MOST_BYTES = 32_000_000

#: Called with the number of completed runs and that of all runs.
Progress = Callable[[int, int], None]
#: The version of the table format; it changes if columns or their meaning change.
FORMAT = 2


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Table of a sweep: ``sweep["objective"]`` is a column (runs,) in SI units, or a list of trajectories.

    ``seconds`` is the work of all workers in this call, ``performed`` the number of runs that it made.
    """

    path: Path
    performed: int
    seconds: float
    elapsed: float

    @cached_property
    def table(self) -> Any:
        """The whole table, PyArrow's."""
        return arrow().parquet.read_table(self.path)

    @property
    def units(self) -> dict[str, str]:
        """Units of the columns that have one."""
        fields = [(f.name, f.metadata or {}) for f in self.table.schema]
        return {name: data[b"unit"].decode() for name, data in fields if b"unit" in data}

    @property
    def manifest(self) -> dict[str, Any]:
        """Origin of the table: digests, versions, design."""
        return cast(dict[str, Any], json.loads(self.table.schema.metadata[MANIFEST]))

    @property
    def failures(self) -> list[str | None]:
        """Reason of each run's failure, or None."""
        return cast(list[str | None], self.table["failure"].to_pylist())

    def find_indices(self, objective: str) -> Indices:
        """Sobol' indices of an objective; needs the design `sobol_indices`.

        Raises:
            RunError: the design is another one, or too few runs ended.
        """
        return find_indices(self, objective)

    def find_tolerance(self, objective: str, limits: tuple[float, float] | None = None) -> Tolerance:
        """Distribution of an objective, by Monte Carlo and by first order; needs the design `tolerances`.

        Raises:
            RunError: the design is another one, or too few runs ended.
        """
        return find_tolerance(self, objective, limits)

    def __getitem__(self, name: str) -> Any:
        column = self.table[name]
        if not arrow().types.is_list(column.type):
            return column.to_numpy()
        return [np.asarray(values) for values in column.to_pylist()]

    def __repr__(self) -> str:
        return f"<Sweep of {self.table.num_rows} runs: {', '.join(self.table.column_names)}>"


def sweep(
    study: AnyPath | Mapping[str, Any], out: AnyPath, *, scheduler: str | None = None, threads: int | None = None,
    progress: Progress | None = None, note: Callable[[str], None] | None = None,
) -> Sweep:  # fmt: skip
    """Make all runs of a study, a file or a mapping, and write their table; an interrupted call continues.

    Args:
        threads: default: all processors.
        scheduler: address of a Dask scheduler, such as "tcp://10.0.0.1:8786".
        note: is called with messages of progress.

    Raises:
        ModelError, EquationsError, RunError: the study or its model is wrong, or the cluster cannot run it.
        ToolchainError: the C++ side failed.
        OutputError: the table cannot be written, or rows of another sweep are in its place.
        Interrupted, Terminated: a signal has ended the sweep; the runs that are done stay.
    """
    require_settings(threads=threads)
    if threads is not None and scheduler is not None:
        raise RunError("threads are those of this process; the workers of a scheduler have their own")
    read = read_study_text(json.dumps(dict(study)), "study") if isinstance(study, Mapping) else read_study(study)
    return perform_study(read, Path(out), scheduler=scheduler, threads=threads, progress=progress, note=note)


def perform_study(
    study: Study, out: Path, *, scheduler: str | None = None, threads: int | None = None, progress: Progress | None = None,
    note: Callable[[str], None] | None = None,
) -> Sweep:  # fmt: skip
    """Perform a study that has been read."""
    arrow()
    has_tasks = any(o.asked is not None for o in study.objectives)
    if scheduler is not None:
        if has_tasks:
            raise RunError("tasks other than runs are done on this machine: leave out the scheduler, or their objectives")
        require_address(scheduler)
    require_file(out)
    require_room(Layout(study=study, manifest={}), out)
    if scheduler is not None:
        require_scheduler(scheduler)
    kernels = build_kernels(study)
    starts = partial(find_trimmed_start, study, kernels) if any(kernel.starts for kernel in kernels) else None
    if scheduler is not None and starts is not None:
        raise RunError("starts of runs are trimmed on this machine: leave out the scheduler")
    work = Work(
        kernels=kernels, has_scenes=any(v.kind is Kind.SCENE for v in study.variables), objectives=study.objectives,
        trajectories=study.trajectories, every=study.every, tasks=Tasks(study).find if has_tasks else None, starts=starts,
    )  # fmt: skip
    return make_table(study, work, make_manifest(study, kernels), out, scheduler, threads, progress, note)


def make_table(
    study: Study, work: Work, manifest: Mapping[str, Any], out: Path, scheduler: str | None, threads: int | None, progress: Progress | None,
    note: Callable[[str], None] | None,
) -> Sweep:  # fmt: skip
    """Do the work on all runs of a study, here or by a cluster, and write the table; what is done already stays."""
    say, begin, layout = note or (lambda text: None), perf_counter(), Layout(study=study, manifest=manifest)
    if is_whole(out, layout):
        return Sweep(path=out, performed=0, seconds=0.0, elapsed=perf_counter() - begin)
    if out.exists():
        say(f"{out} is no table of this sweep, or a damaged one: it is replaced when all rows are there")
    with ExitStack() as stack:
        parts = Parts(out, layout, say)
        stack.callback(parts.close)
        request = stack.enter_context(stop_requests())
        done = parts.ranges()
        if done:
            say(f"{count_runs(done)} of {study.runs} runs are in {parts.folder}: continuing")
        workers = _workers(work, scheduler, threads, say)
        stack.callback(workers.close)
        driver = _Driver(study, work, parts, workers, layout.row_bytes, progress)
        driver.perform(missing(done, study.runs), request)
        if lost := parts.finish():
            say(f"{count_runs(lost)} completed runs are missing from {parts.folder}: repeating them")
            driver.perform(lost, request)
            if lost := parts.finish():
                raise parts.incomplete(lost)
    return Sweep(path=out, performed=driver.performed, seconds=driver.seconds, elapsed=perf_counter() - begin)


def _workers(work: Work, scheduler: str | None, threads: int | None, say: Callable[[str], None]) -> Threads | Cluster:
    if scheduler is None:
        return Threads(work, threads or processors())
    cluster = Cluster(work, scheduler, say)
    say(f"{cluster.number} threads of workers at {scheduler}; Dask's dashboard: {cluster.dashboard}")
    return cluster


@dataclass
class _Driver:
    """Cuts runs into chunks, has them performed and writes their rows."""

    study: Study
    work: Work
    parts: Parts
    workers: Threads | Cluster
    row_bytes: int
    progress: Progress | None
    performed: int = 0
    seconds: float = 0.0
    _largest: int = field(default=1, init=False)

    def perform(self, ranges: list[tuple[int, int]], request: StopRequest) -> None:
        """Make the runs of all ranges; the end of each is excluded."""
        left = count_runs(ranges)
        waiting, done, chunks = 0, self.study.runs - left, self._chunks(ranges)
        try:
            while done < self.study.runs:
                # each worker has the next chunk too, or a few chunks measure how long a run takes
                most = 2 * self.workers.number if self._is_known() else min(4, 2 * self.workers.number)
                for chunk in islice(chunks, max(0, most - waiting)):
                    self.workers.submit(chunk)
                    waiting += 1
                if request.number is not None:
                    raise request.error("interrupted")
                if (rows := self.workers.take(1.0)) is not None:
                    runs, self.seconds = len(rows.values), self.seconds + rows.seconds
                    waiting, done, self.performed, self._largest = waiting - 1, done + runs, self.performed + runs, max(self._largest, runs)
                    self.parts.write(rows)
                    if self.progress is not None:
                        self.progress(done, self.study.runs)
        except BaseException as error:
            error.add_note(f"{done} of {self.study.runs} runs are in {self.parts.folder}; repeat the call to continue")
            raise

    def _chunks(self, ranges: list[tuple[int, int]]) -> Iterator[Chunk]:
        """The runs in order, in chunks of similar work as far as durations are known."""
        left, masses = count_runs(ranges), Masses(self.study)
        for first, last in ranges:
            while first < last:
                number = min(last - first, self._size(left))
                values = np.ascontiguousarray(self.study.values[first : first + number])
                yield Chunk(first=first, values=values, faults=masses.faults(values))
                first, left = first + number, left - number

    def _is_known(self) -> bool:
        return self.seconds >= _ENOUGH

    def _size(self, left: int) -> int:
        """The number of runs in the next chunk, so that no lane is empty.

        Towards the end chunks are smaller, so that all workers end at about the same time.
        """
        lanes = max((kernel.lanes for kernel in self.work.kernels), default=1)
        if not self.performed:
            return lanes
        most = max(1, min(self.study.runs if self._is_known() else 16 * self._largest, _MOST_BYTES // self.row_bytes))
        each, workers = self.seconds / self.performed, self.workers.number
        usual, least = max(USUAL_WORK, workers / _USUAL_RATE), max(LEAST_WORK, workers / _LAST_RATE)
        work = max(least, min(usual, each * left / (2 * workers)))
        return in_lanes(max(1, min(most, ceil(work / each))), lanes)


def make_manifest(study: Study, kernels: Sequence[Kernel]) -> dict[str, Any]:
    """The manifest of a study's table; rows that have the same one are the same, bit by bit."""
    target = kernels[0].target if kernels else find_target(study.flags)
    return {
        "format": FORMAT, "cutjoint": __version__, "name": study.model.name,
        "model": sha256(study.model.content.encode()).hexdigest(), "study": study.digest,
        "source": {kernel.scene: kernel.source for kernel in kernels}, "library": {kernel.scene: kernel.digest for kernel in kernels},
        "method": study.method, **{each.name: {k.scene: getattr(k.steps, each.name) for k in kernels} for each in fields(StepSettings)},
        "lanes": {kernel.scene: kernel.lanes for kernel in kernels}, "compiler": target.compiler, "flags": list(target.flags),
        "processor": [target.machine, *target.features], "design": json.loads(json.dumps(study.design)), "runs": study.runs,
        "versions": {name: version(name) for name in ("numpy", "pyarrow")},
    }  # fmt: skip


def steps_of(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Describe the steps of each scene's runs."""
    steps = {scene: StepSettings(**{f.name: manifest[f.name][scene] for f in fields(StepSettings)}) for scene in manifest["lanes"]}
    return {scene: f"{how}, runs {'one by one' if manifest['lanes'][scene] == 1 else 'in lanes'}" for scene, how in steps.items()}
