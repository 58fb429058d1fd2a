"""Sweeps in figures: the cost of a run beside its own work, throughput beside the cores' sum, and the share of a cluster's scheduler.

    python -m cutjoint_bench.studies.sweep [--share 0.1] [--only overhead|lanes|throughput|tasks]

``--share`` is that of the runs: 1 for 1e6 of a pendulum, 1e5 of a press and 1e4 of the Iltis.  Beside elapsed times stand processor times
of client, scheduler and workers together, which other work on the machine does not change much.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time, thread_time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from cutjoint.package.system import processors
from cutjoint.sweeps.cluster import dask
from cutjoint.sweeps.code import build_kernels
from cutjoint.sweeps.parts import Parts
from cutjoint.sweeps.reading import read_study_text
from cutjoint.sweeps.records import Study
from cutjoint.sweeps.run import Sweep, make_manifest, perform_study
from cutjoint.sweeps.table import Layout
from cutjoint.sweeps.work import Chunk, Work
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.clusters import QUIET, local_cluster, process_cluster
from cutjoint_bench.studies.provenance import provenance

#: A pendulum for a hundredth of a second: ten steps.
PENDULUM = """
cutjoint_study: 1
model: {models}/pendulum.yaml
integrator: trapezoidal
end: 10 ms
output_step: 10 ms
rates: {{pin.angle_rate: {{from: -5, to: 5}}}}
design: {{sobol: {runs}}}
objectives: {{last: {{end: bob.x}}, speed: {{rms: bob.vx}}}}
"""

#: A press for two seconds.
PRESS = """
cutjoint_study: 1
model: {models}/press.yaml
integrator: trapezoidal
parameters: {{stiffness: {{from: 1 kN/m, to: 4 kN/m}}}}
rates: {{pin.angle_rate: {{from: 5, to: 10}}}}
design: {{sobol: {runs}}}
objectives: {{top: {{maximum: slider.x}}, speed: {{rms: slider.vx}}, load: {{percentile: abs(spring.force), at: 95}}}}
"""

#: The Iltis for ten seconds over the road of simul1, with its own outputs.
ILTIS = """
cutjoint_study: 1
model: {models}/iltis.yaml
scenes: [simul1]
parameters: {{tyre_stiffness: {{from: 400 kN/m, to: 480 kN/m}}}}
dt: 7.5 ms
design: {{sobol: {runs}}}
objectives: {{ride: {{rms: chassis.vz}}, low: {{minimum: chassis.z}}, high: {{maximum: chassis.z}}}}
"""


#: Studies and how many runs they have.
STUDIES = {"press": (PRESS, 10**5), "Iltis, simul1": (ILTIS, 10**4)}


def text_of(text: str, runs: int) -> str:
    """The file of a study of so many runs."""
    return text.format(models=MODELS, runs=runs)


def read(text: str, runs: int) -> Study:
    """A study of so many runs."""
    return read_study_text(text_of(text, runs), "study")


@dataclass(frozen=True, kw_only=True)
class Performed:
    """A sweep, and the seconds that it took without its compiling: elapsed, and of processors by the kind of process."""

    sweep: Sweep
    elapsed: float
    used: Mapping[str, float]

    @property
    def processors(self) -> float:
        """Seconds of processors, of all processes."""
        return sum(self.used.values())


def perform(study: Study, folder: Path, **how: Any) -> Performed:
    """Make the runs of a study."""
    began, used = perf_counter(), process_time()
    build_kernels(study)
    built, own = perf_counter() - began, process_time() - used
    before, begin = processor_seconds(how.get("scheduler")), perf_counter()
    done = perform_study(study, folder / f"{len(list(folder.iterdir()))}.parquet", **how)
    elapsed, after = perf_counter() - begin - built, processor_seconds(how.get("scheduler"))
    return Performed(sweep=done, elapsed=elapsed, used={k: after[k] - before[k] - (own if k == "client" else 0.0) for k in after})


def processor_seconds(scheduler: str | None) -> dict[str, float]:
    """Seconds of processors so far: of this process, and of a cluster's other processes by their kind."""
    used = {"client": process_time()}
    if scheduler is not None:
        with dask().Client(scheduler, set_as_default=False) as client:
            found = {kind: client.run(_process_and_seconds, nanny=kind == "nannies").values() for kind in ("workers", "nannies")}
            found["scheduler"] = [client.run_on_scheduler(_process_and_seconds)]
        for kind, processes in found.items():  # of a LocalCluster nannies and scheduler are in this process
            used[kind] = sum(seconds for process, seconds in processes if process != os.getpid())
    return used


def _process_and_seconds() -> tuple[int, float]:
    return os.getpid(), process_time()


def library_seconds(study: Study, runs: int) -> float:
    """Processor seconds of a run in one thread: of the library alone."""
    kernel, = build_kernels(study)
    values = study.values[:runs]
    kernel.run(values[:2])
    return float(median(_seconds(lambda: kernel.run(values), thread_time) for _ in range(5)) / len(values))


def _seconds(call: Callable[[], object], clock: Callable[[], float] = perf_counter) -> float:
    begin = clock()
    call()
    return clock() - begin


def measure_overhead(console: Console, folder: Path, share: float) -> None:
    """Costs of a run of microseconds, from a thousand runs to a million."""
    perform(read(PENDULUM, 100), folder, threads=1)  # imports what it needs
    table = Table("runs", "a run of the library, us", "of a sweep in one thread, us", "the difference, us", title="A pendulum, ten steps")
    for runs in (10**3, 10**4, 10**5, 10**6):
        study = read(PENDULUM, max(100, int(runs * share)))
        alone, each = library_seconds(study, 2000), perform(study, folder, threads=1).processors / study.runs
        table.add_row(f"{study.runs}", *(f"{1e6 * x:.2f}" for x in (alone, each, each - alone)))
    console.print(table)


def measure_lanes(console: Console) -> None:
    """Processor time of a run one by one, in lanes, and of `batch`, in turns in one thread.
    Also how far rows in lanes are from the others."""
    table = Table("study", "way", "processor ms a run", "times one by one", "farthest, share of the largest", title="Lanes")
    for name, text, runs in (("press", PRESS, 512), ("Iltis, simul1", ILTIS, 64)):
        study = read(text, runs)
        (one,), (many,) = (build_kernels(study, lanes=lanes) for lanes in (False, True))
        batch, cases = compile_scene_batch(study.model, study.scenes[0]), cases_of(study, runs)
        ways: dict[str, tuple[Callable[[], object], Callable[[], float]]] = {
            "one by one": (lambda: one.run(study.values), thread_time), "in lanes": (lambda: many.run(study.values), thread_time),  # noqa: B023
            "batch": (lambda: simulate_batch(batch, cases, threads=1, check=False), process_time),  # noqa: B023
        }  # fmt: skip
        a, b = one.run(study.values).series, many.run(study.values).series
        far = {"in lanes": f"{float((np.abs(a - b).max(axis=(0, 2)) / np.abs(a).max(axis=(0, 2))).max()):.0e}"}
        taken: dict[str, list[float]] = {way: [] for way in ways}
        for _ in range(5):
            for way, (call, clock) in ways.items():
                taken[way].append(_seconds(call, clock) / runs)
        for way, seconds in taken.items():
            each = median(seconds)
            table.add_row(name, way, f"{1e3 * each:.3g}", f"{median(taken['one by one']) / each:.2f}", far.get(way, ""))
    console.print(table)


def cases_of(study: Study, runs: int) -> list[dict[str, float]]:
    """The parameters of runs, as a batch takes them."""
    held = [v.name for v in study.variables if v.kind == "parameter"]
    return [{name: study.settings_of(i)[name] for name in held} for i in range(min(study.runs, runs))]


def measure_throughput(console: Console, folder: Path, share: float) -> None:
    """Runs a second by all ways, beside the cores' sum: as many times a core's own work as there are cores.

    What the library takes alone is measured before and after each way.
    """
    cores = processors()
    shares = f"of {cores} cores' sum", "processor ms a run", "the library's", "share"
    table = Table("study", "way", "runs", "runs/s", *shares, "seconds of", "file", title="Throughput")
    for name, (text, runs) in STUDIES.items():
        study = read(text, max(20, int(runs * share)))
        some = 512 if name == "press" else 64
        for way, start in _ways(cores).items():
            before = library_seconds(study, some)
            with start() as how:
                done, number = perform(study, folder, **how), 1 if way == "one thread" else cores
            alone = (before + library_seconds(study, some)) / 2
            parts = (f"{100 * alone * study.runs / x:.0f} %" for x in (number * done.elapsed, done.processors))
            each = f"{1e3 * done.processors / study.runs:.3g}"
            digest = sha256(done.sweep.path.read_bytes()).hexdigest()[:8]
            used = ", ".join(f"{kind} {seconds:.2f}" for kind, seconds in done.used.items() if seconds)
            rate, lone = f"{study.runs / done.elapsed:.4g}", f"{1e3 * alone:.3g}"
            table.add_row(name, way, str(study.runs), rate, next(parts), each, lone, next(parts), used, digest)
        batch, seconds = compile_scene_batch(study.model, study.scenes[0]), []
        cases = cases_of(study, 256)
        for _ in range(3):
            seconds.append(_seconds(lambda: simulate_batch(batch, cases, threads=cores, check=False), process_time))  # noqa: B023
        lanes = 1e3 * median(seconds) / len(cases)
        table.add_row(name, "batch, eight lanes", str(len(cases)), "", "", f"{lanes:.3g}", "", "", "", "")
    console.print(table)


def _ways(cores: int) -> dict[str, Callable[[], AbstractContextManager[dict[str, Any]]]]:
    """Contexts that start the workers of each way, and give the arguments of a sweep; only one cluster is there at a time."""
    ways: dict[str, Callable[[], AbstractContextManager[dict[str, Any]]]] = {
        "one thread": lambda: nullcontext({"threads": 1}), f"{cores} threads": lambda: nullcontext({"threads": cores})
    }  # fmt: skip
    for kind, settings in (("", {}), (", quiet", QUIET)):
        ways[f"LocalCluster{kind}"] = partial(_addressed, local_cluster, cores, settings)
        ways[f"dask scheduler, dask worker{kind}"] = partial(_addressed, process_cluster, cores, settings)
    return ways


@contextmanager
def _addressed(start: Callable[..., AbstractContextManager[str]], *how: Any) -> Iterator[dict[str, Any]]:
    with start(*how) as address:
        yield {"scheduler": address}


def measure_tasks(console: Console, folder: Path) -> None:
    """Costs of a task of a scheduler, with a chunk's values and rows."""
    distributed = dask()
    table = Table("bytes there and back", "tasks/s", title="Tasks of nothing, one scheduler")
    local = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0")
    with local as cluster, distributed.Client(cluster) as client:
        for size in (1_000, 100_000):
            data = np.zeros(size // 8)
            client.gather([client.submit(_same, data, pure=False) for _ in range(50)])
            elapsed = _seconds(lambda: client.gather([client.submit(_same, data, pure=False) for _ in range(1000)]))  # noqa: B023
            table.add_row(str(size), f"{1000 / elapsed:.0f}")
    console.print(table)
    study = read(PRESS, 1000)
    kernels = build_kernels(study)
    work = Work(kernels=kernels, has_scenes=False, objectives=study.objectives, trajectories=(), every=1)
    parts = Parts(folder / "parts.parquet", Layout(study=study, manifest=make_manifest(study, kernels)), print)
    rows = work.perform(Chunk(first=0, values=study.values[:250]))
    each = median(_seconds(lambda: parts.write(rows)) for _ in range(200))
    parts.close()
    sizes = ", ".join(f"{k.scene} {len(k.content) / 1e3:.0f} kB" for k in kernels)
    console.print(f"a chunk of 250 runs written: {1e3 * each:.2f} ms; the library of the press, {sizes}")


def _same(data: Any) -> Any:
    return data


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--only", choices=("overhead", "lanes", "throughput", "tasks"))
    asked = parser.parse_args()
    console = Console(highlight=False, width=200)
    console.print(provenance(), markup=False)
    with TemporaryDirectory() as place:
        folder = Path(place)
        if asked.only in (None, "overhead"):
            measure_overhead(console, folder, asked.share)
        if asked.only in (None, "lanes"):
            measure_lanes(console)
        if asked.only in (None, "throughput"):
            measure_throughput(console, folder, asked.share)
        if asked.only in (None, "tasks"):
            measure_tasks(console, folder)


if __name__ == "__main__":
    main()
