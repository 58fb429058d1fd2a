"""Loops as functions of one coordinate beside their equations: operations, evaluations and time of a run, and how far motions are apart.

Both run by dormand-prince, in turns; of their times the least counts.  "fit" is the time in which the functions are found.  Operations are
those of an evaluation with lanes counted once.  "apart" is the largest difference of a place or an angle (m, rad) over the rows that both
have, "energy" the largest difference of work and energy of the compiled run beside the energy that moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from cutjoint.analysis.embedding.embed import embed_loops
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import Loops
from cutjoint.model.records import Model, Scene
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import with_loops
from cutjoint.run.simulation import simulate
from cutjoint.topology.reading import read_model
from cutjoint_bench.studies.provenance import provenance

MODELS = ("iltis", "car", "axle", "excavator", "andrews", "press", "slider_crank", "four_bar", "delta")
TURNS = 5


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A scene by both ways to close loops, and the seconds in which functions were found."""

    exact: Artifact
    compiled: Artifact
    fit: float


def compile_pair(model: Model, scene: Scene, loop_tolerance: float) -> Pair | str:
    """A scene both ways, or why no loops of it become functions."""
    scene = replace(scene, numerics=replace(scene.numerics, closure=None, integrator="dormand-prince", loop_tolerance=loop_tolerance))
    begin = perf_counter()
    outcome = embed_loops(model, scene)
    seconds = perf_counter() - begin
    if not outcome.model.embedded_loops:
        return next((note.text for note in outcome.left), "no loops")
    exact, compiled = (compile_scene(model, with_loops(scene, loops)) for loops in (Loops.EXACT, Loops.EMBEDDED))
    return Pair(exact=exact, compiled=compiled, fit=seconds)


def run(artifact: Artifact, tolerance: float) -> Trajectory:
    """A run of a scene."""
    return simulate(artifact, integrator="dormand-prince", tolerance=tolerance, error=False, check=False)


def apart(one: Trajectory, other: Trajectory) -> float:
    """The largest difference of places and angles over the rows that both have."""
    rows = min(one.t.size, other.t.size)
    places = [name for name in one.columns if one.units[name] in ("m", "rad")]
    return max((float(np.abs(one[name][:rows] - other[name][:rows]).max()) for name in places), default=float("nan"))


def measure(pair: Pair, tolerance: float) -> tuple[str, ...]:
    """The figures of a scene at a tolerance of steps."""
    runs = [(run(pair.exact, tolerance), run(pair.compiled, tolerance)) for _ in range(TURNS)]
    exact, compiled = (min((pairs[way] for pairs in runs), key=lambda run: run.seconds) for way in range(2))
    checked = simulate(pair.compiled, integrator="dormand-prince", tolerance=tolerance, error=True, check=False)
    operations = [made.program.instructions("evaluate") for made in (pair.exact, pair.compiled)]
    ended = [found.failure.time if found.failure is not None else None for found in (exact, compiled)]
    return (
        f"{pair.exact.equations.unknowns} -> {pair.compiled.equations.unknowns}", f"{operations[0]} -> {operations[1]}",
        f"{pair.fit:.2f}", f"{exact.evaluations} -> {compiled.evaluations}", f"{1e3 * exact.seconds:.3g} -> {1e3 * compiled.seconds:.3g}",
        f"{exact.seconds / compiled.seconds:.2f}", f"{apart(exact, compiled):.1e}",
        f"{checked.energy.share:.0e}" if checked.energy is not None else "-",
        "; ".join(f"{way} to {end:.3g} s" for way, end in zip(("exact", "embedded"), ended, strict=True) if end is not None),
    )  # fmt: skip


@click.command()
@click.argument("files", nargs=-1, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--tolerance", default=1e-9, show_default=True, help="Of steps.")
@click.option("--loop-tolerance", default=1e-10, show_default=True, help="Of functions.")
def main(files: tuple[Path, ...], tolerance: float, loop_tolerance: float) -> None:
    """Print the table of FILES, by default of the project's models."""
    console = Console(highlight=False, width=180)
    console.print(provenance(), markup=False)
    table = Table("model", "scene", "unknowns", "operations", "fit, s", "evaluations", "run, ms", "times faster", "apart", "energy", "ends")
    for file in files or [Path("models") / f"{name}.yaml" for name in MODELS]:
        model = read_model(file)
        for scene in model.scenes.values():
            pair = compile_pair(model, scene, loop_tolerance)
            table.add_row(model.name, scene.name, *([pair] if isinstance(pair, str) else measure(pair, tolerance)))
    console.print(table)


if __name__ == "__main__":
    main()
