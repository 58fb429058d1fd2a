"""Charts of a bench as SVG text."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from cutjoint_bench.findings import TARGETS, leading, timed

Line = Mapping[str, Any]

#: Okabe and Ito's colours, which differ to colour-blind eyes too; black is left for what stands alone.
COLOURS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#999933", "#882255", "#117733", "#AA4499", "#8C564B", "#666666",
)  # fmt: skip

#: The line and the mark of a group of contenders.
STYLES: Mapping[str, tuple[str, str]] = {
    "generated": ("-", "o"), "scalar": ("-", "x"), "solvers": (":", "."), "generic": ("--", "s"), "precision": ("-", "o"),
    "peer": ("-.", "^"), "reduced": ("--", "D"), "reductions": ("--", "v"), "integrators": (":", "P"),
    "functions": ("--", "*"), "accuracy": ("-", "p"), "auto": ("-", "X"),
}  # fmt: skip

def new_figure(width: float, height: float) -> Figure:
    """A figure to draw on."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasSVG(figure)
    return figure


def svg_of(figure: Figure) -> str:
    """The figure as an SVG element; the same bytes for the same figure."""
    text = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "cutjoint", "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    content = text.getvalue()
    return content[content.index("<svg") :]


def style(panel: Axes) -> None:
    """Draw the grid and the frame of all panels."""
    panel.grid(visible=True, which="major", linewidth=0.4, color="#dddddd")
    panel.spines[["top", "right"]].set_visible(False)


def draw_work_precision(case: Mapping[str, Any]) -> str:
    """Time over error of the leading contenders, a line each, its step along the line; the scene's own step is ringed."""
    figure, lines = new_figure(10, 4.8), leading(case["lines"])
    panel = figure.subplots()
    for colour, line in zip(_colours(lines), lines, strict=True):
        _draw_line(panel, line, colour)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.invert_xaxis()
    panel.set_xlabel("largest error of position [m]")
    panel.set_ylabel(f"time for {case['end']:g} s of motion [s]")
    style(panel)
    figure.legend(loc="outside right center", fontsize="small", frameon=False)
    return svg_of(figure)


def _colours(lines: Sequence[Line]) -> list[str]:
    """A colour for each formulation, and one for each peer, precision or integrator.
    Generic solvers and variants of a formulation share its colour, and reduced models that of the full one."""
    splits = ("peer", "precision", "integrators", "reduced", "functions")
    names = [(line["contender"].removesuffix("/reduced").removesuffix("/functions"), line["group"]) for line in lines]
    families = [name if group in splits else name.partition("/")[0] for name, group in names]
    of = {family: COLOURS[i % len(COLOURS)] for i, family in enumerate(dict.fromkeys(families))}
    return [of[family] for family in families]


def _draw_line(panel: Axes, line: Line, colour: str) -> None:
    points = [p for p in timed(line) if p["errors"]["position"]]
    if not points:
        return
    stroke, mark = STYLES.get(line["group"], ("-", "o"))
    x, y = [p["errors"]["position"] for p in points], [median(p["seconds"]) for p in points]
    panel.plot(x, y, stroke, marker=mark, markersize=3.5, linewidth=1.2, color=colour, label=line["label"])
    for p, error, seconds in zip(points, x, y, strict=True):
        if p["dt"] == line.get("dt"):
            panel.plot([error], [seconds], "o", markersize=9, markerfacecolor="none", color=colour)
            panel.annotate(f"{1e3 * p['dt']:g} ms", (error, seconds), xytext=(5, 5), textcoords="offset points", fontsize="x-small")


def draw_accuracies(lines: Sequence[Line]) -> str:
    """True (filled) and estimated (hollow) errors of outputs over the accuracy asked for, a colour a line."""
    figure = new_figure(8, 4.2)
    panel = figure.subplots()
    for i, line in enumerate(lines):
        points, colour = [p for p in timed(line) if p["errors"]["outputs"]], COLOURS[i % len(COLOURS)]
        asked, true = [p["dt"] for p in points], [p["errors"]["outputs"] for p in points]
        estimated = [p["about"]["estimated"] for p in points]
        panel.plot(asked, true, "-", marker="o", markersize=4, linewidth=1.2, color=colour, label=_short(line))
        panel.plot(asked, estimated, ":", marker="o", markersize=5, linewidth=1.0, color=colour, mfc="none")
    ends = (min(TARGETS), max(TARGETS))
    panel.plot(ends, ends, "-", color="black", linewidth=0.8, label="as asked for")
    panel.plot([], [], ":", marker="o", markersize=5, color="black", mfc="none", label="estimated by the run")
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.invert_xaxis()
    panel.set_xlabel("accuracy asked for [m or rad]")
    panel.set_ylabel("largest error of outputs [m or rad]")
    style(panel)
    figure.legend(loc="outside right center", fontsize="small", frameon=False)
    return svg_of(figure)


def _short(line: Line) -> str:
    return str(line["label"]).removesuffix(", by accuracy")


def draw_drift(drift: Mapping[str, Any]) -> str:
    """The change of what a mechanism keeps, over time, a line a method."""
    kept = [name for name in ("energy", "momentum") if drift[name]]
    figure = new_figure(11, 3.2)
    panels = figure.subplots(1, len(kept), squeeze=False)[0]
    for panel, name in zip(panels, kept, strict=True):
        for colour, line in zip(COLOURS, drift["lines"], strict=False):
            panel.plot(line["t"], line[name], linewidth=1.0, color=colour, label=line["method"])
        panel.set_xlabel("t [s]")
        panel.set_ylabel(f"relative change of {name}")
        style(panel)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize="small", frameon=False)
    return svg_of(figure)
