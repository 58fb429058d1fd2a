"""Which setting for which error: of each error that is asked for the fastest measured setting, beside `--accuracy` and `--method auto`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from statistics import median
from typing import Any, NamedTuple

from cutjoint_bench.findings import TARGETS, describe_setting, timed
from cutjoint_bench.records import ASKED
from cutjoint_bench.store import Record

Line = Mapping[str, Any]
Point = Mapping[str, Any]

#: Settings are timed again in turns that took at most so many times as long as the fastest, and at most so many of them.
CLOSE, MOST = 1.5, 4

#: Times within this factor of each other are alike.
ALIKE = 1.05


class Entry(NamedTuple):
    """A measured point of a contender's line."""

    line: Line
    point: Point

    @property
    def seconds(self) -> float:
        """The median of its repetitions."""
        return float(median(self.point["seconds"]))


#: Times entries again in turns; s, in their order.
TimeAgain = Callable[[Sequence[Entry]], Sequence[float]]


def find_choices(lines: Sequence[Line], error: str, time_again: TimeAgain) -> list[Record]:
    """The choice at each of TARGETS, as plain data for JSON; ``error`` is the name of the error that is compared, of `Errors`.

    ``fastest`` is the fastest setting within the error that a command line can name, ``unnamed`` a faster one that none can, such as a
    reduced model.  ``accuracy`` is the fastest `--accuracy` of this size, ``auto`` what `--method auto` takes, whether or not their errors
    are within.  Each is None where there is none.
    """
    usable = [line for line in lines if line["group"] != "peer" and "refused" not in line]
    found = [_choice(usable, target, error, time_again) for target in TARGETS]
    for choice, stricter in reversed(list(pairwise(found))):
        rows = [row for row in (choice["fastest"], stricter["fastest"]) if row is not None]
        choice["fastest"] = min(rows, key=lambda row: row["seconds"], default=None)  # other load may meet all runs of one error
        if choice["fastest"] and choice["unnamed"] and choice["unnamed"]["seconds"] >= choice["fastest"]["seconds"]:
            choice["unnamed"] = None
    return found


def choice_lines(data: Mapping[str, Any]) -> Iterator[str]:
    """The fastest setting at each error of a bench as lines of text: the case, then a line an error with time, error and command."""
    for case in (c for c in data["cases"] if c.get("choices")):
        yield f"{case['name']}: the fastest setting whose error is at most"
        for choice in case["choices"]:
            if (row := choice["fastest"]) is None:
                yield f"  {choice['target']:.0e}: none that was tried"
            else:
                yield f"  {choice['target']:.0e}: {1e3 * row['seconds']:.3g} ms, error {row['error']:.1e}: {row['command']}"


def _choice(lines: Sequence[Line], target: float, error: str, time_again: TimeAgain) -> Record:
    given = sorted(_within(lines, target, error), key=lambda entry: entry.seconds)
    named = [entry for entry in given if "command" in entry.point]
    close = [entry for entry in named if entry.seconds <= CLOSE * named[0].seconds][:MOST]
    others = [entry for entry in given if "command" not in entry.point][:1]
    asked = {group: _asked(lines, group, target, error) for group in ASKED}
    entries = [*close, *others, *(entry for entry in asked.values() if entry and entry.point["seconds"])]
    seconds = {id(entry.point): time for entry, time in zip(entries, time_again(entries), strict=True)}

    def row(entry: Entry | None) -> Record | None:
        return None if entry is None else _row(entry, seconds.get(id(entry.point)), target, error)

    fastest = _simplest(close, [seconds[id(entry.point)] for entry in close])
    limit = seconds[id(fastest.point)] if fastest else float("inf")
    unnamed = next((entry for entry in others if seconds[id(entry.point)] < limit), None)
    of_groups = {group: row(entry) for group, entry in asked.items()}
    return {"target": target, "error_of": error, "fastest": row(fastest), "unnamed": row(unnamed), **of_groups}


def _simplest(entries: Sequence[Entry], seconds: Sequence[float]) -> Entry | None:
    """The one with the shortest command of those that are as fast as the fastest."""
    alike = [entry for entry, time in zip(entries, seconds, strict=True) if time <= ALIKE * min(seconds)]
    return min(alike, key=lambda entry: len(entry.point["command"]), default=None)


def _within(lines: Sequence[Line], target: float, error: str) -> Iterator[Entry]:
    """Points with steps or tolerances whose error is known and at most the target."""
    for line in (x for x in lines if x["group"] not in ASKED):
        for point in timed(line):
            if point["errors"].get(error) is not None and point["errors"][error] <= target:
                yield Entry(line, point)


def _asked(lines: Sequence[Line], group: str, target: float, error: str) -> Entry | None:
    """The fastest of a group that was given the target as its accuracy: of those that keep it, else of all; or one that failed."""
    found = [Entry(line, point) for line in lines if line["group"] == group for point in line["points"] if point["dt"] == target]

    def rank(entry: Entry) -> tuple[bool, bool, float]:
        ended, size = bool(entry.point["seconds"]), entry.point["errors"].get(error)
        return not ended, size is None or size > target, entry.seconds if ended else 0.0

    return min(found, key=rank, default=None)


def _row(entry: Entry, seconds: float | None, target: float, error: str) -> Record:
    line, point = entry
    size = point["errors"].get(error)
    return {
        "contender": line["contender"], "label": line["label"], "setting": describe_setting(line, point), "seconds": seconds, "error": size,
        "within": size is not None and size <= target, "command": point.get("command", ""), "failure": point["failure"],
        "about": point.get("about", {}),
    }  # fmt: skip
