"""Colours that light and dark pages both take."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.view.records import Colour


def read_colour(text: str) -> Colour:
    """The colour of a text such as "#d9480f"."""
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


STEEL = read_colour("#8b929b")
JOINT = read_colour("#5d646e")
FORCE, REACTION = read_colour("#d9480f"), read_colour("#0b7fab")
ALARM = read_colour("#e5202b")
RUBBER = read_colour("#33373d")
ROAD = (read_colour("#a3a8ae"), read_colour("#b6bac0"))

_OF_BODIES = tuple(
    read_colour(c) for c in ("#3f7fb5", "#e08a33", "#4f9d5a", "#cf5757", "#8a6fc0", "#3fa3a0", "#c9a227", "#c76b9f", "#8d6e5a", "#7f9a3c")
)


def colours_of(bodies: Sequence[str]) -> dict[str, Colour]:
    """A colour for each body; those with one name in several instances of a submodel have one colour, unless all would."""
    labels = {body: body.rpartition(".")[2] for body in bodies}
    if len(set(labels.values())) == 1:
        labels = {body: body for body in bodies}
    names = list(dict.fromkeys(labels.values()))
    return {body: _OF_BODIES[names.index(name) % len(_OF_BODIES)] for body, name in labels.items()}
