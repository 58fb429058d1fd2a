"""All measured points of a report as the data of one chart that filters, answers and tells of each point."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from statistics import median
from typing import Any

from cutjoint.methods import INTEGRATORS
from cutjoint_bench.findings import TARGETS, describe_setting, is_adaptive, timed
from cutjoint_bench.records import ASKED

Data = Mapping[str, Any]

#: The name of a group of contenders in the chart's filters.
KINDS = {
    "generated": "full model", "integrators": "full model", "reduced": "reduced model", "reductions": "reduced model", "peer": "peer",
    "functions": "embedded loops", "accuracy": "by accuracy", "auto": "method auto",
    "generic": "generic solver", "precision": "number types", "solvers": "linear solvers", "scalar": "without lanes",
}  # fmt: skip


def explore(cases: Sequence[Data]) -> dict[str, Any]:
    """The cases with a reference: of each line what it is filtered by, and its points.
    A point is (step, median of seconds, errors of position, velocity and outputs, setting, place on its line; s, m, m/s, m or rad).
    The step is None where steps are adaptive."""
    names = [": ".join(filter(None, (case["name"], case["title"]))) for case in cases]
    found = [{"name": name, "end": case["end"], "lines": list(_lines(case))} for name, case in zip(names, cases, strict=True)]
    return {"targets": list(TARGETS), "cases": [case for case in found if case["lines"]]}


def _lines(case: Data) -> Iterator[dict[str, Any]]:
    for line in case["lines"]:
        points = [
            [None if _has_no_step(line) else p["dt"], median(p["seconds"]), *map(_known, _errors(p)), describe_setting(line, p), p["dt"]]
            for p in timed(line) if any(map(_is_known, _errors(p)))
        ]  # fmt: skip
        if points:
            yield {"label": line["label"], **_facets(line), "own": line.get("dt"), "points": points}


def _errors(point: Data) -> list[float | None]:
    return [point["errors"].get(name) for name in ("position", "velocity", "outputs")]


def _has_no_step(line: Data) -> bool:
    return line["group"] in ASKED or is_adaptive(line)


def _known(error: float | None) -> float | None:
    return error if _is_known(error) else None


def _is_known(error: float | None) -> bool:
    return error is not None and isfinite(error) and error > 0


def _facets(line: Data) -> dict[str, str]:
    """Facets by which a line is filtered."""
    method, *rest = line["contender"].split("/")
    if line["group"] == "peer":
        return {"kind": KINDS["peer"], "method": method, "integrator": "the peer's"}
    if line["group"] == "auto":
        return {"kind": KINDS["auto"], "method": "chosen", "integrator": "chosen"}
    integrator = next((part for part in rest if part in INTEGRATORS), "the method's own")
    return {"kind": KINDS.get(line["group"], line["group"]), "method": method, "integrator": integrator}
