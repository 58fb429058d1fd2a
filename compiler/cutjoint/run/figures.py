"""Line plots: a panel for each quantity."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

#: Changes below this share of a column's size are rounding, in closed loops too.
_ROUNDING = 1e-9


class Picture(Figure):
    """A figure that a notebook shows as it is."""

    def _repr_png_(self) -> bytes:
        return as_png(self)


@dataclass(frozen=True, kw_only=True)
class Line:
    """A curve of ``y`` over ``x``, both (n,), in the panel of its ``panel`` and ``unit``; ``scale`` is a method of Matplotlib's axes."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    label: str
    unit: str
    panel: str = ""
    scale: str = "plot"
    style: str = "-"


def labelled(name: str, unit: str) -> str:
    """The name of an axis with its unit, if there is one."""
    return f"{name} [{unit}]".strip() if unit else name


def draw(lines: Sequence[Line], *, x_label: str, title: str = "", columns: int = 1) -> Picture:
    """A figure with a panel for each panel and unit that lines name, in their order, so many side by side."""
    panels: dict[tuple[str, str], list[Line]] = {}
    for line in lines:
        panels.setdefault((line.panel, line.unit), []).append(line)
    rows = max(1, -(-len(panels) // columns))
    figure = Picture(figsize=(7 + 2 * columns, 1 + 2.1 * max(rows, 2)) if columns > 1 else (9, 1 + 2.1 * len(panels)), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for panel, ((name, unit), drawn) in zip(axes, panels.items(), strict=False):
        for line in drawn:
            getattr(panel, line.scale)(line.x, line.y, line.style, linewidth=1.0, label=line.label or None)
        panel.set_ylabel(labelled(name, unit))
        panel.grid(visible=True, linewidth=0.3)
        if any(line.label for line in drawn):
            panel.legend(loc="best" if drawn[0].x.size < 1000 else "upper right", fontsize="small", edgecolor="none", framealpha=0.8)
        _hide_rounding(panel)
    for panel in axes[max(1, len(panels)) :]:
        panel.set_visible(False)
    figure.supxlabel(x_label) if columns > 1 else axes[-1].set_xlabel(x_label)
    if title:
        figure.suptitle(title)
    return figure


def _hide_rounding(panel: Axes) -> None:
    """Draw rounding noise as a straight line, not over the whole panel."""
    for limits, widen in ((panel.get_xlim(), panel.set_xlim), (panel.get_ylim(), panel.set_ylim)):
        size = max(map(abs, limits))
        if limits[1] - limits[0] < _ROUNDING * size:
            widen(limits[0] - 0.05 * size, limits[1] + 0.05 * size)


def as_png(figure: Figure, dpi: int = 110) -> bytes:
    """The bytes of a PNG file, without date or version."""
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=dpi, metadata={"Software": None})
    return picture.getvalue()
