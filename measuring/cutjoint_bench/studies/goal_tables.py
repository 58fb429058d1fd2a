"""The tables of the study of objectives' errors, `goals`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
from statistics import median

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from cutjoint_bench.store import Record

Array = NDArray[np.float64]

#: True errors below this share of the objective's size, less than this multiple of the reference's own, or below the last (SI units), are
#: not judged.
LEAST, ABOVE, FLOOR = 1e-9, 5.0, 1e-12


def _counts(row: Record) -> bool:
    """Whether the true error is neither rounding nor the reference's own."""
    return bool(abs(row["true"]) > max(LEAST * row["size"], ABOVE * row["unknown"], FLOOR))


def estimates_table(rows: Sequence[Record]) -> Table:
    """How near estimates of objectives' errors are to true ones, by models, integrator and objective."""
    table = Table(title="estimated over true errors of objectives", title_justify="left", box=None)
    for heading in ("models", "integrator", "objective", "pairs", "within 2", "below 1/3", "smallest", "5 to 95 %", "second run: within 2",
                    "below 1/3", "column: within 2", "adjoint, runs", "forward, runs", "second, runs"):  # fmt: skip
        table.add_column(heading)
    counted = [row for row in rows if _counts(row)]
    groups: dict[tuple[str, str, str], list[Record]] = {}
    for row in counted:
        kind, integrator, objective = (row[name] for name in ("kind", "integrator", "objective"))
        for key in ((kind, integrator, "all"), ("all", integrator, objective), ("all", integrator, "all"), ("all", "all", "all")):
            groups.setdefault(key, []).append(row)
    for key, group in sorted(groups.items()):
        ratios = np.array([row["estimate"] / row["true"] for row in group])
        seconds = np.array([row["second run"] / row["true"] for row in group])
        columns = np.array([row["column"] / abs(row["true"]) for row in group])
        low, high = np.nanquantile(ratios, [0.05, 0.95])
        table.add_row(
            *key, str(len(group)), _near(ratios), _below(ratios), f"{np.nanmin(ratios):.2g}", f"{low:.2g} to {high:.2g}", _near(seconds),
            _below(seconds), _near(columns[np.isfinite(columns)]),
            *(f"{np.nanmedian([row[name] for row in group]):.2g}" for name in ("adjoint", "forward")),
            f"{median(row['evaluations of the second'] / row['evaluations'] for row in group):.2g}",
        )  # fmt: skip
    return table


def _near(ratios: Array) -> str:
    return f"{100 * float(np.mean((ratios >= 0.5) & (ratios <= 2))):.1f} %" if len(ratios) else ""


def _below(ratios: Array) -> str:
    return str(int(np.sum(~(ratios >= 1 / 3))))


#: Ways to refine whole runs.
_WAYS = ("column", "objective", "column leaping", "objective leaping")


def _of_way(rows: Sequence[Record], way: str) -> tuple[str, str]:
    """The median cost of a way, relative to that by columns, and how many errors it kept."""
    done = [row for row in rows if isfinite(row["by column"]) and isfinite(row[f"error by {way}"])]
    cost = median(row[f"by {way}"] / row["by column"] for row in done)
    return f"{cost:.2f}", f"{sum(row[f'error by {way}'] <= 1 for row in done)} of {len(done)}"


def savings_table(rows: Sequence[Record]) -> Table:
    """What steps chosen by the adjoint save, by models, objective and accuracy."""
    table = Table(title="evaluations to an accuracy of an objective, medians", title_justify="left", box=None)
    for heading in ("models", "objective", "share", "pairs", "weighed / uniform", "5 to 95 %", "adjoint way / column", *(
        heading for way in _WAYS for heading in (f"{way} / column", "kept"))):  # fmt: skip
        table.add_column(heading)
    groups: dict[tuple[str, str, str], list[Record]] = {}
    for row in rows:
        kind, objective, share = row["kind"], row["objective"], f"{row['share']:g}"
        for key in ((kind, "all", "all"), ("all", objective, "all"), ("all", "all", share), ("all", "all", "all")):
            groups.setdefault(key, []).append(row)
    for key, group in sorted(groups.items()):
        bare = _ratios(group, lambda row: row["weighed"] / row["uniform"])
        dual = _ratios(group, lambda row: (row["pilot"] * (1.6 + row["adjoint"]) + row["weighed"]) / row["by column"])
        low, high = np.quantile(bare, [0.05, 0.95])
        table.add_row(
            *key, str(len(bare)), f"{median(bare):.2f}", f"{low:.2f} to {high:.2f}", f"{median(dual):.2f}",
            *(text for way in _WAYS for text in _of_way(group, way)),
        )  # fmt: skip
    return table


def _ratios(rows: Sequence[Record], of: Callable[[Record], float]) -> list[float]:
    return [ratio for row in rows if isfinite(ratio := of(row))]
