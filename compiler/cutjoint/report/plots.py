"""Plots of a run: one picture a dimension, one panel a quantity, one line an element."""

from __future__ import annotations

from pathlib import Path

from cutjoint.run.figures import Line, as_png, draw
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
    lines = [
        Line(x=run.t, y=run[column], label=column.removesuffix(f".{quantity}"), unit=unit, panel=quantity)
        for quantity, columns in quantities.items() for column in columns
    ]  # fmt: skip
    figure = draw(lines, x_label="t [s]", title=f"{title}: {dimension}")
    path = folder / f"{dimension.replace(' ', '_').replace('/', '_').replace('*', '_').replace('^', '')}.png"
    return write_whole(path, as_png(figure))
