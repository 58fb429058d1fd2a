"""Integrators of a method that choose their steps beside each other: evaluations, factorisations, errors at equal tolerances, as Markdown.

Counts, not times: they are the same on any machine.  Models are interpreted, events located.  Errors are the largest of places and angles
(m, rad) beside dormand-prince of the method recursive at a tolerance of 1e-13, or at the smallest with which the run comes to its end.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import DEFAULT_METHOD, INTEGRATORS, METHODS, names_of
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate
from cutjoint.topology.reading import read_model
from cutjoint_bench.studies.loops import apart

TOLERANCES = {"recursive": (1e-6, 1e-9, 1e-12), "recursive-newton": (1e-3, 1e-5, 1e-7, 1e-9)}
TRUTHS = (1e-13, 1e-12, 1e-11)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A model's scene, the only one if none is named, and the end of its run (s)."""

    model: str
    end: float
    scene: str | None = None

    @property
    def text(self) -> str:
        """The name in the table."""
        return f"{self.model}{f', {self.scene}' if self.scene else ''}, {self.end:g} s"


#: Smooth motions, a stiff one, one with a singular pose at 0.714 s, and ones with events.
CASES = (
    Case(model="pendulum", end=10.0), Case(model="press", end=2.0), Case(model="four_bar", end=0.6), Case(model="four_bar", end=2.0),
    Case(model="slider_crank", end=5.0), Case(model="andrews", end=0.05), Case(model="delta", end=1.0), Case(model="flyball", end=2.0),
    Case(model="excavator", end=2.0), Case(model="leg", end=1.0), Case(model="iltis", scene="simul1", end=3.0),
)  # fmt: skip


def run(artifact: Artifact, case: Case, integrator: str, tolerance: float) -> Trajectory:
    """A run of a case."""
    return simulate(artifact, integrator=integrator, tolerance=tolerance, end=case.end, error=False, check=False)


def rows(case: Case, folder: Path, method: str) -> list[str]:
    """The rows of a case: a tolerance each."""
    model = read_model(folder / f"{case.model}.yaml")
    scene = find_scene(model, case.scene)
    exact, artifact = (compile_interpreted(model, scene, method=name) for name in (DEFAULT_METHOD, method))
    truths = (run(exact, case, "dormand-prince", tolerance) for tolerance in TRUTHS)
    truth = next((found for found in truths if found.failure is None), None)
    made = []
    for tolerance in TOLERANCES[method]:
        cells = [case.text, f"{tolerance:.0e}".replace("e-0", "e-")]
        for integrator in integrators(method):
            found = run(artifact, case, integrator, tolerance)
            counts = [found.evaluations, *([found.statistics.factorisations] if METHODS[method].has_system else [])]
            cells += [*map(str, counts), "stops" if found.failure else "-" if truth is None else f"{apart(found, truth):.1e}"]
        made.append(f"| {' | '.join(cells)} |".replace("e-0", "e-"))
    return made


def integrators(method: str) -> tuple[str, ...]:
    """Integrators of a method alone that choose their steps."""
    return names_of(INTEGRATORS, lambda i: i.adaptive and i.methods == (method,))


@click.command()
@click.argument("names", nargs=-1)
@click.option("--models", default=Path("models"), type=click.Path(path_type=Path), show_default=True, help="The folder of the models.")
@click.option("--method", default=DEFAULT_METHOD, type=click.Choice(list(TOLERANCES)), show_default=True, help="That of the integrators.")
def main(names: tuple[str, ...], models: Path, method: str) -> None:
    """Print the rows of models NAMES, by default of all."""
    counts = "evaluations | factorisations" if METHODS[method].has_system else "evaluations"
    heads = [f"`{name}`: {counts} | error" for name in integrators(method)]
    click.echo(f"| run | `tolerance` | {' | '.join(heads)} |")
    click.echo(f"|{'---|' * (2 + sum(head.count(' | ') + 1 for head in heads))}")
    for case in CASES:
        if not names or case.model in names:
            click.echo("\n".join(rows(case, models, method)))


if __name__ == "__main__":
    main()
