"""Tables of an atlas: what makes the case hard, and why runs do not converge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from typing import Any

from cutjoint_bench.failures.reasons import Reason, find_reasons
from cutjoint_bench.report.tables import BenchTable

Atlas = Mapping[str, Any]

#: Letters of a message at most.
_LETTERS = 160


def tabulate_conditions(atlas: Atlas) -> BenchTable | None:
    """The fastest mode, the pose closest to a singular one, and parts without mass, a row a value of the parameter; None if unknown."""
    found = atlas.get("conditions")
    if not found:
        return None
    name = f"{atlas['axes']['parameter']} [{atlas['axes']['unit'] or '1'}]" if atlas["axes"]["parameter"] else "case"
    rows = [(_value(value, atlas["name"]), *_condition(c)) for value, c in zip(atlas["axes"]["value"], found, strict=True)]
    head = (name, "fastest eigenvalue, 1/s", "its period, ms", "at, s", "closest to a singular pose", "at, s", "without mass")
    return BenchTable(head=head, rows=tuple(rows))


def _value(value: float | None, name: str) -> str:
    return name if value is None else f"{value:g}"


def _condition(of: Mapping[str, Any]) -> tuple[str, ...]:
    rate, closeness, massless = of["rate"], of["closeness"], list(of["massless"])
    mode = (f"{rate:.3g}", f"{2e3 * pi / rate:.3g}", f"{of['rate_time']:.3g}") if rate else ("none", "", "")
    pose = (f"{closeness:.2g}", f"{of['closest_time']:.3g}") if closeness is not None else ("no loops", "")
    return (*mode, *pose, ", ".join(massless[:4]) + (f" and {len(massless) - 4} more" if len(massless) > 4 else "") or "none")


def tabulate_reasons(atlas: Atlas) -> BenchTable | None:
    """Why runs do not converge, a row a method, number type, outcome and reason; None if all converge."""
    rows = tuple(_reason(reason, atlas) for reason in find_reasons(atlas))
    head = ("method, number type", "outcome", "reason", "runs", "steps, ms", _varied(atlas), "a run says")
    return BenchTable(head=head, rows=rows) if rows else None


def _varied(atlas: Atlas) -> str:
    return str(atlas["axes"]["parameter"]) or "penalty, N/m"


def _reason(reason: Reason, atlas: Atlas) -> tuple[str, ...]:
    axis = "value" if atlas["axes"]["parameter"] else "penalty"
    steps = _range([1e3 * c["dt"] for c in reason.cells])
    given = [c[axis] for c in reason.cells if c[axis] is not None]
    own = ["own"] if len(given) < len(reason.cells) else []
    varied = ", ".join([*own, *([_range(given)] if given else [])])
    message = reason.message if len(reason.message) <= _LETTERS else f"{reason.message[:_LETTERS]} ..."
    return (f"{reason.method}, {reason.precision}", reason.outcome, reason.words, str(len(reason.cells)), steps, varied, message)


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
