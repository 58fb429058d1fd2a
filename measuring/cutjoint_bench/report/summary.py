"""The part of the studies for README and docs, small enough to be held by git: their tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from cutjoint_bench.report.tables import (
    BenchTable,
    tabulate_best,
    tabulate_limits,
    tabulate_lines,
    tabulate_paper,
    tabulate_parallel,
    tabulate_studies,
    tabulate_targets,
)

Studies = Mapping[str, Mapping[str, Any]]


def summarise(studies: Studies) -> dict[str, Any]:
    """The summary of what `study.perform` returned for each study, by its name, as plain data for JSON.

    ``tables`` have a title, a head and rows of texts.
    """
    return {"tables": [{"title": title, "head": table.head, "rows": table.rows} for title, table in _tables(studies) if table is not None]}


def _tables(studies: Studies) -> Iterator[tuple[str, BenchTable | None]]:
    """Each with its title; None where a report lacks what it shows."""
    cases = [case for data in studies.values() for case in data["cases"]]
    yield "studies", tabulate_studies(studies)
    yield "what to take", tabulate_best(studies)
    yield "Table I", tabulate_paper(cases)
    yield "Table II", tabulate_parallel(cases)
    yield "the fixed point", tabulate_limits(cases)
    for name, data in studies.items():
        for case in data["cases"]:
            yield f"{name}: {case['name']}, at equal errors", tabulate_targets(case)
            yield f"{name}: {case['name']}, at the scene's own step", tabulate_lines(case)
