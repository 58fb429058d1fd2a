"""The part of the studies for README and docs, small enough to be held by git: tables, and the fastest points beside the peers'."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from cutjoint_bench.findings import TARGETS, Spot, fastest_spot
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

    ``tables`` have a title, a head and rows of texts.  ``fastest`` has, by study and case, the fastest point of ours and of a peer at each
    error of TARGETS that both reach: contender, step (s), seconds, error (m).
    """
    tables = [{"title": title, "head": table.head, "rows": table.rows} for title, table in _tables(studies) if table is not None]
    fastest = {name: {case["name"]: list(_beside(case["lines"])) for case in data["cases"]} for name, data in studies.items()}
    met = {name: {case: rows for case, rows in cases.items() if rows} for name, cases in fastest.items()}
    return {"tables": tables, "fastest": {name: cases for name, cases in met.items() if cases}}


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


def _beside(lines: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    for error in TARGETS:
        ours, peer = (fastest_spot(lines, error, peers=peers) for peers in (False, True))
        if ours is not None and peer is not None:
            yield {"error": error, "ours": ours._asdict(), "peer": peer._asdict()}


def fastest_of(summary: Mapping[str, Any], study: str, case: str) -> list[tuple[float, Spot, Spot]]:
    """The errors (m) of a case in a summary with the fastest point of ours and of a peer."""
    rows = summary["fastest"].get(study, {}).get(case, ())
    return [(row["error"], Spot(**row["ours"]), Spot(**row["peer"])) for row in rows]
