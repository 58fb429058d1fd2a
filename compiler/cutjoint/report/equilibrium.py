"""A static equilibrium as tables."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log10

from rich.table import Table

from cutjoint.model.quantities import POSE
from cutjoint.run.results import MechanismState

#: m and rad; smaller ones are rounding.
_NOTHING = 1e-12


def pose_table(state: MechanismState) -> Table:
    """The pose of each body, a row each."""
    table = Table(title="poses, m and rad", title_justify="left", box=None, pad_edge=False, collapse_padding=True)
    for heading in ("body", *POSE):
        table.add_column(heading, justify="left" if heading == "body" else "right")
    bodies = _posed(state)
    columns = [_decimals([state.values[f"{body}.{quantity}"] for body in bodies]) for quantity in POSE]
    for body, *numbers in zip(bodies, *columns, strict=True):
        table.add_row(body, *numbers)
    return table


def force_table(state: MechanismState) -> Table:
    """A table of all values except the poses of bodies, a row a quantity."""
    table = Table(title="forces", title_justify="left", box=None)
    for heading in ("element", "quantity", "value", "unit"):
        table.add_column(heading, justify="right" if heading == "value" else "left")
    bodies = _posed(state)
    for column, value in state.values.items():
        element, _, quantity = column.rpartition(".")
        if element not in bodies:
            table.add_row(element, quantity, f"{value + 0.0:.7g}", state.units[column])
    return table


def _decimals(values: Sequence[float]) -> list[str]:
    """Numbers with as many decimals as give the largest five digits, five at least."""
    largest = max(map(abs, values), default=0.0)
    decimals = max(5, 4 - floor(log10(largest))) if largest > _NOTHING else 5
    return [f"{round(value, decimals) + 0.0:.{decimals}f}" for value in values]


def _posed(state: MechanismState) -> list[str]:
    """The elements of which the whole pose is known."""
    elements = dict.fromkeys(column.rpartition(".")[0] for column in state.values)
    return [e for e in elements if all(f"{e}.{quantity}" in state.values for quantity in POSE)]
