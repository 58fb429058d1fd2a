"""Colours that light and dark pages both take."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.view.records import Colour


def _colour(text: str) -> Colour:
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


STEEL = _colour("#8b929b")
JOINT = _colour("#5d646e")
FORCE, REACTION = _colour("#d9480f"), _colour("#0b7fab")
ALARM = _colour("#e5202b")
RUBBER = _colour("#33373d")
ROAD = (_colour("#a3a8ae"), _colour("#b6bac0"))

_OF_BODIES = tuple(
    _colour(c) for c in ("#3f7fb5", "#e08a33", "#4f9d5a", "#cf5757", "#8a6fc0", "#3fa3a0", "#c9a227", "#c76b9f", "#8d6e5a", "#7f9a3c")
)


def colours_of(bodies: Sequence[str]) -> dict[str, Colour]:
    """A colour for each body; those with one name in several instances of a submodel have one colour, unless all would."""
    own = {body: body.rpartition(".")[2] for body in bodies}
    if len(set(own.values())) == 1:
        own = {body: body for body in bodies}
    names = list(dict.fromkeys(own.values()))
    return {body: _OF_BODIES[names.index(name) % len(_OF_BODIES)] for body, name in own.items()}
