"""Compiler flags for generated code: time of an evaluation of the Iltis under each, in turns.  `make flags`."""

from __future__ import annotations

import shlex
from pathlib import Path
from statistics import median

import click
from rich.console import Console
from rich.table import Table

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.simulation import simulate
from cutjoint_bench.studies.provenance import provenance

FLAGS = ("-O3 -march=native", "-O2 -march=native", "-O1 -march=native", "-O3 -march=native -ffast-math", "-O3 -mavx2 -mfma", "-O3")


@click.command()
@click.option("--model", type=click.Path(exists=True, path_type=Path), default=Path("models/iltis.yaml"), show_default=True)
@click.option("--scene", default="simul1", show_default=True)
@click.option("--repetitions", default=7, show_default=True)
def main(model: Path, scene: str, repetitions: int) -> None:
    """Print the least, the median and the largest time of an evaluation for each set of flags."""
    artifacts = {flags: compile_model(model, scene=scene, flags=tuple(shlex.split(flags))) for flags in FLAGS}
    times: dict[str, list[float]] = {flags: [] for flags in FLAGS}
    for _ in range(repetitions):
        for flags, artifact in artifacts.items():
            run = simulate(artifact, dt=0.001, error=False)
            times[flags].append(1e6 * run.seconds / run.evaluations)
    table = Table("flags", "least, us", "median, us", "largest, us", title=f"{model.stem}, {scene}", box=None)
    for flags, found in times.items():
        table.add_row(flags, f"{min(found):.3f}", f"{median(found):.3f}", f"{max(found):.3f}")
    console = Console(highlight=False, width=140)
    console.print(f"{provenance(())}; {repetitions} runs in turns", markup=False)
    console.print(table)


if __name__ == "__main__":
    main()
