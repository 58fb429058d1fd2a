"""The verification problems in one table: errors, observed order and speed.  Run it as `make verification`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import median

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint_bench.machine import machine
from cutjoint_bench.studies.problems import PROBLEMS, Errors, Problem, measure_errors, observed_orders

REPETITIONS = 7


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """One problem: ``run`` and ``errors`` of the scene as it stands, ``orders`` over the smooth stretch.
    ``ratios`` of run time to real time, one a repetition."""

    problem: Problem
    artifact: Artifact
    run: Trajectory
    errors: Errors
    orders: list[float]
    ratios: list[float]


def measure(problem: Problem, artifact: Artifact, *, repetitions: int) -> Measurement:
    """Run a compiled problem for its errors and for its time."""
    slope = [measure_errors(problem, completed(artifact, dt=dt, end=problem.smooth)) for dt in problem.steps]
    runs = [completed(artifact) for _ in range(repetitions)]
    return Measurement(
        problem=problem, artifact=artifact, run=runs[0], errors=measure_errors(problem, runs[0]), orders=observed_orders(slope),
        ratios=[run.seconds / artifact.scene.end for run in runs],
    )  # fmt: skip


def completed(artifact: Artifact, *, dt: float | None = None, end: float | None = None) -> Trajectory:
    """A run that must not fail."""
    run = simulate(artifact, dt=dt, end=end)
    if run.failure is not None:
        raise SystemExit(f"{artifact.topology.model.name}: {run.failure}")
    return run


HEADER = ("problem", "dt [s]", "end [s]", "largest error", "e", "threshold", "order", "iterations", "run/real time", "spread", "code")


def row(m: Measurement) -> tuple[str, ...]:
    """The cells of a measurement, in the header's order."""
    p, scene = m.problem, m.artifact.scene
    return (
        f"{p.name} {p.title}", f"{scene.numerics.step:g}", f"{scene.end:g}", f"{m.errors.largest:.2e} {p.unit}", f"{m.errors.scaled:.2e}",
        f"{p.threshold:g} {p.unit}", f"{m.orders[0]:.3f}, {m.orders[1]:.3f}", f"{m.run.evaluations / m.run.steps:.1f}",
        f"{median(m.ratios):.2e}", f"{min(m.ratios):.2e} .. {max(m.ratios):.2e}", m.artifact.source.digest[:8],
    )  # fmt: skip


def table(rows: list[tuple[str, ...]]) -> Iterator[str]:
    """Lines with aligned columns."""
    widths = [max(len(r[i]) for r in rows) for i in range(len(rows[0]))]
    for cells in rows:
        yield "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()


def report(measurements: list[Measurement]) -> Iterator[str]:
    """The conditions of the measurement, how to read it, and the table."""
    binary, repetitions = measurements[0].artifact.binary, len(measurements[0].ratios)
    yield f"machine   {', '.join(machine().values())}"
    yield f"compiler  {binary.compiler}"
    yield f"flags     {' '.join(binary.flags)}"
    yield f"runs      {repetitions} of each scene as its model file has it; run/real time is their median, of the steps alone"
    yield "e         root mean square of error / max(|exact|, threshold) over all outputs and rows"
    yield "order     log2 of the ratio of largest errors from twice the step to the step, and from the step to half of it:"
    for p in (m.problem for m in measurements):
        steps = ", ".join(f"{dt:g}" for dt in p.steps)
        yield f"            {p.name:5} dt = {steps} s over the first {p.smooth:g} s; outputs {', '.join(p.outputs)}"
    yield "code      first digits of the digest of the generated code"
    yield ""
    yield from table([HEADER, *map(row, measurements)])


def main() -> None:
    print("\n".join(report([measure(p, compile_model(p.path), repetitions=REPETITIONS) for p in PROBLEMS])))


if __name__ == "__main__":
    main()
