"""The ladder: the full model and what is left of it after more and more passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from cutjoint.model.records import Model, Scene
from cutjoint.reduce.links import shorten_links
from cutjoint.reduce.plane import drop_idle_equations
from cutjoint.reduce.reach import drop_unreached
from cutjoint.reduce.records import Note, Outcome, Pass
from cutjoint.reduce.weld import weld_bodies

#: Passes that leave the motion as it is, in the order in which they are tried.
EXACT: tuple[tuple[str, Pass], ...] = (
    ("reached", drop_unreached), ("welded", weld_bodies), ("links", shorten_links), ("plane", drop_idle_equations),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Rung:
    """A model of the ladder: ``name`` is the last pass that changed it, ``notes`` what all passes did, ``left`` what they left and why.

    ``exact`` tells that its motion is the full model's.
    """

    name: str
    model: Model
    scene: Scene
    exact: bool = True
    notes: tuple[Note, ...] = ()
    left: tuple[Note, ...] = ()


def climb(model: Model, scene: Scene, passes: Sequence[tuple[str, Pass]] = EXACT) -> list[Rung]:
    """The full model first, then a rung for every pass that changed something."""
    rungs = [Rung(name="full", model=model, scene=scene)]
    left: tuple[Note, ...] = ()
    for name, reduce in passes:
        below = rungs[-1]
        outcome = reduce(below.model, below.scene)
        left += outcome.left
        if outcome.done:
            rungs.append(step(below, name, outcome))
    return [replace(rung, left=left) for rung in rungs]


def step(below: Rung, name: str, outcome: Outcome, *, exact: bool = True) -> Rung:
    """The rung after a pass."""
    notes = below.notes + outcome.done
    return Rung(name=name, model=outcome.model, scene=outcome.scene, exact=below.exact and exact, notes=notes, left=outcome.left)
