"""A check that a sweep has equal bytes whoever runs it and whoever dies meanwhile.

    python -m cutjoint_bench.studies.kills [--share 0.1] [--only press] [--out kills.json]

1e5 runs of a press and 1e4 of the Iltis (times ``--share``) by one thread, by the threads of one process, by `LocalCluster`, by
`dask scheduler` and two `dask worker`, and by these while SIGKILL ends a worker, the client and the scheduler, each of which is started
again.  ``--out`` is a file (JSON) for the results.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep
from typing import Any

from rich.console import Console
from rich.table import Table

from cutjoint.package.system import processors
from cutjoint.run.result_files import write_whole
from cutjoint.sweeps.reading import read_study
from cutjoint.sweeps.run import perform_study
from cutjoint_bench.studies.clusters import Processes, kill, local_cluster, process_cluster
from cutjoint_bench.studies.provenance import provenance
from cutjoint_bench.studies.sweep import STUDIES, text_of

#: The shares of the runs that are done when a worker, the client and the scheduler are killed.
_SHARES = 0.15, 0.35, 0.55
_WORKERS = 2


def compare(console: Console, name: str, file: Path) -> list[dict[str, Any]]:
    """Print and return what each way writes."""
    study, folder = read_study(file), file.parent
    table = Table("way", "runs of the last call", "elapsed s", "sha256 of the file", title=f"{name}, {study.runs} runs")
    rows: list[dict[str, Any]] = []

    def record(way: str, out: Path, performed: int, seconds: float) -> None:
        digest = sha256(out.read_bytes()).hexdigest()
        rows.append({"study": name, "way": way, "runs": study.runs, "last_call": performed, "elapsed": seconds, "sha256": digest})
        table.add_row(way, str(performed), f"{seconds:.1f}", digest[:16])

    for threads in (1, processors()):
        done = perform_study(study, folder / f"{threads}.parquet", threads=threads)
        record(f"one process, {threads} threads", done.path, done.performed, done.elapsed)
    for way, start in (("LocalCluster", local_cluster), ("dask scheduler, dask worker", process_cluster)):
        with start(_WORKERS, {}) as address:
            done = perform_study(study, folder / f"{way}.parquet", scheduler=address)
        record(way, done.path, done.performed, done.elapsed)
    out, begin = folder / "killed.parquet", perf_counter()
    present = perform_killed(file, out, study.runs)
    record(f"the same; killed at {', '.join(map(str, present))} runs: a worker, the client, the scheduler", out, study.runs - present[-1],
         perf_counter() - begin)  # fmt: skip
    console.print(table)
    return rows


def perform_killed(file: Path, out: Path, runs: int) -> list[int]:
    """Make a sweep whose worker, client and scheduler are killed in turn; returns how many runs were there each time."""
    present = []
    with TemporaryDirectory() as place:
        with _cluster(Path(place) / "first") as (processes, workers, scheduler):
            client = _call(file, out, processes.address)
            present.append(_wait(out, _SHARES[0] * runs, client))
            kill(workers[0])
            processes.start_worker()
            present.append(_wait(out, _SHARES[1] * runs, client))
            kill(client)
            client = _call(file, out, processes.address)
            present.append(_wait(out, _SHARES[2] * runs, client))
            kill(scheduler)
            if client.wait() != 1:
                raise RuntimeError("the client has not noticed that the scheduler has gone")
        with _cluster(Path(place) / "second") as (processes, _, _):
            if _call(file, out, processes.address).wait():
                raise RuntimeError("the last call has failed")
    return present


@contextmanager
def _cluster(folder: Path) -> Iterator[tuple[Processes, list[subprocess.Popen[bytes]], subprocess.Popen[bytes]]]:
    folder.mkdir()
    processes = Processes(folder)
    try:
        scheduler = processes.start_scheduler()
        workers = [processes.start_worker() for _ in range(_WORKERS)]
        processes.wait_for(_WORKERS)
        yield processes, workers, scheduler
    finally:
        processes.end()


def _call(file: Path, out: Path, address: str) -> subprocess.Popen[bytes]:
    """`cutjoint sweep` in a process of its own."""
    words = ["-c", "from cutjoint.cli import main; main()", "sweep", str(file), "--out", str(out), "--scheduler", address]
    quiet = subprocess.DEVNULL
    return subprocess.Popen([sys.executable, *words], stdout=quiet, stderr=quiet, start_new_session=True)


def _wait(out: Path, runs: float, client: subprocess.Popen[bytes]) -> int:
    """Wait until so many runs have their rows; returns how many have."""
    while (present := _count_rows(out)) < runs:
        if client.poll() is not None:
            raise RuntimeError(f"the client has ended at {present} runs")
        sleep(0.05)
    return present


def _count_rows(out: Path) -> int:
    """Number of runs in the parts of a table, by their names."""
    ranges = [part.stem.split("-") for part in out.with_name(f"{out.name}.parts").glob("0*.parquet")]
    return sum(int(last) - int(first) for first, last in ranges)


def main() -> None:
    """Print the tables; the exit status is 1 where a file differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--only", choices=list(STUDIES))
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    console, rows = Console(highlight=False, width=140), []
    console.print(provenance(), markup=False)
    for name, (text, runs) in STUDIES.items():
        if asked.only in (None, name):
            with TemporaryDirectory() as place:
                file = Path(place) / "study.yaml"
                file.write_text(text_of(text, max(20, int(runs * asked.share))), encoding="utf-8")
                rows += compare(console, name, file)
    if asked.out is not None:
        write_whole(asked.out, json.dumps({"of": provenance(), "ways": rows}, indent=2) + "\n")
    names, files = ({way[key] for way in rows} for key in ("study", "sha256"))
    raise SystemExit(0 if len(names) == len(files) else 1)


if __name__ == "__main__":
    main()
