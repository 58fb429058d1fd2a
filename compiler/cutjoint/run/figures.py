"""What figures that somebody asks for may be, on the command line and from Python."""

from __future__ import annotations

from math import inf, isfinite


def fault_of(value: float, *, above: float = -inf, least: float = -inf) -> str:
    """What is wrong with a figure and what to write in its place; "" where nothing is."""
    if not isfinite(value):
        return f"{value:g} is not a finite number; write a plain number in SI units"
    if value <= above:
        return f"{value:g} is not above {above:g}; write a larger number"
    return f"{value:g} is below {least:g}; write a larger number" if value < least else ""
