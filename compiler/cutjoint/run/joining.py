"""Two parts of a run that two programs have made, the second from where the first has ended."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: The numbers of a summary that add up; of impacts and of jumps beside rows the lists do.
_SUMS = frozenset((
    "steps", "rows", "seconds", "evaluations", "iterations", "factorisations", "substeps", "pivoting_fallbacks", "rejected", "events",
    "stiff_steps", "impacts", "near_jumps",
))  # fmt: skip


def joined(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """The summary of both parts, which ends as the second does.

    The defect of work and energy is at most the sum of both.
    """
    return {**_without_end(first), **second, **{name: _both(name, first, second) for name in first.keys() & second.keys()}}


def _both(name: str, first: Mapping[str, Any], second: Mapping[str, Any]) -> Any:
    one, other = first[name], second[name]
    if name in _SUMS:
        return one + other
    if name == "residuals":
        return {key: _largest(one.get(key), other[key]) for key in other}
    if name == "events_by_element":
        return {key: one.get(key, 0) + other.get(key, 0) for key in sorted({*one, *other})}
    if name == "energy":
        added = {key: None if None in (one[key], other[key]) else one[key] + other[key] for key in ("exchanged", "defect")}
        return {key: _largest(one[key], other[key]) for key in other} | added
    return list(dict.fromkeys((*one, *other))) if name == "undetermined" else other


def _without_end(summary: Mapping[str, Any]) -> dict[str, Any]:
    """A summary without what tells how its run has failed."""
    ends = ("message", "time", "step", "element", "residual", "advice", "guards", "kept")
    return {name: value for name, value in summary.items() if name not in ends}


def _largest(one: float | None, other: float | None) -> float | None:
    """The larger number; None if one is none that is finite."""
    return None if one is None or other is None else max(one, other)
