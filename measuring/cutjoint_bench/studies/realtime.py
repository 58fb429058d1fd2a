"""Steps against the wall clock, and what a fixed number of iterations leaves out: `make realtime`."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.artifact import Artifact
from cutjoint.run.simulation import simulate
from cutjoint.tasks.realtime import run_in_real_time
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.distance import distance
from cutjoint_bench.studies.provenance import provenance

MODEL = MODELS / "iltis.yaml"
SCENE, STEP, SHORT = "simul1", 5e-3, 2.5e-4
FIXED = (2, 3, 4, 6, 8)
#: The number of iterations in timed steps; None until they converge.
TIMED = (4, None)


def accuracy(artifact: Artifact) -> Table:
    """Errors by a fixed number of iterations, beside those of the step itself."""
    converged, fine = simulate(artifact, dt=STEP, check=False), simulate(artifact, dt=SHORT, check=False)
    table = Table("iterations", "from the converged run, m", f"from one at {SHORT * 1e3:g} ms, m")
    for iterations in FIXED:
        run = simulate(artifact, dt=STEP, iterations=iterations, check=False)
        table.add_row(str(iterations), f"{distance(run, converged):.1e}", f"{distance(run, fine):.1e}")
    table.add_row(f"{converged.evaluations / converged.steps:.1f} (converged)", "", f"{distance(converged, fine):.1e}")
    return table


def times(artifact: Artifact) -> Table:
    """Times of steps, in microseconds."""
    table = Table("iterations", "p50, us", "p99", "p99.9", "largest", "missed deadlines")
    for iterations in TIMED:
        steps = run_in_real_time(artifact, dt=STEP, iterations=iterations)
        shares = (steps.percentile(share) for share in (50, 99, 99.9, 100))
        table.add_row(str(iterations or "converged"), *(f"{x * 1e6:.1f}" for x in shares), f"{steps.missed} of {steps.took.size}")
    return table


def main() -> None:
    """Print the tables."""
    console = Console(highlight=False, width=140)
    console.print(provenance(), f"{SCENE} in steps of {STEP * 1e3:g} ms", sep="; ", markup=False)
    artifact = compile_model(MODEL, scene=SCENE)
    for table in (accuracy(artifact), times(artifact)):
        console.print(table)


if __name__ == "__main__":
    main()
