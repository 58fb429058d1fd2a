"""The names of things in reports."""

from __future__ import annotations

from cutjoint.model.records import Model


def closing_equations(model: Model) -> str:
    """The equations of which a report gives number and rank."""
    return "equations of cut joints and gears" if model.gears else "cut-joint equations"
