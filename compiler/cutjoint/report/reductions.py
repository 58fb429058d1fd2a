"""Tables of reduced models for the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf

from rich.table import Table

from cutjoint.model.records import Scene
from cutjoint.reduce.choose import Candidate, Choice
from cutjoint.reduce.measure import Cost
from cutjoint.reduce.sequence import ReducedModel


def _table(title: str, headings: Sequence[str], left: int) -> Table:
    table = Table(title=title, title_justify="left", box=None)
    for i, heading in enumerate(headings):
        table.add_column(heading, justify="left" if i < left else "right")
    return table


def reduction_table(variants: Sequence[ReducedModel], costs: Sequence[Cost]) -> Table:
    """One row a model: the rest of the model, its cost, and its distance from the full one."""
    full = variants[0]
    headings = ("model", "motion", "unknowns", "equations", "ops", "share", "ms", "faster", "error")
    table = _table(f"{full.model.name}, scene {full.scene.name}, method {full.method}", headings, 2)
    for variant, cost in zip(variants, costs, strict=True):
        table.add_row(
            variant.name, variant.motion, str(variant.unknowns), str(variant.equations), str(variant.operations),
            f"{100 * variant.operations / full.operations:.0f} %", f"{1e3 * cost.seconds:.2f}",
            "-" if cost.failure else f"{costs[0].seconds / cost.seconds:.2f}",
            cost.failure or (f"{cost.error:.1e}" if variant is not full else "-"),
        )  # fmt: skip
    return table


def note_lines(variant: ReducedModel) -> Iterator[str]:
    """The notes of a reduced model, done ones first, each with its place in the file."""
    yield from (f"{note.span}: '{note.element}' {note.words}" for note in (*variant.done, *variant.left))


def choice_table(choice: Choice, scene: Scene) -> Table:
    """A table of the choice beside the other candidates."""
    title = f"scene {scene.name}: the fastest within {scene.tolerance:g} m and rad (the truth still moves by {choice.settled:.0e})"
    table = _table(title, ("", "method", "model", "dt / ms", "error", "ms", "of real time"), 3)
    for candidate in choice.evidence:
        table.add_row("picked" if candidate == choice.picked else "", candidate.method, candidate.variant, *_figures(candidate, scene))
    return table


def _figures(candidate: Candidate, scene: Scene) -> tuple[str, ...]:
    if candidate.failure:
        found = f"{candidate.error:.1e}" if candidate.error < inf else "-"
        return "-", found, "-", candidate.failure.splitlines()[0]
    speed = f"{scene.end / candidate.seconds:.0f} times"
    return f"{1e3 * candidate.dt:.4g}", f"{candidate.error:.1e}", f"{1e3 * candidate.seconds:.3g}", speed
