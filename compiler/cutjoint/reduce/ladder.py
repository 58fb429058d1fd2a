"""The ladder: the full model and what is left of it after more and more passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from cutjoint.formulate.natural.records import LagrangianEquations
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.records import Model, Scene
from cutjoint.pipeline import ITERATIONS, generate
from cutjoint.reduce.guards import guard_idle
from cutjoint.reduce.half.symmetry import halve
from cutjoint.reduce.idle import drop_idle_equations
from cutjoint.reduce.light import lighten_links
from cutjoint.reduce.links import shorten_links
from cutjoint.reduce.reach import drop_unreached
from cutjoint.reduce.records import Note, Outcome, Pass
from cutjoint.reduce.weld import weld_bodies

#: The motion of a reduced model: the full one's, the same while guards hold, or near it.
MOTIONS = ("exact", "guarded", "approximate")


@dataclass(frozen=True, kw_only=True)
class Step:
    """A pass by name, and what it does to the motion: see MOTIONS."""

    name: str
    reduce: Pass
    motion: str = "exact"


#: The passes in the order in which they are tried.
STEPS: tuple[Step, ...] = (
    Step(name="reached", reduce=drop_unreached),
    Step(name="welded", reduce=weld_bodies),
    Step(name="half", reduce=halve),
    Step(name="links", reduce=shorten_links),
    Step(name="idle equations", reduce=drop_idle_equations),
    Step(name="guards", reduce=guard_idle, motion="guarded"),
    Step(name="light", reduce=lighten_links, motion="approximate"),
)


@dataclass(frozen=True, kw_only=True)
class Rung:
    """A model of the ladder: ``name`` is the last pass that changed it, ``done`` what the passes up to it did, ``left`` what it left.

    ``motion`` is one of MOTIONS; ``operations`` are those of an evaluation, ``unknowns`` and ``equations`` the numbers of coordinates and
    of the cut joints' equations.
    """

    name: str
    model: Model
    scene: Scene
    method: str
    motion: str
    operations: int
    unknowns: int
    equations: int
    done: tuple[Note, ...] = ()
    left: tuple[Note, ...] = ()


def climb(model: Model, scene: Scene, method: str = "recursive", *, approximate: bool = False) -> list[Rung]:
    """The full model first, then a rung for every pass that lowers the operations of a method.

    Raises:
        ModelError, TopologyError, RunError: the full model is wrong, or the method does not take it.
    """
    rungs = [_rung("full", Outcome(model=model, scene=scene), method, motion="exact")]
    for step in (s for s in STEPS if s.motion != "approximate" or approximate):
        below = rungs[-1]
        outcome = step.reduce(below.model, below.scene)
        if not outcome.done:
            rungs[-1] = replace(below, left=below.left + outcome.left)
            continue
        above = _rung(step.name, outcome, method, motion=max(below.motion, step.motion, key=MOTIONS.index))
        if above.operations < below.operations:
            rungs.append(replace(above, done=below.done + outcome.done, left=below.left + outcome.left))
        else:
            rungs[-1] = replace(below, left=(*below.left, *_dearer(outcome.done, step.name, above.operations, below.operations)))
    return rungs


def _rung(name: str, outcome: Outcome, method: str, *, motion: str) -> Rung:
    equations, program, _ = generate(outcome.model, outcome.scene, outcome.scene.outputs, method=method)
    assert isinstance(equations, RecursiveEquations | LagrangianEquations)
    unknowns = equations.speed_names if isinstance(equations, RecursiveEquations) else equations.coordinate_names
    return Rung(
        name=name, model=outcome.model, scene=outcome.scene, method=method, motion=motion, unknowns=len(unknowns),
        operations=program.operations(ITERATIONS[method]), equations=len(equations.equation_names),
    )  # fmt: skip


def _dearer(notes: Sequence[Note], name: str, found: int, before: int) -> list[Note]:
    """What a pass found and what is not done since it would cost more."""
    words = f"stays: the pass '{name}' would take {found} operations in place of {before}"
    return [replace(note, words=words) for note in notes]
