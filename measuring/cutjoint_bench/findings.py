"""Findings of the measurements: orders of convergence, time at an accuracy, the best contender."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import exp, log
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from cutjoint.methods import INTEGRATORS, names_of
from cutjoint_bench.cutjoint_contenders import tolerance_of
from cutjoint_bench.export.peers import PEERS
from cutjoint_bench.records import ASKED

Line = Mapping[str, Any]

#: Errors of position (m) at which contenders are compared.
TARGETS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)

#: An order is read from three neighbouring steps whose two slopes differ by at most this much.  Elsewhere terms of other powers of the
#: step contribute, too.
_ALIKE = 0.3


def timed(line: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The points of a line that reached the end."""
    return (p for p in line.get("points", ()) if not p["failure"] and p["seconds"])


def describe_setting(line: Line, point: Mapping[str, Any]) -> str:
    """The setting of a point in words: the accuracy that it was asked for, a tolerance where steps are adaptive, else the step."""
    size = float(point["dt"])
    if line["group"] in ASKED:
        return f"accuracy {size:g}"
    own = line.get("dt")
    return f"tolerance {tolerance_of(size, own):.3g}" if own and is_adaptive(line) else f"step {1e3 * size:.6g} ms"


def is_adaptive(line: Line) -> bool:
    """True if the integrator of a line takes steps of its own."""
    name, _, rest = line["contender"].partition("/")
    known = PEERS[name].adaptive if name in PEERS else names_of(INTEGRATORS, lambda i: i.adaptive)
    return any(part in known for part in rest.split("/"))


def order(line: Line) -> float:
    """The order of convergence: the slope of log error over log step at the three smallest steps that show it; NaN if none do.

    Small steps at which a line flattens out are left out.  Of such a line, so are all errors within a decade of its least one: rounding,
    the reference or the tolerance of the iteration contribute to them.
    """
    points = [(log(p["dt"]), log(p["errors"]["position"])) for p in timed(line) if p["errors"]["position"]]
    points.sort()
    count = len(points)
    floor = min((error for _, error in points), default=0.0)
    while len(points) > 1 and _flattens(points):
        del points[0]
    if len(points) < count:
        points = [p for p in points if p[1] > floor + log(10)]
    for three in zip(points, points[1:], points[2:], strict=False):
        slopes = _slopes(three)
        if min(slopes) > 0.5 and abs(slopes[0] - slopes[1]) <= _ALIKE:
            x, y = np.array(three).T
            return float(np.polyfit(x, y, 1)[0])
    return float("nan")


def _flattens(points: Sequence[tuple[float, float]]) -> bool:
    """True if the smallest step meets rounding or the reference: its error hardly falls, or falls clearly less than that before it."""
    slopes = _slopes(points[:3])
    return slopes[0] < 0.5 or (len(slopes) > 1 and slopes[0] < slopes[1] - 0.2)


def _slopes(points: Sequence[tuple[float, float]]) -> list[float]:
    return [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(points)]


def time_at(line: Line, error: float) -> float | None:
    """Seconds at which a line reaches an error of position: between two of its points on the logarithmic chart, else None.

    The fastest counts of all crossings and of all points that are more accurate.
    """
    points = [(p["errors"]["position"], median(p["seconds"])) for p in timed(line) if p["errors"]["position"]]
    times = [_crossing(a, b, error) for a, b in pairwise(points) if (a[0] - error) * (b[0] - error) <= 0]
    times += [seconds for found, seconds in points if found <= error]
    return min(times) if times else None


def _crossing(a: tuple[float, float], b: tuple[float, float], error: float) -> float:
    if a[0] == b[0]:
        return min(a[1], b[1])
    share = (log(error) - log(a[0])) / (log(b[0]) - log(a[0]))
    return exp(log(a[1]) + share * (log(b[1]) - log(a[1])))


def breakdown(line: Line) -> float | None:
    """The largest step from which on smaller ones fail, or are less accurate than a larger one.
    None where a line has none or no good step.

    Failures at steps above the first that ends are another matter: these are too large.
    """
    least: float | None = None
    for p in sorted(line["points"], key=lambda p: -float(p["dt"])):
        error = None if p["failure"] else p["errors"]["position"]
        if least is not None and (error is None or error > least):
            return float(p["dt"])
        least = error if error is not None else least
    return None


def price(line: Line, base: Line) -> float | None:
    """The time of a line over that of another, the median over the steps that both reach the end with."""
    seconds = {p["dt"]: median(p["seconds"]) for p in timed(base)}
    ratios = [median(p["seconds"]) / seconds[p["dt"]] for p in timed(line) if p["dt"] in seconds]
    return median(ratios) if ratios else None


def best(lines: Sequence[Line], error: float, suits: Callable[[Line], bool]) -> tuple[str, float] | None:
    """The label and time of the fastest line that reaches an error, among those that suit."""
    found = [(line["label"], time) for line in lines if suits(line) and (time := time_at(line, error)) is not None]
    return min(found, key=lambda pair: pair[1]) if found else None


def leading(lines: Sequence[Line]) -> list[Line]:
    """The methods by their own rule.
    Of the others, group by group and peer by peer, what is the fastest at one of TARGETS at least."""
    rivals: dict[tuple[str, str], list[Line]] = {}
    for line in lines:
        rivals.setdefault(_rivals(line), []).append(line)
    fastest = [best(among, error, lambda _: True) for among in rivals.values() for error in TARGETS]
    leaders = {found[0] for found in fastest if found is not None}
    return [line for line in lines if line["group"] == "generated" or line["label"] in leaders]


def _rivals(line: Line) -> tuple[str, str]:
    """The group with which a line is compared: its own, of peers the lines of one tool."""
    return line["group"], line["contender"].partition("/")[0] if line["group"] == "peer" else ""


class Spot(NamedTuple):
    """A measured point: its time (s), contender, step (s) and error of position (m)."""

    seconds: float
    contender: str
    dt: float
    error: float


def fastest_spot(lines: Sequence[Line], error: float, *, peers: bool) -> Spot | None:
    """The fastest measured point that is as accurate as asked for, among the peers or among all others; None where none is."""
    found = [
        Spot(median(p["seconds"]), line["contender"], p["dt"], p["errors"]["position"])
        for line in lines if (line["group"] == "peer") is peers
        for p in timed(line) if p["errors"]["position"] is not None
    ]  # fmt: skip
    return min((spot for spot in found if spot.error <= error), default=None)


def fastest_ours(lines: Sequence[Line], error: float) -> tuple[str, float] | None:
    """The fastest generated code at an error, of the full or the reduced model, with any integrator."""
    return best(lines, error, lambda line: line["group"] in ("generated", "integrators", "reduced", "reductions", "functions"))


def fastest_peer(lines: Sequence[Line], error: float) -> tuple[str, float] | None:
    """The fastest other tool at an error."""
    return best(lines, error, lambda line: line["group"] == "peer")
