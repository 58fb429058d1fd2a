"""The fixed point and Newton's iteration on the paper's scenes: iterations of a step, the longest steps, and time at equal error.

Errors are the farthest that an output in m is from a run of `recursive-newton` at a hundredth of the paper's step; how far `augmented` at
that step is from it stands beside.  All times are of one run of this program, the least of several runs each, in turns; ratios
are to that of `recursive`.  Runs end with a row, so that all steps end there too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rich.console import Console
from rich.table import Table

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.distance import distance
from cutjoint_bench.studies.provenance import provenance

MODEL = MODELS / "iltis.yaml"
METHODS = ("recursive", "recursive-newton", "augmented")
#: Of the integrator `radau5` of recursive-newton, whose steps are as long as they allow.
TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5)
#: Steps as parts of the rows of the table, which are 30 ms apart.
PARTS = (1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
#: Of these, steps whose iterations are printed: 5, 7.5, 10 ms.
COUNTED = (6, 4, 3)
ROW = 0.03
END = 333 * ROW
REFERENCE_STEP = 7.5e-5
ERROR = 1e-3
RUNS = 7


def compare(scene: str, table: Table) -> None:
    """A line for each method, and one for adaptive steps."""
    artifacts = {method: compile_model(MODEL, scene=scene, method=method) for method in METHODS}
    truth = run(artifacts["recursive-newton"], dt=REFERENCE_STEP)
    apart = distance(run(artifacts["augmented"], dt=REFERENCE_STEP), truth)
    tried = {method: {ROW / part: run(artifact, dt=ROW / part) for part in PARTS} for method, artifact in artifacts.items()}
    contenders = {method: fastest(artifacts[method], truth, [{"dt": dt} for dt in steps]) for method, steps in tried.items()}
    adaptive = [{"integrator": "radau5", "tolerance": tolerance} for tolerance in TOLERANCES]
    contenders["recursive-newton, radau5"] = fastest(artifacts["recursive-newton"], truth, adaptive)
    seconds = in_turns({name: (artifacts[name.split(",")[0]], how) for name, how in contenders.items() if how is not None})
    for name, how in contenders.items():
        steps = tried.get(name, {})
        longest = max((dt for dt, r in steps.items() if r.failure is None), default=float("nan"))
        each = (iterations(steps.get(ROW / part)) for part in COUNTED)
        table.add_row(
            scene, name, f"{longest * 1e3:.3g}", *each, "none" if how is None else describe(how),
            f"{seconds[name] * 1e3:.2f}" if how is not None else "",
            f"{seconds['recursive'] / seconds[name]:.2f}" if how is not None and "recursive" in seconds else "", f"{apart:.1e}",
        )  # fmt: skip


def iterations(run: Trajectory | None) -> str:
    """Of a step; empty where there is no run that ends."""
    return f"{run.statistics.iterations / run.steps:.2f}" if run is not None and run.failure is None else ""


def fastest(artifact: Artifact, truth: Trajectory, ways: list[dict[str, Any]]) -> dict[str, Any] | None:
    """Of the ways to run a model that stay within the error, the one that takes least time; None where none does."""
    enough = [how for how in ways if distance(run(artifact, **how), truth) <= ERROR]
    seconds = in_turns({str(i): (artifact, how) for i, how in enumerate(enough)})
    return enough[int(min(seconds, key=lambda i: seconds[i]))] if enough else None


def in_turns(contenders: dict[str, tuple[Artifact, dict[str, Any]]]) -> dict[str, float]:
    """The least time of each, s."""
    seconds = dict.fromkeys(contenders, float("inf"))
    for _ in range(RUNS):
        for name, (artifact, how) in contenders.items():
            seconds[name] = min(seconds[name], run(artifact, **how).seconds)
    return seconds


def describe(how: dict[str, Any]) -> str:
    """A step in ms, or a tolerance."""
    return f"{how['dt'] * 1e3:.3g}" if "dt" in how else f"tolerance {how['tolerance']:g}"


def run(artifact: Artifact, **how: Any) -> Trajectory:
    """Rows 30 ms apart."""
    return simulate(replace(artifact, scene=replace(artifact.scene, output_step=ROW)), end=END, error=False, check=False, **how)


def main() -> None:
    """Print the table."""
    console = Console(highlight=False, width=160)
    console.print(f"{provenance()}; the least of {RUNS} runs", markup=False)
    counted = (f"iterations at {1e3 * ROW / part:g} ms" for part in COUNTED)
    table = Table(
        "scene", "method", "longest step, ms", *counted, f"step for {ERROR:g} m, ms", "time, ms", "times as fast", "references apart, m"
    )
    for scene in ("simul1", "simul2", "simul3", "simul1s"):
        compare(scene, table)
    console.print(table)


if __name__ == "__main__":
    main()
