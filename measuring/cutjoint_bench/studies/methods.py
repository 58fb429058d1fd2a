"""The parts of a Newton iteration of the Lagrangian methods with every linear solver, on the tangents of the Iltis: `make methods`.

Whole runs, of every method, solver and generic solver, are studies of `make report`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from cutjoint.compile.pipeline import compile_model
from cutjoint.methods import DEFAULT_SOLVER, METHODS, names_of
from cutjoint.run.artifact import Artifact
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.run.simulator import call_simulator
from cutjoint.toolchain.build import build
from cutjoint.toolchain.drivers import Kind
from cutjoint_bench.driver import ADDED_SOLVERS, ALL_SOLVERS
from cutjoint_bench.examine import examining
from cutjoint_bench.machine import machine
from cutjoint_bench.progress import progress_bar
from cutjoint_bench.studies.checkout import MODELS

MODEL = MODELS / "iltis.yaml"


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Microseconds of the parts of a Newton iteration with one solver."""

    method: str
    solver: str
    size: int
    entries: int
    analyse: float
    assemble: float
    factor: float
    solve: float


@click.command()
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file for all figures.")
def main(out: Path | None) -> None:
    """Time the parts of an iteration, in microseconds at the start of simul1."""
    with progress_bar() as say:
        methods = names_of(METHODS, lambda m: m.has_system)
        artifacts = [compile_model(MODEL, scene="simul1", method=method, additions=ADDED_SOLVERS) for method in methods]
        parts = [p for artifact in artifacts for p in measure_parts(artifact, say)]
    provenance = {**machine(), "compiler": artifacts[0].binary.compiler, "flags": " ".join(artifacts[0].binary.flags)}
    console = Console(highlight=False, width=120)
    console.print(", ".join(provenance.values()), markup=False)
    console.print(parts_table(parts))
    if out is not None:
        out.write_text(json.dumps({**provenance, "parts": [asdict(p) for p in parts]}, indent=2) + "\n", encoding="utf-8")


def measure_parts(artifact: Artifact, say: Callable[[str], None]) -> Iterator[Parts]:
    """Every solver that suits a method's tangent."""
    for solver in names_of(ALL_SOLVERS, lambda s: s.suits(METHODS[artifact.method])):
        say(f"{artifact.method}, {solver}")
        times = time_solver(artifact, solver)
        yield Parts(
            method=artifact.method, solver=solver, size=int(times["size"]), entries=int(times["entries"]),
            **{name: 1e6 * times[name] for name in ("analyse", "assemble", "factor", "solve")},
        )  # fmt: skip


def time_solver(artifact: Artifact, solver: str) -> dict[str, float]:
    """Seconds that the parts of a Newton iteration take at the start of the scene: ``analyse``, ``assemble``, ``factor``, ``solve``.

    Raises:
        SimulatorError: the solver does not suit the method, or the simulator does not have it.
    """
    options = replace(PLAIN_STEPS, solver=solver)
    run_file = make_run_file(artifact.topology.model, artifact.scene, {}, task="factor", method=artifact.method, options=options)
    kind = Kind(precision=artifact.precision, additions=artifact.additions)
    summary = call_simulator(build(examining(artifact.source), flags=artifact.binary.flags, kind=kind).path, run_file.entries())
    return {name: value for name, value in summary.items() if isinstance(value, float | int)}


def parts_table(parts: list[Parts]) -> Table:
    """Solvers."""
    table = Table(box=None)
    for heading in ("method", "solver"):
        table.add_column(heading)
    for heading in ("size", "entries", "analyse", "assemble", "factor", "solve", "factor + solve", "of emitted"):
        table.add_column(heading, justify="right")
    for x in parts:
        emitted = next(p for p in parts if p.method == x.method and p.solver == DEFAULT_SOLVER)
        ratio = (x.factor + x.solve) / (emitted.factor + emitted.solve)
        times = (f"{t:.2f}" for t in (x.analyse, x.assemble, x.factor, x.solve, x.factor + x.solve))
        table.add_row(x.method, x.solver, str(x.size), str(x.entries), *times, f"{ratio:.1f}")
    return table


if __name__ == "__main__":
    main()
