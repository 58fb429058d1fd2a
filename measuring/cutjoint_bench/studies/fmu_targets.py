"""FMUs with code for all processors of x86-64, for those with AVX2 and FMA, and for both.  `make flags`.

Processor time of a step of the Iltis, in turns, the size of the binary, and how long it takes to compile.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from unittest.mock import patch

import click
from rich.console import Console
from rich.table import Table

from cutjoint.export.fmu.archive import TARGETS, make_fmu
from cutjoint.run.scenes import find_scene
from cutjoint.topology.reading import read_model
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.fmu import build_host
from cutjoint_bench.studies.provenance import provenance

FLAGS = ("-O3",)
#: Communication steps of a run, and their length (s), which is that of the integrator.
STEPS, SIZE = 640, 7.5e-3


def processor_time() -> float:
    """Seconds of processors that programs called from here have taken, and that have ended."""
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@click.command()
@click.option("--repetitions", default=101, show_default=True, help="Runs of each.")
@click.option("--builds", default=3, show_default=True, help="How often each is compiled, into an empty cache.")
def main(repetitions: int, builds: int) -> None:
    """Print the times of a step (least, median), the size, and the wait (median)."""
    model = read_model(MODELS / "iltis.yaml")
    fmu = make_fmu(model, find_scene(model, "simul1"), version=3, integrator="trapezoidal")
    waits: dict[str, list[tuple[float, float]]] = {target: [] for target in TARGETS}
    times: dict[str, list[float]] = {target: [] for target in TARGETS}
    binaries: dict[str, Path] = {}
    with TemporaryDirectory() as folder:
        for number in range(builds):
            for target in TARGETS:
                with patch.dict(os.environ, CUTJOINT_CACHE=f"{folder}/cache{number}"):
                    begin, used = perf_counter(), processor_time()
                    binaries[target] = fmu.build(FLAGS, target=target)
                    waits[target].append((perf_counter() - begin, processor_time() - used))
        host = build_host(fmu, Path(folder))
        for _ in range(repetitions):
            for target, binary in binaries.items():
                done = subprocess.run([host, str(STEPS), repr(SIZE), binary], capture_output=True, text=True, check=True)
                times[target].append(1e6 * float(done.stdout) / STEPS)
        sizes = {target: binary.stat().st_size for target, binary in binaries.items()}
    title, heads = "iltis, simul1: fmi3DoStep of 7.5 ms", ("step, us: least", "median", "binary, kB", "compiling, s: wall", "processor")
    table = Table("target", *heads, title=title, box=None)
    for target in TARGETS:
        each, wait = times[target], [f"{median(column):.1f}" for column in zip(*waits[target], strict=True)]
        table.add_row(target, f"{min(each):.2f}", f"{median(each):.2f}", f"{sizes[target] / 1000:.0f}", *wait)
    console = Console(highlight=False, width=140)
    console.print(f"{provenance(FLAGS)}; {repetitions} runs in turns", markup=False)
    console.print(table)


if __name__ == "__main__":
    main()
