"""A gear: a relation between a coordinate each of two tree joints.

Gear wheels, a rack and its pinion, belts and winches are linear: the first coordinate is the ratio times the second one, both counted from
the design position over full revolutions. For a cam in permanent contact, elliptic wheels or a Geneva drive it is a law f of the second
one. The relation holds exactly and without loss; tooth forces and the bearing forces that they cause are not modelled.
"""

from collections.abc import Mapping

#: Its description, for the documentation and `explain`.
TEXT = "a coordinate of a tree joint is a ratio times a coordinate of another one, or a law of it"
NAMES = ("ratio",)  #: the short name of its equation
#: The unit of the force on its first coordinate, by that coordinate's unit; the force on the second one is -ratio times as large.
FORCE_UNITS: Mapping[str, str] = {"rad": "N*m", "m": "N"}


def equation(has_law: bool) -> str:
    """Its equation, for generated code and `explain`."""
    return "Phi = q_a - f(q_b)" if has_law else "Phi = q_a - ratio q_b"
