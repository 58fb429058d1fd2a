"""Tables of a bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from statistics import median
from typing import Any

from cutjoint_bench.findings import TARGETS, describe_setting, fastest_ours, fastest_peer, order, time_at, timed
from cutjoint_bench.measure import spread
from cutjoint_bench.paper import PAPER, PAPER_PARALLEL, PAPER_STIFF

Case = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class BenchTable:
    """Rows of texts under a head; the first column names, the others are numbers."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def milliseconds(seconds: float) -> str:
    """Three digits, without an exponent from 1000 ms on."""
    rounded = f"{1e3 * seconds:.3g}"
    return f"{float(rounded):.0f}" if float(rounded) >= 1000 else rounded


def size(value: float | None) -> str:
    """An error with two digits."""
    return "" if value is None or isnan(value) else f"{value:.1e}"


def tabulate_studies(studies: Mapping[str, Mapping[str, Any]]) -> BenchTable:
    """The machine of each study, and its parts that were measured with other code than that of this version."""
    rows = []
    for name, data in studies.items():
        outdated = data.get("outdated", [])
        rows.append((name, *(data["machine"][part] for part in ("processor", "system")), _some(outdated)))
    return BenchTable(head=("study", "processor", "system", "measured with other code than this version's"), rows=tuple(rows))


def tabulate_best(studies: Mapping[str, Mapping[str, Any]]) -> BenchTable | None:
    """Recommendations for a scene and an accuracy: the fastest of ours and its time, interpolated between measured points."""
    rows = []
    for name, data in studies.items():
        for case in data["cases"]:
            lines = [line for line in case["lines"] if "refused" not in line]
            found = [fastest_ours(lines, target) for target in TARGETS]
            if any(found):
                rows.append((f"{case['name']} ({name})", *(f"{best[0]}: {milliseconds(best[1])}" if best else "" for best in found)))
    head = ("fastest, and ms, at an error of", *(f"{target:.0e} m" for target in TARGETS))
    return BenchTable(head=head, rows=tuple(rows)) if rows else None


def _some(names: Sequence[str], most: int = 4) -> str:
    """The first names, the rest counted; the data has them all."""
    rest = f"; and {len(names) - most} more" if len(names) > most else ""
    return "; ".join(names[:most]) + rest or "nothing"


def tabulate_lines(case: Case) -> BenchTable:
    """Each contender at its scene's own step, its order, the largest step, and the digest of its code."""
    rows = []
    for line in case["lines"]:
        if "refused" in line:
            rows.append((line["label"], line["refused"], "", "", "", "", "", "", ""))
            continue
        at_scene = next((p for p in timed(line) if p["dt"] == line.get("dt")), None)
        limit = line.get("largest_step")
        rows.append((
            line["label"], *(_own(line, at_scene) if at_scene else ("fails",) + ("",) * 4),
            "" if isnan(found := order(line)) else f"{found:.2f}",
            f"{1e3 * limit:.3g}" if limit else "", line["configuration"].get("digest", "")[:8],
        ))  # fmt: skip
    head = ("contender", "setting", "time, ms", "position, m", "energy, rel.", "equations, m", "order", "largest step, ms", "code")
    return BenchTable(head=head, rows=tuple(rows))


def _own(line: Mapping[str, Any], point: Mapping[str, Any]) -> tuple[str, ...]:
    middle, half = spread(point["seconds"])
    errors = point["errors"]
    time = f"{milliseconds(middle)} ± {milliseconds(half)}"
    return (describe_setting(line, point), time, *(size(errors[name]) for name in ("position", "energy", "residual")))


def tabulate_targets(case: Case) -> BenchTable:
    """Time at equal accuracy, interpolated between measured points, and the best of ours beside the best peer."""
    lines = [line for line in case["lines"] if "refused" not in line]
    times = {line["label"]: [time_at(line, target) for target in TARGETS] for line in lines}
    rows = [
        (label, *("" if time is None else milliseconds(time) for time in found)) for label, found in times.items()
        if any(time is not None for time in found)
    ]  # fmt: skip
    ratios = []
    for target in TARGETS:
        ours, peer = fastest_ours(lines, target), fastest_peer(lines, target)
        ratios.append(f"{peer[1] / ours[1]:.1f}" if ours and peer else "")
    if any(ratios):
        rows.append(("best peer / best of ours", *ratios))
    return BenchTable(head=("time in ms at an error of", *(f"{target:.0e} m" for target in TARGETS)), rows=tuple(rows))


def tabulate_parallel(cases: Sequence[Case]) -> BenchTable | None:
    """The share of time that lanes save in generated code, beside what processors saved the paper; None without both kinds."""
    rows = []
    for case in cases:
        for method, paper in PAPER_PARALLEL.items():
            lanes, scalar = (_own_seconds(case, name) for name in (method, f"{method}/scalar"))
            if lanes and scalar:
                saved = f"{100 * (1 - lanes / scalar):.0f} %"
                rows.append((f"{case['name']}, {method}", saved, *(f"{share:g} %" for share in paper)))
    head = ("time saved", "ours, by lanes of one core", "paper, 2 processors", "3", "4")
    return BenchTable(head=head, rows=tuple(rows)) if rows else None


def _own_seconds(case: Case, contender: str) -> float | None:
    """The time of a contender at its scene's own step."""
    for line in case["lines"]:
        if line["contender"] == contender:
            return next((median(p["seconds"]) for p in timed(line) if p["dt"] == line["dt"]), None)
    return None


def tabulate_paper(cases: Sequence[Case]) -> BenchTable | None:
    """Our time at the paper's steps and our largest steps, beside Table I of the paper; None without its scenes."""
    rows = []
    for case in [c for i, c in enumerate(cases) if c["name"] not in {other["name"] for other in cases[:i]}]:
        for method, (seconds, dt) in PAPER.get(case["name"], {}).items():
            line = next((x for x in case["lines"] if x["contender"] == method and "refused" not in x), None)
            point = next((p for p in timed(line) if p["dt"] == dt), None) if line else None
            limit = line.get("largest_step") if line else None
            ours = (f"{milliseconds(median(point['seconds']))} ms", f"{seconds / median(point['seconds']):.0f}") if point else ("fails", "")
            rows.append((f"{case['scene']}, {method}", f"{1e3 * dt:g}", f"{seconds:g} s", *ours, f"{1e3 * limit:.3g}" if limit else ""))
    head = ("10 s of", "step, ms", "paper", "ours", "times faster", "our largest step, ms")
    return BenchTable(head=head, rows=tuple(rows)) if rows else None


def tabulate_stiff(cases: Sequence[Case]) -> BenchTable | None:
    """Costs of bumpers for each method, in time and in length of step, as Table III of the paper has it; None without its scenes."""
    stiff, soft = (next((c for c in cases if c["name"] == name), None) for name in PAPER_STIFF)
    if stiff is None or soft is None:
        return None
    rows = []
    for method in PAPER[stiff["name"]]:
        (paper, paper_dt), (paper_soft, paper_soft_dt) = (PAPER[case["name"]][method] for case in (stiff, soft))
        ours = [_own_seconds(case, method) for case in (stiff, soft)]
        limits = [_line_of(case, method).get("largest_step") for case in (stiff, soft)]
        rows.append((
            method, f"{paper / paper_soft:.2f}", f"{ours[0] / ours[1]:.2f}" if ours[0] and ours[1] else "",
            f"{paper_dt / paper_soft_dt:.2f}", f"{limits[0] / limits[1]:.2f}" if limits[0] and limits[1] else "",
        ))  # fmt: skip
    head = ("with bumpers over without", "time, paper", "time, ours, same steps", "step, paper", "largest step, ours")
    return BenchTable(head=head, rows=tuple(rows))


def _line_of(case: Case, contender: str) -> Mapping[str, Any]:
    return next((line for line in case["lines"] if line["contender"] == contender), {})


def tabulate_limits(cases: Sequence[Case]) -> BenchTable | None:
    """Limits up to which the map of the recursive method contracts, and the largest steps observed; None where nothing is predicted."""
    rows = {}
    for case in cases:
        for line in (x for x in case["lines"] if x.get("predicted")):
            found = line["predicted"]
            steps = (found["contracts"], line["largest_step"])
            rows[case["name"]] = (case["name"], *(f"{1e3 * step:.3g}" for step in steps), f"{found['time']:.2f}")
    head = ("scene", "contracts by itself below, ms", "observed, ms", "the narrowest at, s")
    return BenchTable(head=head, rows=tuple(rows.values())) if rows else None


def tabulate_configurations(cases: Sequence[Case]) -> list[tuple[str, str]]:
    """Configurations of the contenders, each once; with the cases where it differs between cases."""
    known: dict[str, dict[str, list[str]]] = {}
    for case in cases:
        for line in case["lines"]:
            if "configuration" in line:
                parts = [f"{name} {value}" for name, value in line["configuration"].items() if name not in ("digest", "runtime")]
                found = known.setdefault(line["label"], {}).setdefault(", ".join(parts), [])
                found += [case["name"]] if case["name"] not in found else []
    return [
        (f"{label} ({', '.join(names)})" if len(texts) > 1 else label, text)
        for label, texts in known.items() for text, names in texts.items()
    ]  # fmt: skip


def tabulate_situations(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Hard situations, each with its words and a table: a row for trials of one method with one expectation."""
    found: dict[str, dict[tuple[str, ...], list[Mapping[str, Any]]]] = {}
    words = {row["name"]: row["words"] for row in rows}
    for row in rows:
        figures = ", ".join(f"{name} {value:g}" for name, value in row["figures"].items())
        kind = (row["method"], row["precision"], "step on the pose" if row["lands"] else "", figures, row["because"])
        found.setdefault(row["name"], {}).setdefault(kind, []).append(row)
    head = ("method", "number type", "steps, ms", "outcome", "largest error, m", "as expected", "why")
    return [
        {"name": name, "words": words[name], "table": BenchTable(head=head, rows=tuple(_trials(*pair) for pair in kinds.items()))}
        for name, kinds in found.items()
    ]


def _trials(kind: tuple[str, ...], rows: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    method, precision, lands, figures, because = kind
    steps = sorted(1e3 * row["dt"] for row in rows)
    tried = f"{steps[0]:.4g}" if len(steps) == 1 else f"{len(steps)} from {steps[0]:.4g} to {steps[-1]:.4g}"
    count = {outcome: sum(row["outcome"] == outcome for row in rows) for outcome in dict.fromkeys(row["outcome"] for row in rows)}
    outcomes = ", ".join(f"{n} {outcome}" if len(rows) > 1 else outcome for outcome, n in count.items())
    errors = [row["position"] for row in rows if row.get("position") is not None]
    met = sum(row["as_expected"] for row in rows)
    what = ", ".join(part for part in (tried, lands, figures) if part)
    return (method, precision, what, outcomes, size(max(errors)) if errors else "", f"{met} of {len(rows)}", because)
