"""The tables of the kept report as Markdown, from which README and docs/bench.md take theirs: `make tables`."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import click

from cutjoint_bench.report.tables import (
    BenchTable,
    tabulate_limits,
    tabulate_lines,
    tabulate_paper,
    tabulate_parallel,
    tabulate_studies,
    tabulate_targets,
)
from cutjoint_bench.studies.report import PAGE


def tables_of(studies: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, BenchTable | None]]:
    """Each with its title; None where a report lacks what it shows."""
    cases = [case for data in studies.values() for case in data["cases"]]
    yield "studies", tabulate_studies(studies)
    yield "Table I", tabulate_paper(cases)
    yield "Table II", tabulate_parallel(cases)
    yield "the fixed point", tabulate_limits(cases)
    for name, data in studies.items():
        for case in data["cases"]:
            yield f"{name}: {case['name']}, at equal errors", tabulate_targets(case)
            yield f"{name}: {case['name']}, at the scene's own step", tabulate_lines(case)


def as_markdown(table: BenchTable) -> str:
    """A row a line."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (table.head, ("---",) * len(table.head), *table.rows))


@click.command()
def main() -> None:
    """Print them."""
    for title, table in tables_of(json.loads(PAGE.read_text(encoding="utf-8"))["studies"]):
        if table is not None:
            click.echo(f"## {title}\n\n{as_markdown(table)}\n")


if __name__ == "__main__":
    main()
