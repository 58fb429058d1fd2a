"""Runs of a batch beside single ones, operations per second beside the machine's peak, and what a millimetre costs: `make batch`.

All times are of one run of this program on one thread, medians of several runs each.  Errors are the farthest that an output in m of the
reduced model is from one of the full model at a hundredth of the paper's step.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

from rich.console import Console
from rich.table import Table

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import Loops
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.sequence import reduction_sequence
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import find_scene, with_loops
from cutjoint.run.simulation import simulate
from cutjoint.tasks.batch import BatchArtifact, compile_scene_batch, simulate_batch
from cutjoint.toolchain.build import FLAGS
from cutjoint.toolchain.compiler import find_compiler
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.distance import distance
from cutjoint_bench.studies.provenance import provenance

RUNS = 64
REPETITIONS = 5
#: Step (s) and tolerance; the first is the paper's step.
STEPS = ((7.5e-3, 1e-6), (2.5e-3, 1e-4), (1.5e-3, 1e-4), (1.25e-3, 1e-6), (1.25e-3, 1e-4))
#: Tolerances of `dormand-prince`, which batches do without.  Its steps go over events, loops have the scene's own penalty, with which an
#: evaluation takes fewest passes, and timed runs have rows 0.15 s apart, each of which it has to interpolate and project.
TOLERANCES = (3e-4, 2e-4, 1e-4)
PENALTY = 1e9
SPARSE_ROWS = 0.15
REFERENCE_STEP = 7.5e-5
#: The differences of the runs.
CASES = [{"tyre_stiffness": 440_000.0 + 625.0 * k} for k in range(RUNS)]


def peak() -> dict[int, float]:
    """Multiply-adds of doubles per second, by vector width; each counts as two operations."""
    with TemporaryDirectory() as folder:
        program = Path(folder) / "peak"
        source = Path(__file__).with_name("peak.cpp")
        subprocess.run([*find_compiler().command, "-std=c++20", *FLAGS, source, "-o", program], check=True)
        measured = json.loads(subprocess.run([program], check=True, capture_output=True, text=True).stdout)
    return {int(width): each for width, each in measured.items()}


def compare(name: str, model: Model, scene: Scene, throughput: Table, limit: Table, at_most: dict[int, float]) -> None:
    """The lines of one model."""
    lanes, scalar = (compile_scene(model, scene, CompileOptions(lanes=lanes)) for lanes in (True, False))
    batch = compile_scene_batch(model, scene)
    operations, evaluations = scalar.program.operations("evaluate"), simulate(scalar).evaluations
    single = {"one at a time, lanes in it": (steps(lanes), whole(lanes)), "one at a time, no lanes": (steps(scalar), whole(scalar))}
    together = steps_of_batch(batch)
    throughput.add_row(name, "batch", *(f"{x * 1e3:.2f}" for x in together), "", "")
    for kind, seconds in single.items():
        ratios = (f"{mine / theirs:.2f}" for mine, theirs in zip(seconds, together, strict=True))
        throughput.add_row(name, kind, *(f"{x * 1e3:.2f}" for x in seconds), *ratios)
    for width, taken in ((1, steps(scalar)), (4, steps(lanes)), (max(at_most), together[0])):
        rate = operations * evaluations / taken
        share = f"{100 * rate / (2 * at_most[width]):.0f} %" if width in at_most else ""
        limit.add_row(name, str(width), f"{rate / 1e9:.1f}", f"{2 * at_most.get(width, 0.0) / 1e9:.1f}", share)


def seek_millimetre(full: Artifact, model: Model, scene: Scene, table: Table) -> None:
    """Costs of steps and tolerances that are short enough, and of some that are not."""
    truth = simulate(full, dt=REFERENCE_STEP)
    single, batch = compile_scene(model, scene), compile_scene_batch(model, scene)
    sparse = replace(single, scene=replace(scene, output_step=SPARSE_ROWS))
    for dt, tolerance in STEPS:
        run = simulate(single, dt=dt, tolerance=tolerance, check=False)
        seconds = steps(single, dt=dt, tolerance=tolerance), steps_of_batch(batch, dt=dt, solver_tolerance=tolerance)[0]
        times = (text for x in seconds for text in (f"{x * 1e3:.2f}", f"{scene.end / x:.0f}"))
        table.add_row(f"{dt * 1e3:g}", f"{tolerance:g}", str(run.evaluations), f"{distance(run, truth):.1e}", *times)
    for tolerance in TOLERANCES:
        how: dict[str, Any] = {"integrator": "dormand-prince", "events": "crossed", "tolerance": tolerance, "penalty": PENALTY}
        run, x = simulate(single, **how, check=False), steps(sparse, **how)
        figures = (f"{1e3 * scene.end / run.steps:.2g} on average", f"{tolerance:g}", str(run.evaluations), f"{distance(run, truth):.1e}")
        table.add_row(*figures, f"{x * 1e3:.2f}", f"{scene.end / x:.0f}", "", "")


def steps(artifact: Artifact, **how: Any) -> float:
    """Seconds of a run's steps."""
    return median(simulate(artifact, **how, error=False, check=False).seconds for _ in range(REPETITIONS))


def whole(artifact: Artifact) -> float:
    """Seconds of a run from beginning to end, the simulator's start and its search for equilibrium included, with two rows only."""
    artifact = replace(artifact, scene=replace(artifact.scene, output_step=artifact.scene.end))

    def run() -> float:
        begin = perf_counter()
        simulate(artifact)
        return perf_counter() - begin

    return median(run() for _ in range(REPETITIONS))


def steps_of_batch(artifact: BatchArtifact, **how: float) -> tuple[float, float]:
    """Seconds of the steps and of all of one run of a batch."""
    done = [simulate_batch(artifact, CASES, threads=1, check=False, **how) for _ in range(REPETITIONS)]  # type: ignore[arg-type]
    return median(b.seconds for b in done) / RUNS, median(b.elapsed for b in done) / RUNS


def processor_time(artifact: BatchArtifact, dt: float) -> float:
    """Processor seconds of one run of a batch on one thread, starts and results included, the least of several batches."""

    def batch() -> float:
        begin = process_time()
        simulate_batch(artifact, 4 * CASES, threads=1, check=False, dt=dt)
        return process_time() - begin

    return min(batch() for _ in range(REPETITIONS)) / (4 * RUNS)


def main() -> None:
    """Print the tables."""
    console = Console(highlight=False, width=140)
    console.print(f"{provenance()}; medians of {REPETITIONS} runs", markup=False)
    throughput = Table("simul1", "runs", "steps of a run, ms", "all of a run, ms", "steps, over the batch's", "all, over the batch's")
    limit = Table("simul1", "width", "operations, 1e9/s", "peak of multiply-adds, 1e9/s", "share")
    model = read_model(MODELS / "iltis.yaml")
    scene, at_most = find_scene(model, "simul1"), peak()
    reduced = reduction_sequence(model, scene, "recursive")[-1]
    for name, of, at in (("full", model, scene), ("reduced", reduced.model, reduced.scene)):
        compare(name, of, at, throughput, limit, at_most)
        compare(f"{name}, loops as functions", of, with_loops(at, Loops.EMBEDDED), throughput, limit, at_most)
    millimetre = Table(
        "step, ms", "tolerance", "evaluations", "error, m", "steps of a run, ms", "times real time", "of a batch, ms", "times"
    )
    seek_millimetre(compile_scene(model, scene), reduced.model, reduced.scene, millimetre)
    for table in (throughput, limit, millimetre):
        console.print(table)
    seconds = processor_time(compile_scene_batch(model, with_loops(scene, Loops.EMBEDDED)), 1e-3)
    times = f"{1e3 * seconds:.2f} ms of a processor for a run, {scene.end / seconds:.0f} times real time"
    console.print(f"full, loops as functions, steps of 1 ms: {times}")


if __name__ == "__main__":
    main()
