"""Gains by longer numbers, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cutjoint_bench.findings import breakdown, price, timed

Line = Mapping[str, Any]


def describe_precisions(lines: Sequence[Line]) -> list[str]:
    """Of each method in several number types: where small steps break down, whether more digits cure that, and what they cost."""
    methods: dict[str, dict[str, Line]] = {}
    for line in (x for x in lines if x["group"] == "precision"):
        method, _, kind = line["contender"].partition("/")
        methods.setdefault(method, {})[kind] = line
    return [sentence for method, kinds in methods.items() if "double" in kinds for sentence in _describe(method, kinds)]


def _describe(method: str, kinds: Mapping[str, Line]) -> list[str]:
    found = [f"{kind} {_holds(line)}" for kind, line in kinds.items()]
    return [f"{method}, small steps: {', '.join(found)}. {_verdict(kinds)}", *_prices(method, kinds)]


def _holds(line: Line) -> str:
    smallest = f"{_ms(_smallest(line))}, the smallest step tried"
    if not _ends(line):
        return f"fails at every step tried, {_ms(max(p['dt'] for p in line['points']))} to {_ms(_smallest(line))}"
    broken = breakdown(line)
    return f"holds down to {smallest}" if broken is None else f"breaks down from {_ms(broken)} on"


def _verdict(kinds: Mapping[str, Line]) -> str:
    """A sentence on longer types at the step at which double does not hold."""
    at = breakdown(kinds["double"])
    if at is None:
        return "Double leaves nothing for more digits to cure."
    longer = [kind for kind, line in kinds.items() if kind not in ("single", "double") and _smallest(line) <= at and _ends(line)]
    broken = {kind: breakdown(kinds[kind]) for kind in longer}
    cured = [kind for kind, dt in broken.items() if dt is None or dt < at]
    if not cured:
        return "More digits do not cure it."
    whole = [kind for kind in cured if broken[kind] is None]
    more = f" (down to the smallest step tried: {', '.join(whole)})" if whole else ""
    return f"More digits cure it at that step: {', '.join(cured)}{more}."


def _ends(line: Line) -> bool:
    """True if any of its runs comes to the end."""
    return any(True for _ in timed(line))


def _smallest(line: Line) -> float:
    return min(float(p["dt"]) for p in line["points"])


def _prices(method: str, kinds: Mapping[str, Line]) -> list[str]:
    found = [(kind, price(line, kinds["double"])) for kind, line in kinds.items() if kind != "double"]
    known = [f"{kind} {ratio:.3g}" for kind, ratio in found if ratio is not None]
    return [f"Time of {method} at equal steps, over that in double: {', '.join(known)}."] if known else []


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:g} ms"
