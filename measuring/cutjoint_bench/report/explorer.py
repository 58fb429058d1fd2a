"""All measured points of a report as the data of one chart that filters, answers and tells of each point."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from statistics import median
from typing import Any

from cutjoint.methods import INTEGRATORS
from cutjoint_bench.findings import TARGETS, timed

Data = Mapping[str, Any]

#: The name of a group of contenders in the chart's filters.
KINDS = {
    "generated": "full model", "integrators": "full model", "reduced": "reduced model", "reductions": "reduced model", "peer": "peer",
    "functions": "loops as functions",
    "generic": "generic solver", "precision": "number types", "solvers": "linear solvers", "scalar": "without lanes",
}  # fmt: skip


def explore(cases: Sequence[Data]) -> dict[str, Any]:
    """The cases with a reference: of each line what it is filtered by, and its points.
    A point is (step, median of seconds, errors of position and velocity; s, m, m/s)."""
    names = [": ".join(filter(None, (case["name"], case["title"]))) for case in cases]
    found = [{"name": name, "end": case["end"], "lines": list(_lines(case))} for name, case in zip(names, cases, strict=True)]
    return {"targets": list(TARGETS), "cases": [case for case in found if case["lines"]]}


def _lines(case: Data) -> Iterator[dict[str, Any]]:
    for line in case["lines"]:
        points = [
            [p["dt"], median(p["seconds"]), p["errors"]["position"], p["errors"]["velocity"]]
            for p in timed(line) if _is_known(p["errors"]["position"])
        ]  # fmt: skip
        if points:
            yield {"label": line["label"], **_facets(line), "own": line.get("dt"), "points": points}


def _is_known(error: float | None) -> bool:
    return error is not None and isfinite(error) and error > 0


def _facets(line: Data) -> dict[str, str]:
    """Facets by which a line is filtered."""
    method, *rest = line["contender"].split("/")
    if line["group"] == "peer":
        return {"kind": KINDS["peer"], "method": method, "integrator": "the peer's"}
    integrator = next((part for part in rest if part in INTEGRATORS), "the method's own")
    return {"kind": KINDS.get(line["group"], line["group"]), "method": method, "integrator": integrator}
