"""Why runs of an atlas do not converge, in words: by their neighbours on its axes and the case's conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Any

Atlas = Mapping[str, Any]
Cell = Mapping[str, Any]

#: A step times the fastest eigenvalue from which on the mode is not resolved: six steps a period, or one a time constant.
UNRESOLVED = 1.0

#: Trouble is due to a nearly singular pose from so many shares of the scene's time before it to so many after it.
BEFORE, AFTER = 0.03, 0.1


@dataclass(frozen=True, kw_only=True)
class Reason:
    """A reason that cells of one method, number type and outcome share, and an example of what such a run says."""

    method: str
    precision: str
    outcome: str
    words: str
    cells: tuple[Cell, ...]

    @property
    def message(self) -> str:
        """What the first of the runs says, without the place."""
        return str(next((c["message"] for c in self.cells if c.get("message")), ""))


def find_reasons(atlas: Atlas) -> list[Reason]:
    """The reasons of all cells that do not converge, in the order of methods, outcomes and frequency."""
    known = _Neighbours(atlas)
    found: dict[tuple[str, str, str, str], list[Cell]] = {}
    for cell in (c for c in atlas["cells"] if c["outcome"] != "converged"):
        key = (cell["method"], cell["precision"], cell["outcome"], explain(cell, known, _conditions(atlas, cell), atlas["end"]))
        found.setdefault(key, []).append(cell)
    methods, outcomes = list(atlas["axes"]["method"]), list(atlas["outcomes"])
    reasons = [Reason(method=m, precision=p, outcome=o, words=w, cells=tuple(cells)) for (m, p, o, w), cells in found.items()]
    return sorted(reasons, key=lambda r: (methods.index(r.method), r.precision, -outcomes.index(r.outcome), -len(r.cells)))


def _conditions(atlas: Atlas, cell: Cell) -> Mapping[str, Any]:
    """The conditions of a cell's value; empty where an atlas has none."""
    found = atlas.get("conditions") or []
    values = atlas["axes"]["value"]
    return found[values.index(cell["value"])] if cell["value"] in values and found else {}


class _Neighbours:
    """The cells of an atlas by their places."""

    def __init__(self, atlas: Atlas) -> None:
        self._cells: Sequence[Cell] = atlas["cells"]

    @cached_property
    def _good(self) -> dict[tuple[str, str], list[Cell]]:
        found: dict[tuple[str, str], list[Cell]] = {}
        for c in self._cells:
            if c["outcome"] == "converged":
                found.setdefault((c["method"], c["precision"]), []).append(c)
        return found

    def converged(self, cell: Cell, *same: str, precision: str | None = None) -> Iterator[Cell]:
        """The cells of the method that converge and have the same values on the axes named."""
        for other in self._good.get((cell["method"], precision or cell["precision"]), []):
            if all(other[axis] == cell[axis] for axis in same):
                yield other


def explain(cell: Cell, known: _Neighbours, conditions: Mapping[str, Any], end: float) -> str:
    """The reason of a cell that does not converge: the first of the causes that applies."""
    causes: tuple[Callable[[], str], ...] = (
        lambda: _of_rounding(cell, known), lambda: _of_masses(cell, conditions), lambda: _of_modes(cell, conditions),
        lambda: _of_pose(cell, conditions, end), lambda: _of_penalty(cell, known), lambda: _of_step(cell, known),
    )  # fmt: skip
    return next((words for cause in causes if (words := cause())), "no step and no penalty that was tried converges here")


def _of_rounding(cell: Cell, known: _Neighbours) -> str:
    alike = cell["precision"] == "single" and any(known.converged(cell, "dt", "penalty", "value", precision="double"))
    return "rounding: in double the same run converges" if alike else ""


def _of_masses(cell: Cell, conditions: Mapping[str, Any]) -> str:
    if "mass matrix" not in (cell.get("message") or "") or not conditions.get("massless"):
        return ""
    return f"no mass resists a motion of {', '.join(conditions['massless'][:3])}, which have none"


def _of_modes(cell: Cell, conditions: Mapping[str, Any]) -> str:
    rate = conditions.get("rate")
    if not rate or cell["dt"] * rate <= UNRESOLVED:
        return ""
    return f"stiffness: the step is longer than a sixth of the period of the fastest mode, {2e3 * pi / rate:.2g} ms"


def _of_pose(cell: Cell, conditions: Mapping[str, Any], end: float) -> str:
    trouble = cell.get("reached") if cell["outcome"] == "diverged" else cell.get("since")
    passed = [t for t in conditions.get("singular_times", ()) if trouble is not None and -BEFORE <= (trouble - t) / end <= AFTER]
    return f"a nearly singular pose at {passed[-1]:.3g} s, where it begins" if passed else ""


def _of_penalty(cell: Cell, known: _Neighbours) -> str:
    """Of the scene's own penalty, which may follow the step, nothing is known but that another one does."""
    others = [c["penalty"] for c in known.converged(cell, "dt", "value") if c["penalty"] != cell["penalty"]]
    if not others:
        return ""
    given, own = [p for p in others if p is not None], cell["penalty"]
    if own is None or not given:
        return "the penalty does not suit this step: another one does"
    if own > max(given):
        return "the penalty is too heavy for this step: lighter ones converge"
    return "the penalty is too light: heavier ones converge" if own < min(given) else "the penalty: both lighter and heavier ones converge"


def _of_step(cell: Cell, known: _Neighbours) -> str:
    good = [c["dt"] for c in known.converged(cell, "penalty", "value")]
    if any(dt < cell["dt"] for dt in good):
        return "the step is too long: shorter ones converge"
    return "the step is too short: longer ones converge, so what is left is rounding or the iteration's tolerance" if good else ""
