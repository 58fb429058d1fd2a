"""A static equilibrium as tables."""

from __future__ import annotations

from rich.table import Table

from cutjoint.model.quantities import POSE
from cutjoint.run.results import MechanismState


def pose_table(state: MechanismState) -> Table:
    """The pose of each body, a row each."""
    table = Table(title="poses, m and rad", title_justify="left", box=None, pad_edge=False, collapse_padding=True)
    for heading in ("body", *POSE):
        table.add_column(heading, justify="left" if heading == "body" else "right")
    for body in _posed(state):
        table.add_row(body, *(f"{round(state.values[f'{body}.{quantity}'], 5) + 0.0:.5f}" for quantity in POSE))
    return table


def force_table(state: MechanismState) -> Table:
    """What is no pose of a body, a row a quantity."""
    table = Table(title="forces", title_justify="left", box=None)
    for heading in ("element", "quantity", "value", "unit"):
        table.add_column(heading, justify="right" if heading == "value" else "left")
    bodies = _posed(state)
    for column, value in state.values.items():
        element, _, quantity = column.rpartition(".")
        if element not in bodies:
            table.add_row(element, quantity, f"{value + 0.0:.7g}", state.units[column])
    return table


def _posed(state: MechanismState) -> list[str]:
    """The elements of which the whole pose is known."""
    elements = dict.fromkeys(column.rpartition(".")[0] for column in state.values)
    return [e for e in elements if all(f"{e}.{quantity}" in state.values for quantity in POSE)]
