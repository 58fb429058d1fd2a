"""Steps against the wall clock, the error of a fixed number of iterations, and the cost of wheels that turn: `make realtime`."""

from __future__ import annotations

from dataclasses import replace

from rich.console import Console
from rich.table import Table

from cutjoint.compile.pipeline import compile_model, compile_scene
from cutjoint.methods import Loops
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import find_scene, with_loops
from cutjoint.run.simulation import simulate
from cutjoint.tasks.realtime import run_in_real_time
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.distance import distance
from cutjoint_bench.studies.instructions import rolling_text
from cutjoint_bench.studies.provenance import provenance

MODEL = MODELS / "iltis.yaml"
SCENE, STEP, SHORT = "simul1", 5e-3, 2.5e-4
FIXED = (2, 3, 4, 6, 8)
#: The number of iterations in timed steps; None until they converge.
TIMED = (4, None)
#: Scenes of 3 s in steps of 1 and 7.5 ms, each run in turns with and without wheels that turn.
ROLLING = ("rolls", "rolls_in_long_steps")
TURNS = 9


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
        table.add_row(str(iterations or "converged"), *(f"{x * 1e6:.1f}" for x in shares), f"{steps.missed} of {steps.durations.size}")
    return table


def rolling() -> Table:
    """Simulated time over the least time of integration, and a step and an evaluation in microseconds; loops are functions."""
    table = Table("scene", "wheels", "step, ms", "times real time", "a step, us", "evaluations a step", "an evaluation, us")
    text = (MODELS / "iltis.yaml").read_text(encoding="utf-8")
    models = {words: read_model_text(rolling_text(text, on_wheels=turn), "iltis.yaml", folder=MODELS)
              for words, turn in (("tyres of the paper", False), ("turn, by the Magic Formula", True))}  # fmt: skip
    for scene in ROLLING:
        artifacts = {words: _with_two_rows(model, scene) for words, model in models.items()}
        runs = [{words: simulate(artifact, check=False, error=False) for words, artifact in artifacts.items()} for _ in range(TURNS)]
        for words, artifact in artifacts.items():
            run = min((turn[words] for turn in runs), key=lambda run: run.seconds)
            step, evaluation = (f"{run.seconds / number * 1e6:.2f}" for number in (run.steps, run.evaluations))
            dt = artifact.scene.numerics.of_method(artifact.method).step
            ratio, each = artifact.scene.end / run.seconds, run.evaluations / run.steps
            table.add_row(scene, words, f"{dt * 1e3:g}", f"{ratio:.0f}", step, f"{each:.1f}", evaluation)
    return table


def _with_two_rows(model: Model, name: str) -> Artifact:
    """The scene with loops as functions, and rows at start and end alone."""
    artifact = compile_scene(model, with_loops(find_scene(model, name), Loops.EMBEDDED))
    return replace(artifact, scene=replace(artifact.scene, output_step=artifact.scene.end))


def main() -> None:
    """Print the tables."""
    console = Console(highlight=False, width=140)
    console.print(provenance(), f"{SCENE} in steps of {STEP * 1e3:g} ms", sep="; ", markup=False)
    artifact = compile_model(MODEL, scene=SCENE)
    for table in (accuracy(artifact), times(artifact), rolling()):
        console.print(table)


if __name__ == "__main__":
    main()
