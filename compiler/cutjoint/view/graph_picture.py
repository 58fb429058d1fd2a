"""The topology of a model as a PNG picture."""

from __future__ import annotations

from io import BytesIO

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from cutjoint.topology.records import Topology
from cutjoint.view.graph import GraphBody, GraphLink, draw_graph

#: Pixels of the graph in an inch, and of a body's half height; the largest side of a picture in inches.
_PIXELS, _HALF, _LARGEST = 72.0, 11.0, 60.0
_TREE, _CUT = "0.35", "tab:red"


def picture_graph(topology: Topology) -> bytes:
    """Bodies and joints as `draw_graph` places them, of the tree in grey, cut ones and gears in dashed red.  The same topology gives
    the same bytes."""
    graph = draw_graph(topology, (), {})
    shrunk = min(1.0, _LARGEST * _PIXELS / max(graph.width, graph.height))
    figure = Figure(figsize=(shrunk * graph.width / _PIXELS, shrunk * graph.height / _PIXELS))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, graph.width), ylim=(graph.height, 0.0))
    axes.set_axis_off()
    bodies = {body.name: body for body in graph.bodies}
    for link in graph.links:
        (_draw_cut if link.cut else _draw_tree)(axes, link, bodies[link.base], bodies[link.follower], shrunk)
    for body in graph.bodies:
        colour = "0.92" if body.kin < 0 else f"C{body.kin % 10}"
        box = (body.x, body.y - _HALF), body.width, 2 * _HALF
        axes.add_patch(FancyBboxPatch(*box, boxstyle="round,pad=0,rounding_size=4", facecolor=colour, edgecolor="0.2", alpha=0.9))
        axes.text(body.x + body.width / 2, body.y, body.short, ha="center", va="center", fontsize=8 * shrunk)
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=100, metadata={"Software": None})
    return picture.getvalue()


def _draw_tree(axes: Axes, link: GraphLink, base: GraphBody, follower: GraphBody, shrunk: float) -> None:
    left, right = sorted((base, follower), key=lambda body: body.x)
    start = left.x + left.width
    axes.plot([start, start + 8, right.x], [left.y, right.y, right.y], color=_TREE, linewidth=1.0)
    axes.text(right.x - 4, right.y - 2, link.short, ha="right", va="bottom", fontsize=7 * shrunk, color=_TREE)


def _draw_cut(axes: Axes, link: GraphLink, base: GraphBody, follower: GraphBody, shrunk: float) -> None:
    (first, second), lane = link.heights, link.lane
    x = [base.x + base.width, lane, lane, follower.x + follower.width]
    axes.plot(x, [first, first, second, second], color=_CUT, linewidth=1.0, linestyle="--")
    axes.text(lane + 3, (first + second) / 2, link.short, ha="left", va="center", fontsize=7 * shrunk, color=_CUT)
