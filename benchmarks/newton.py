"""The fixed point and Newton's iteration on the paper's scenes: iterations of a step, the longest steps, and time at equal error.

Errors are the farthest that an output in m is from a run of `recursive-newton` at a hundredth of the paper's step; how far `augmented` at
that step is from it is told beside.  All times are of one run of this program, the least of several runs each.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from benchmarks.distance import distance
from rich.console import Console
from rich.table import Table

from cutjoint.bench.measure import machine
from cutjoint.pipeline import Artifact, compile_model, simulate
from cutjoint.run.results import Trajectory

MODEL = Path(__file__).parents[1] / "models" / "iltis.yaml"
METHODS = ("recursive", "recursive-newton", "augmented")
#: Steps as parts of the rows of the table, which are 30 ms apart.
PARTS = (1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
ROW = 0.03
REFERENCE_STEP = 7.5e-5
ERROR = 1e-3
RUNS = 7


def compare(scene: str, table: Table) -> None:
    """A line for each method."""
    artifacts = {method: compile_model(MODEL, scene=scene, method=method) for method in METHODS}
    truth = run(artifacts["recursive-newton"], REFERENCE_STEP)
    apart = distance(run(artifacts["augmented"], REFERENCE_STEP), truth)
    for method, artifact in artifacts.items():
        tried = {ROW / part: run(artifact, ROW / part) for part in PARTS}
        ended = {dt: r for dt, r in tried.items() if r.failure is None}
        longest = max(ended, default=float("nan"))
        enough = [dt for dt, r in ended.items() if distance(r, truth) <= ERROR]
        seconds = {dt: min(run(artifact, dt).seconds for _ in range(RUNS)) for dt in enough}
        best = min(seconds, key=lambda dt: seconds[dt]) if seconds else float("nan")
        own = tried[ROW / 4]
        each = own.effort.iterations / own.steps if own.failure is None else float("nan")
        table.add_row(
            scene, method, f"{longest * 1e3:.3g}", f"{each:.2f}", f"{best * 1e3:.3g}" if seconds else "none",
            f"{seconds[best] * 1e3:.2f}" if seconds else "", f"{apart:.1e}",
        )  # fmt: skip


def run(artifact: Artifact, dt: float) -> Trajectory:
    """Rows 30 ms apart."""
    return simulate(replace(artifact, scene=replace(artifact.scene, output_step=ROW)), dt=dt)


def main() -> None:
    """Print the table."""
    console = Console(highlight=False, width=140)
    console.print(", ".join(machine().values()), markup=False)
    table = Table(
        "scene", "method", "longest step, ms", "iterations at 7.5 ms", f"step for {ERROR:g} m, ms", "time, ms", "references apart, m"
    )
    for scene in ("simul1", "simul2", "simul3", "simul1s"):
        compare(scene, table)
    console.print(table)


if __name__ == "__main__":
    main()
