"""Heat maps of the failure atlas as SVG text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from cutjoint_bench.report.charts import new_figure, svg_of

Atlas = Mapping[str, Any]
Cell = Mapping[str, Any]

#: Okabe and Ito's colours, which differ to colour-blind eyes and in grey too; grey is what stopped by itself.
COLOURS: Mapping[str, str] = {
    "converged": "#009E73", "inaccurate": "#F0E442", "drifted": "#56B4E9", "diverged": "#C8C8C8", "wrong": "#D55E00",
}  # fmt: skip

#: Behind the cells, for what was not run.
_NOT_RUN = "#F6F6F6"

#: Inches: of a panel's cells, and around them.
_CELL = (0.21, 0.2)
_AROUND = (0.75, 0.75)


def draw_atlas(atlas: Atlas) -> str:
    """A panel a method and precision: the step along x, the penalty or the parameter that varies along y; a cross is the scene's own.

    Where penalty and parameter both vary, there is a panel for each value of the parameter as well.
    """
    axes = atlas["axes"]
    by, beside = _vertical(axes)
    columns = list(product(axes["precision"], beside))
    levels = {m: [x for x in axes[by] if any(c["method"] == m and c[by] == x for c in atlas["cells"])] for m in axes["method"]}
    heights = [max(1, len(rows)) * _CELL[1] + _AROUND[1] for rows in levels.values()]
    figure = new_figure(max(7.5, 0.8 + (len(axes["dt"]) * _CELL[0] + _AROUND[0]) * len(columns)), 0.9 + sum(heights))
    panels = figure.subplots(len(levels), len(columns), squeeze=False, sharex=True, height_ratios=heights)
    for (method, rows), line in zip(levels.items(), panels, strict=True):
        for (precision, value), panel in zip(columns, line, strict=True):
            cells = [c for c in atlas["cells"] if (c["method"], c["precision"]) == (method, precision)]
            _draw_panel(panel, atlas, by, rows, [c for c in cells if by == "value" or c["value"] == value])
            _mark_own(panel, atlas, by, rows, method)
            more = "" if value is None else f", {axes['parameter']} {value:g}"
            panel.set_title(f"{method}, {precision}{more}", fontsize="small", loc="left")
    _name_axes(panels, by, axes)
    _explain(figure, atlas)
    return svg_of(figure)


def _vertical(axes: Mapping[str, Any]) -> tuple[str, Sequence[float | None]]:
    """The axis along y, and the values that have panels of their own."""
    if len(axes["penalty"]) > 1:
        return "penalty", axes["value"]
    return ("value", [None]) if len(axes["value"]) > 1 else ("penalty", axes["value"])


def _draw_panel(panel: Axes, atlas: Atlas, by: str, rows: Sequence[float | None], cells: Sequence[Cell]) -> None:
    """Rectangles of one size, a row a penalty or value; one row without a name where there is no penalty."""
    steps = atlas["axes"]["dt"]
    for c in cells:
        corner = (steps.index(c["dt"]), rows.index(c[by]))
        panel.add_patch(Rectangle(corner, 1, 1, facecolor=COLOURS[c["outcome"]], edgecolor="white", linewidth=0.6))
    panel.set_facecolor(_NOT_RUN)
    panel.set_xlim(0, len(steps))
    panel.set_ylim(0, max(1, len(rows)))
    panel.set_xticks(*_decades(steps))
    named = rows if len(rows) > 1 else []
    labels = [f"{x:.4g}{_conditions(atlas, x)}" if by == "value" else _label(x) for x in named]
    panel.set_yticks([i + 0.5 for i in range(len(named))], labels)
    panel.tick_params(length=2, labelsize="x-small")
    panel.spines[:].set_visible(False)


def _conditions(atlas: Atlas, value: float | None) -> str:
    """What makes a value of the parameter hard: the fastest eigenvalue and the closeness to a singular pose, where they are known."""
    found = dict(zip(atlas["axes"]["value"], atlas.get("conditions") or [], strict=False)).get(value)
    if found is None:
        return ""
    parts = [f"{found['rate']:.3g}/s"] if found["rate"] else []
    return "".join(f" | {part}" for part in (*parts, *([f"{found['closeness']:.1g}"] if found["closeness"] is not None else [])))


def _decades(steps: Sequence[float]) -> tuple[list[float], list[str]]:
    """Ticks at the powers of ten."""
    powers = [(i + 0.5, f"{s:.0e}") for i, s in enumerate(steps) if np.isclose(np.log10(s) % 1, [0, 1], atol=1e-6).any()]
    places = powers or [(i + 0.5, f"{s:g}") for i, s in enumerate(steps)]
    return [x for x, _ in places], [text.replace("e-0", "e-") for _, text in places]


def _label(value: float | None) -> str:
    if value is None:
        return "own"
    power = round(float(np.log10(value))) if value > 0 else 0
    return f"1e{power}" if np.isclose(value, 10.0**power) else f"{value:.3g}"


def _mark_own(panel: Axes, atlas: Atlas, by: str, rows: Sequence[float | None], method: str) -> None:
    """A cross at the scene's own step in the row of its own penalty or parameter.
    In the middle where there is no such row."""
    own = atlas["own"][method]
    x = _between(atlas["axes"]["dt"], own["dt"])
    known = [i + 0.5 for i, level in enumerate(rows) if level == (own["value"] if by == "value" else None)]
    if x is not None:
        panel.plot([x], known or [len(rows) / 2], "x", color="black", markersize=5, markeredgewidth=1.1)


def _between(steps: Sequence[float], dt: float) -> float | None:
    """The place of a step on an axis of equal cells; None beyond its ends."""
    if not 0.99 * steps[0] <= dt <= 1.01 * steps[-1]:
        return None
    return float(np.interp(np.log(dt), np.log(steps), np.arange(len(steps)) + 0.5))


def _name_axes(panels: Any, by: str, axes: Mapping[str, Any]) -> None:
    parameter = f"{axes['parameter']} [{axes['unit']}]" if axes["unit"] else axes["parameter"]
    for panel in panels[:, 0]:
        if len(panel.get_yticks()):
            panel.set_ylabel("penalty [N/m]" if by == "penalty" else parameter, fontsize="small")
    for panel in panels[-1]:
        panel.set_xlabel("step [s]", fontsize="small")


def _explain(figure: Figure, atlas: Atlas) -> None:
    """The legend of all outcomes, and what the atlas is of."""
    patches = [Patch(facecolor=COLOURS[name], label=name) for name in atlas["outcomes"]]
    patches.append(Patch(facecolor=_NOT_RUN, edgecolor="#BBBBBB", label="not run"))
    figure.legend(handles=patches, loc="outside lower center", ncols=len(patches), fontsize="small", frameon=False)
    figure.suptitle(atlas["title"], fontsize="medium")
