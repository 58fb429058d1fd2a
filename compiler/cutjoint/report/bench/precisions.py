"""What longer numbers buy, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cutjoint.bench.findings import breakdown, price

Line = Mapping[str, Any]


def describe_precisions(lines: Sequence[Line]) -> list[str]:
    """Of each method in several number types: where small steps break down, whether more digits cure that, and what they cost."""
    methods: dict[str, dict[str, Line]] = {}
    for line in (x for x in lines if x["group"] == "precision"):
        method, _, kind = line["contender"].partition("/")
        methods.setdefault(method, {})[kind] = line
    return [sentence for method, kinds in methods.items() if "double" in kinds for sentence in _describe(method, kinds)]


def _describe(method: str, kinds: Mapping[str, Line]) -> list[str]:
    broken = {kind: breakdown(line) for kind, line in kinds.items()}
    steps = {kind: min(p["dt"] for p in line["points"]) for kind, line in kinds.items()}
    found = [f"{kind} {_holds(dt, steps[kind])}" for kind, dt in broken.items()]
    return [f"{method}, small steps: {', '.join(found)}. {_verdict(broken, steps)}", *_prices(method, kinds)]


def _holds(broken: float | None, smallest: float) -> str:
    return f"holds down to {_ms(smallest)}" if broken is None else f"breaks down from {_ms(broken)} on"


def _verdict(broken: Mapping[str, float | None], steps: Mapping[str, float]) -> str:
    """Whether longer types hold at the step at which double does not."""
    at = broken["double"]
    if at is None:
        return "There is nothing for more digits to cure."
    longer = [kind for kind in broken if kind not in ("single", "double") and steps[kind] <= at]
    cured = [kind for kind in longer if (dt := broken[kind]) is None or dt < at]
    if not cured:
        return "More digits do not cure it."
    whole = [kind for kind in cured if broken[kind] is None]
    more = f" (down to the smallest step tried: {', '.join(whole)})" if whole else ""
    return f"More digits cure it at that step: {', '.join(cured)}{more}."


def _prices(method: str, kinds: Mapping[str, Line]) -> list[str]:
    found = [(kind, price(line, kinds["double"])) for kind, line in kinds.items() if kind != "double"]
    known = [f"{kind} {ratio:.3g}" for kind, ratio in found if ratio is not None]
    return [f"Time of {method} at equal steps, over that in double: {', '.join(known)}."] if known else []


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:g} ms"
