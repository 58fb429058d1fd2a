"""Everything that the project claims of the Iltis, in one command: `make bench`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from cutjoint.analysis.mobility import Mobility
from cutjoint_bench.studies import iltis_figures as measure
from cutjoint_bench.studies.iltis_figures import Compared, Difference, Peak, Provenance, Race, spread

#: Columns of a terminal that the tables need.
WIDTH = 132


@dataclass(frozen=True, kw_only=True)
class Figures:
    """All that one run of the benchmark finds."""

    provenance: Provenance
    counts: Mobility
    equilibrium: list[Compared]
    references: list[Difference]
    races: list[Race]
    steps: list[Peak]
    speeds: list[Peak]


@click.command()
@click.option("--repetitions", type=click.IntRange(min=1), default=11, show_default=True, help="Timed runs a scene and implementation.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file for all figures.")
def main(repetitions: int, out: Path | None) -> None:
    """Measure the Iltis and print the figures beside the published ones."""
    figures = measure_all(repetitions)
    console = Console(highlight=False)
    console.width = max(console.width, WIDTH)
    for title, table in tables(figures):
        console.print(title, style="bold", markup=False)
        console.print(table)
        console.print()
    if out is not None:
        out.write_text(json.dumps(as_data(figures), indent=2) + "\n", encoding="utf-8")


def measure_all(repetitions: int) -> Figures:
    """Build everything, then compute, then time."""
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("compiling", total=None)
        scenes = measure.compile_scenes()
        simul1 = scenes["simul1"][measure.GENERATED]
        bar.update(task, description="comparing")
        equilibrium, references = measure.measure_equilibrium(), measure.compare_with_references()
        steps, speeds = measure.measure_steps(simul1), measure.measure_speeds(simul1)
        bar.update(task, description="timing", total=repetitions * len(scenes), completed=0)
        races = [measure.race(name, artifacts, repetitions, lambda: bar.advance(task)) for name, artifacts in scenes.items()]
    return Figures(
        provenance=measure.provenance(simul1, repetitions), counts=measure.find_counts(simul1), equilibrium=equilibrium,
        references=references, races=races, steps=steps, speeds=speeds,
    )  # fmt: skip


def as_data(figures: Figures) -> dict[str, Any]:
    """The figures as plain data, with what is derived from the timed runs."""
    data = asdict(figures)
    data["counts"]["degrees_of_freedom"] = figures.counts.degrees_of_freedom
    for record, race in zip(data["races"], figures.races, strict=True):
        record["seconds_an_evaluation"] = {name: spread(race.evaluation_times(name)) for name in race.seconds}
        record["real_time_factor"] = {name: spread(race.real_time_factors(name)) for name in race.seconds}
        record["over_generated"] = {name: {**spread(race.ratios(name)), "of_least": race.ratio_of_least(name)} for name in race.seconds}
    return data


def tables(figures: Figures) -> Iterable[tuple[str, Table]]:
    """Titles and tables that are printed."""
    yield "Iltis", provenance_table(figures)
    yield "static equilibrium of the standing car; pitch is positive nose down", equilibrium_table(figures.equilibrium)
    title = "largest differences from the IAVSD trajectories, dt 1 ms, angles and loads in the reference's terms"
    yield title, references_table(figures.references)
    yield "10 s at 5 m/s at the paper's steps; accelerations of the chassis, gravity not counted", scenes_table(figures.races)
    yield "one core: generated code, the same without lanes, the generic solver, in turns; median (min .. max)", race_table(figures.races)
    yield "simul1: peak vertical acceleration over the step, speed 5 m/s", peaks_table("dt, ms", [(p.dt * 1e3, p) for p in figures.steps])
    title = "simul1: the same over the speed, dt 1 ms (an independent pitch-plane model: 5.05 g at 5 m/s; the paper: up to 5 g)"
    yield title, peaks_table("speed, m/s", [(p.speed, p) for p in figures.speeds])


def provenance_table(figures: Figures) -> Table:
    """Machine, compiler, counts."""
    p, counts = figures.provenance, figures.counts
    digests: dict[str, list[str]] = {}
    for race in figures.races:
        digests.setdefault(race.source, []).append(race.scene)
    table = _table("", "")
    table.show_header = False
    for name, value in (
        ("coordinates", str(counts.speeds)),
        ("cut-joint equations", f"{counts.equations}, rank {counts.rank}"),
        ("degrees of freedom", str(counts.degrees_of_freedom)),
        ("machine", p.machine),
        ("compiler", f"{p.compiler}, {p.flags}"),
        ("cutjoint", f"{p.cutjoint}, runtime {p.runtime}"),
        ("generated source", ", ".join(f"{digest} ({', '.join(scenes)})" for digest, scenes in digests.items())),
        ("timed runs", f"{p.repetitions} a scene and implementation, in turns"),
    ):
        table.add_row(name, value)
    return table


def equilibrium_table(rows: Sequence[Compared]) -> Table:
    """The equilibrium beside the published one."""
    table = _table("quantity", "found", "published", "unit")
    for r in rows:
        digits = {"mm": 3, "deg": 4}.get(r.unit, 2)
        table.add_row(r.quantity, f"{r.found:.{digits}f}", f"{r.published:.{digits}f}", r.unit)
    return table


def references_table(rows: Sequence[Difference]) -> Table:
    """Largest differences from the published trajectories."""
    table = _table("scene", "quantity", "difference", "reference's range", "unit")
    for r in rows:
        scale = r.range if r.range > 1e-9 else 0.0  # y, roll and yaw of a symmetric run are rounding
        table.add_row(r.scene, r.quantity, f"{r.difference:.2g}", f"{scale:.4g}", r.unit)
    return table


def scenes_table(races: Sequence[Race]) -> Table:
    """The paper's scenes at the paper's steps."""
    table = _table("scene", "dt, ms", "operations", "instructions", "evaluations a step", "peak az, g", "at 0.5 ms", "peak ay, g")
    for r in races:
        figures = [f"{r.dt * 1e3:g}", str(r.operations), str(r.instructions), f"{r.evaluations[measure.GENERATED] / r.steps:.1f}"]
        table.add_row(r.scene, *figures, *(f"{x:.2f}" for x in (r.peak_az, r.fine_az, r.peak_ay)))
    return table


def race_table(races: Sequence[Race]) -> Table:
    """Implementations against each other."""
    table = _table("scene", "implementation", "us an evaluation", "times real time", "over generated", "of the least", "heights apart, m")
    for r in races:
        for name in r.seconds:
            against = (_spread(r.ratios(name), 2), f"{r.ratio_of_least(name):.2f}", f"{r.apart[name]:.0e}")
            times = (_spread([1e6 * x for x in r.evaluation_times(name)], 2), _spread(r.real_time_factors(name), 0))
            table.add_row(r.scene, name, *times, *(against if name != measure.GENERATED else ()))
    return table


def peaks_table(heading: str, rows: Iterable[tuple[float, Peak]]) -> Table:
    """Peak accelerations over one figure."""
    table = _table(heading, "peak az, g", "at x, m")
    for value, peak in rows:
        table.add_row(f"{value:g}", f"{peak.peak_az:.2f}", f"{peak.x:.2f}")
    return table


def _spread(values: Sequence[float], digits: int) -> str:
    s = spread(values)
    return f"{s['median']:.{digits}f} ({s['min']:.{digits}f} .. {s['max']:.{digits}f})"


def _table(*headings: str) -> Table:
    table = Table(box=None)
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("scene", "implementation", "quantity", "unit", "") else "right")
    return table


if __name__ == "__main__":
    main()
