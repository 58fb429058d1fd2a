"""Plots of a run: one picture a dimension, one panel a quantity, one line an element."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cutjoint.run.result_files import write_whole
from cutjoint.run.results import Trajectory

_DIMENSIONS = {"m": "position", "m/s": "velocity", "m/s^2": "acceleration", "rad": "angle", "rad/s": "angular velocity", "N": "force",
               "N*m": "torque"}  # fmt: skip


def plot_run(run: Trajectory, title: str, folder: Path) -> list[Path]:
    """Write the pictures of a run as PNG files and return their paths; elements of one name in several instances share a panel."""
    groups: dict[str, dict[str, list[str]]] = {}
    for column, unit in run.units.items():
        *_, instance_or_element, quantity = ["", *column.rsplit(".", 2)]  # an input's name has no dot
        panel = f"{instance_or_element}.{quantity}" if column.count(".") > 1 else quantity
        groups.setdefault(unit, {}).setdefault(panel, []).append(column)
    return [_picture(run, title, unit, quantities, folder) for unit, quantities in groups.items()]


def _picture(run: Trajectory, title: str, unit: str, quantities: dict[str, list[str]], folder: Path) -> Path:
    dimension = _DIMENSIONS.get(unit, unit)
    figure = Figure(figsize=(9, 1 + 2.1 * len(quantities)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(quantities), 1, sharex=True, squeeze=False)[:, 0]
    for panel, (quantity, columns) in zip(panels, quantities.items(), strict=True):
        for column in columns:
            panel.plot(run.t, run[column], linewidth=1.0, label=column.removesuffix(f".{quantity}"))
        panel.set_ylabel(f"{quantity} [{unit}]")
        panel.grid(visible=True, linewidth=0.3)
        panel.legend(loc="upper right", fontsize="small", frameon=False)
    panels[-1].set_xlabel("t [s]")
    figure.suptitle(f"{title}: {dimension}")
    path = folder / f"{dimension.replace(' ', '_').replace('/', '_').replace('*', '_').replace('^', '')}.png"
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=110, metadata={"Software": None})
    return write_whole(path, picture.getvalue())
