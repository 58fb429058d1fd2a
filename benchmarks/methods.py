"""The three methods on the Iltis, and the emitted factorisation against libraries: `make methods`.

Four tables: the paper's scenes at each method's own step, the methods' common limit as dt falls, the parts of a Newton iteration with every
linear solver, and whole steps of generated code against those of the generic twin.  All ratios are of one run of this program.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

import click
import numpy as np
from benchmarks.verification import machine
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from cutjoint.pipeline import METHODS, SOLVERS, Artifact, compile_model, simulate, time_solver
from cutjoint.run.results import Trajectory

MODEL = Path(__file__).resolve().parent.parent / "models" / "iltis.yaml"

#: CPU seconds for 10 s on an SGI Indigo2 (R4400 at 200 MHz), Cuadrado et al. 2000, Table I.
PAPER: Mapping[str, Mapping[str, float]] = {
    "simul1": {"augmented": 34, "classical": 139, "recursive": 20},
    "simul2": {"augmented": 18, "classical": 58, "recursive": 14},
    "simul3": {"augmented": 27, "classical": 99, "recursive": 9},
    "simul1s": {"augmented": 78, "classical": 435, "recursive": 34},
}

#: Step of the runs that others are compared with, s.
FINE = 2.5e-4

#: Steps of the common limit, s.
FALLING = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4)

PLACE = ("chassis.x", "chassis.y", "chassis.z")

#: The solver that the generic twin has.
TWINS = {"recursive": "", "augmented": "cholmod", "classical": "klu"}


@dataclass(frozen=True, kw_only=True)
class Pace:
    """A scene by one method at its own step: milliseconds for the 10 s, and the root mean square difference in height from a fine run."""

    scene: str
    method: str
    dt: float
    iterations: float
    milliseconds: list[float]
    paper_seconds: float
    height: float
    position_residual: float
    velocity_residual: float


@dataclass(frozen=True, kw_only=True)
class Limit:
    """How far two methods' positions are apart at one step, m."""

    dt: float
    augmented: float
    classical: float
    each_other: float


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


@dataclass(frozen=True, kw_only=True)
class Twin:
    """Milliseconds of a scene's run by generated code and by the generic twin."""

    method: str
    solver: str
    generated: float
    generic: float


@click.command()
@click.option("--repetitions", type=click.IntRange(min=1), default=7, show_default=True, help="Timed runs of each kind.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file for all figures.")
def main(repetitions: int, out: Path | None) -> None:
    """Measure the three methods and their solvers."""
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)
        paces = list(measure_paces(bar, task, repetitions))
        limits = measure_limits(bar, task)
        parts = list(measure_parts(bar, task))
        twins = list(measure_twins(bar, task, repetitions))
    console = Console(highlight=False, width=190)
    artifact = compile_model(MODEL, scene="simul1", method="augmented")
    console.print(f"{machine()}; {artifact.binary.compiler}, {' '.join(artifact.binary.flags)}", markup=False)
    for title, table in (
        ("10 s at 5 m/s at each method's step; CPU time beside the paper's", pace_table(paces)),
        ("iavsd_inphase_5: largest distance of the chassis from the recursive method's, m", limit_table(limits)),
        ("parts of an iteration on simul1's tangents, microseconds", parts_table(parts)),
        ("simul1, whole runs at each method's step: generated code and the generic twin", twin_table(twins)),
    ):
        console.print(f"\n{title}", style="bold", markup=False)
        console.print(table)
    if out is not None:
        figures = {"paces": paces, "limits": limits, "parts": parts, "twins": twins}
        data: dict[str, Any] = {"machine": machine(), "compiler": artifact.binary.compiler, "flags": artifact.binary.flags}
        data |= {name: [asdict(row) for row in rows] for name, rows in figures.items()}
        out.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")


def compiled(scene: str, method: str, **how: Any) -> Artifact:
    """The Iltis in a scene."""
    return compile_model(MODEL, scene=scene, method=method, **how)


def completed(artifact: Artifact, **how: Any) -> Trajectory:
    """A run that must not fail."""
    run = simulate(artifact, **how)
    if run.failure is not None:
        raise SystemExit(f"{artifact.scene.name}, {artifact.method}: {run.failure}")
    return run


def measure_paces(bar: Progress, task: TaskID, repetitions: int) -> Iterator[Pace]:
    """Every scene of the paper by every method, repetitions in turns."""
    for scene, paper in PAPER.items():
        bar.update(task, description=scene)
        artifacts = {method: compiled(scene, method) for method in METHODS}
        fine = completed(artifacts["recursive"], dt=FINE)
        runs: dict[str, list[Trajectory]] = {method: [] for method in METHODS}
        for _ in range(repetitions):
            for method, artifact in artifacts.items():
                runs[method].append(completed(artifact))
        for method, made in runs.items():
            run = made[0]
            difference = run["chassis.z"] - np.interp(run.t, fine.t, fine["chassis.z"])
            yield Pace(
                scene=scene, method=method, dt=artifacts[method].scene.numerics.of_method(method).dt,
                iterations=run.evaluations / run.steps, milliseconds=[1e3 * r.seconds for r in made], paper_seconds=paper[method],
                height=float(np.sqrt(np.mean(difference**2))), position_residual=run.effort.residuals.position,
                velocity_residual=run.effort.residuals.velocity,
            )  # fmt: skip


def measure_limits(bar: Progress, task: TaskID) -> list[Limit]:
    """The three methods over falling steps."""
    bar.update(task, description="common limit")
    artifacts = {method: compiled("iavsd_inphase_5", method) for method in METHODS}
    limits = []
    for dt in FALLING:
        runs = {method: completed(artifact, dt=dt) for method, artifact in artifacts.items()}
        limits.append(
            Limit(
                dt=dt, augmented=_apart(runs["augmented"], runs["recursive"]), classical=_apart(runs["classical"], runs["recursive"]),
                each_other=_apart(runs["augmented"], runs["classical"]),
            )
        )  # fmt: skip
    return limits


def _apart(one: Trajectory, other: Trajectory) -> float:
    return max(float(np.abs(one[c] - other[c]).max()) for c in PLACE)


def measure_parts(bar: Progress, task: TaskID) -> Iterator[Parts]:
    """Every solver on the tangent of each Lagrangian method at the start of simul1."""
    for method in ("augmented", "classical"):
        artifact = compiled("simul1", method, comparison=True)
        for solver in SOLVERS:
            if method == "augmented" or solver not in ("eigen-ldlt", "cholmod"):
                bar.update(task, description=f"{method}, {solver}")
                times = time_solver(artifact, solver)
                yield Parts(
                    method=method, solver=solver, size=int(times["size"]), entries=int(times["entries"]),
                    **{name: 1e6 * times[name] for name in ("analyse", "assemble", "factor", "solve")},
                )  # fmt: skip


def measure_twins(bar: Progress, task: TaskID, repetitions: int) -> Iterator[Twin]:
    """Generated code and generic twin in turns."""
    for method, solver in TWINS.items():
        bar.update(task, description=f"{method}, generic twin")
        generated, generic = (compiled("simul1", method, implementation=how) for how in ("generated", "generic"))
        times: tuple[list[float], list[float]] = ([], [])
        for _ in range(repetitions):
            times[0].append(completed(generated).seconds)
            times[1].append(completed(generic, **({"solver": solver} if solver else {})).seconds)
        yield Twin(method=method, solver=solver, generated=1e3 * median(times[0]), generic=1e3 * median(times[1]))


def pace_table(paces: list[Pace]) -> Table:
    """Scenes and methods."""
    table = _table(
        "scene", "method", "dt, ms", "iterations a step", "CPU, ms", "times real time", "of recursive", "paper, s", "of recursive",
        "height rms, mm", "Phi", "Phid",
    )  # fmt: skip
    own = {p.scene: p for p in paces if p.method == "recursive"}
    for p in paces:
        base = own[p.scene]
        time = median(p.milliseconds)
        spread = f"{time:.1f} ({min(p.milliseconds):.1f} .. {max(p.milliseconds):.1f})"
        table.add_row(
            p.scene, p.method, f"{1e3 * p.dt:g}", f"{p.iterations:.1f}", spread, f"{1e4 / time:.0f}",
            f"{time / median(base.milliseconds):.2f}", f"{p.paper_seconds:g}", f"{p.paper_seconds / base.paper_seconds:.2f}",
            f"{1e3 * p.height:.1f}", *("" if np.isnan(x) else f"{x:.0e}" for x in (p.position_residual, p.velocity_residual)),
        )  # fmt: skip
    return table


def limit_table(limits: list[Limit]) -> Table:
    """Distances over dt."""
    table = _table("dt, ms", "augmented", "classical", "augmented from classical")
    for x in limits:
        table.add_row(f"{1e3 * x.dt:g}", *(f"{d:.1e}" for d in (x.augmented, x.classical, x.each_other)))
    return table


def parts_table(parts: list[Parts]) -> Table:
    """Solvers."""
    table = _table("method", "solver", "size", "entries", "analyse", "assemble", "factor", "solve", "factor + solve", "of emitted")
    for x in parts:
        emitted = next(p for p in parts if p.method == x.method and p.solver == "emitted")
        ratio = (x.factor + x.solve) / (emitted.factor + emitted.solve)
        times = (f"{t:.2f}" for t in (x.analyse, x.assemble, x.factor, x.solve, x.factor + x.solve))
        table.add_row(x.method, x.solver, str(x.size), str(x.entries), *times, f"{ratio:.1f}")
    return table


def twin_table(twins: list[Twin]) -> Table:
    """Generated and generic."""
    table = _table("method", "twin's solver", "generated, ms", "generic, ms", "ratio")
    for x in twins:
        table.add_row(x.method, x.solver, f"{x.generated:.1f}", f"{x.generic:.1f}", f"{x.generic / x.generated:.1f}")
    return table


def _table(*headings: str) -> Table:
    table = Table(box=None)
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("scene", "method", "solver", "twin's solver") else "right")
    return table


if __name__ == "__main__":
    main()
