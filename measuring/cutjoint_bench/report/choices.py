"""The choices of a case, and what accuracies keep, as rows of its page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from cutjoint_bench.findings import timed
from cutjoint_bench.report.tables import BenchTable, milliseconds, size

#: Why the method auto has no command.
_NO_END = "no command: method auto takes the scene's own end alone, without --end"

Case = Mapping[str, Any]
Row = Mapping[str, Any]

#: The names of errors that choices compare.
ERRORS = {"outputs": "the scene's outputs {outputs}, m or rad", "position": "the position of a body, m"}


def describe_choices(case: Case) -> dict[str, Any] | None:
    """The choices at each error, with the words, time, error and command line of each; None where a case has none."""
    found = [{"target": f"{c['target']:.0e}", "rows": list(_rows(c))} for c in case.get("choices", ())]
    found = [choice for choice in found if choice["rows"]]
    if not found:
        return None
    kind = next(c["error_of"] for c in case["choices"])
    return {"of": ERRORS[kind].format(outputs=_listed(case["watched"])), "targets": found}


def _listed(names: Sequence[str], most: int = 6) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _rows(choice: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    fastest, unnamed, asked, auto = (choice[name] for name in ("fastest", "unnamed", "accuracy", "auto"))
    if fastest:
        yield _cells(f"Fastest: {fastest['label']}, {fastest['setting']}", fastest, fastest)
    if unnamed:
        yield _cells(f"Faster, without a command of its own: {unnamed['label']}, {unnamed['setting']}", unnamed, fastest)
    if asked:
        yield _cells(f"By accuracy: {asked['label'].removesuffix(', by accuracy')}", asked, fastest)
    if auto:
        yield _cells(f"Method auto: {auto['about'].get('chosen', 'no choice')}", auto, fastest, _NO_END)


def _cells(words: str, row: Row, fastest: Row | None, without: str = "") -> dict[str, str]:
    """The cells of a row; notes say what a reader has to know beside its numbers."""
    notes = [] if row["within"] or row["failure"] else ["its error is larger than asked for"]
    notes += [row["failure"]] if row["failure"] else []
    notes += [without] if without and not row["command"] else []
    if row["about"].get("estimated") is not None:
        notes.append(f"estimated error {size(row['about']['estimated'])}; {milliseconds(row['about']['waited'])} ms with all its runs")
    if row["about"].get("kept") is False:
        notes.append("it says that the accuracy was not reached")
    times = ""
    if row["seconds"] and fastest and fastest["seconds"] and row is not fastest:
        times = f" ({row['seconds'] / fastest['seconds']:.2g} ×)"
    time = f"{milliseconds(row['seconds'])}{times}" if row["seconds"] else ""
    return {"words": words, "notes": "; ".join(notes), "time": time, "error": size(row["error"]), "command": row["command"]}


def tabulate_accuracies(case: Case) -> BenchTable | None:
    """The accuracies that were asked for beside estimated and true errors of the same runs; None where there are none."""
    rows = [(line["label"].removesuffix(", by accuracy"), *_asked(p)) for line in asked_lines(case) for p in timed(line)]
    head = ("by accuracy", "asked", "estimated", "true", "estimated / true", "kept", "last run, ms", "all runs, ms", "steps")
    return BenchTable(head=head, rows=tuple(rows)) if rows else None


def _asked(point: Row) -> tuple[str, ...]:
    about, true = point["about"], point["errors"]["outputs"]
    estimated = about["estimated"]
    ratio = f"{estimated / true:.2g}" if true and estimated is not None else ""
    times = (milliseconds(median(point["seconds"])), milliseconds(about["waited"]))
    return (f"{point['dt']:.0e}", size(estimated), size(true), ratio, _kept(point, true), *times, str(point["steps"]))


def _kept(point: Row, true: float | None) -> str:
    if not point["about"]["kept"]:
        return "not promised"
    return "" if true is None else "yes" if true <= point["dt"] else "no"


def asked_lines(case: Case) -> list[Mapping[str, Any]]:
    """The lines of runs to an accuracy."""
    return [line for line in case["lines"] if line["group"] == "accuracy" and "refused" not in line]
