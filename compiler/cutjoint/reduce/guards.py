"""Forces that do not act in a scene are taken out of the model; a guard watches that they would not have acted."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Protocol, TypeVar

from cutjoint.formulate.forces import is_active
from cutjoint.model.records import Force, Guard, Model, Scene
from cutjoint.reduce.margins import Region, zero_region_of
from cutjoint.reduce.records import Note, Outcome
from cutjoint.reduce.sampling import run_scene


class Stop(Protocol):
    """The reason that a run stopped: ``guards`` names the forces that would act."""

    @property
    def guards(self) -> tuple[str, ...]: ...


class Run(Protocol):
    """A run and, unless it came to its end, its failure."""

    @property
    def failure(self) -> Stop | None: ...


R = TypeVar("R", bound=Run)


def guardable(model: Model, scene: Scene) -> tuple[str, ...]:
    """The forces that are switched on and whose law is zero in a part of its range."""
    return tuple(f.name for f in model.forces if not _reason(f, scene))


def guard_forces(model: Model, scene: Scene, names: Collection[str] | None = None) -> Outcome:
    """Take the named forces, or all that can be, out of the model and put guards in their place.

    Forces, stiffnesses and dampings of a guarded force are reported as zero, the places of its parts as in the full model.
    """
    asked = guardable(model, scene) if names is None else names
    reasons = {f.name: _reason(f, scene) for f in model.forces if f.name in asked}
    places = {f.name: index for index, f in enumerate(model.force_elements)}
    new = [
        Guard(force=f, margins=_region(f) or (), index=places[f.name])
        for f in model.forces if reasons.get(f.name) == ""
    ]  # fmt: skip
    taken = {guard.force.name for guard in new}
    return Outcome(
        model=replace(
            model, forces=tuple(f for f in model.forces if f.name not in taken),
            guards=tuple(sorted((*model.guards, *new), key=lambda guard: places[guard.force.name])),
        ),
        scene=scene,
        done=tuple(Note(element=g.force.name, words=_words(g), span=g.force.span) for g in new),
        left=tuple(Note(element=f.name, words=reasons[f.name], span=f.span) for f in model.forces if reasons.get(f.name)),
    )  # fmt: skip


def speculate(model: Model, scene: Scene, run: Callable[[Model, Scene], R]) -> tuple[Outcome, R]:
    """Run without the forces that can be guarded, and again with the forces of violated guards, until none is violated.

    A run without them that fails otherwise is repeated in full.  Returns the last run and the model that it ran.
    """
    out = set(guardable(model, scene))
    while True:
        outcome = guard_forces(model, scene, out)
        result = run(outcome.model, outcome.scene)
        if result.failure is None or not out:
            return outcome, result
        out -= set(result.failure.guards) or out


def guard_idle(model: Model, scene: Scene) -> Outcome:
    """The pass: the forces without action in the scene at its step, found by runs that put the acting ones back."""
    if not guardable(model, scene):
        return Outcome(model=model, scene=scene)
    outcome, run = speculate(model, scene, run_scene)
    if run.failure is not None:
        return Outcome(model=model, scene=scene)
    acting = set(guardable(model, scene)) - {note.element for note in outcome.done}
    left = tuple(Note(element=f.name, words="stays: it acts in this scene", span=f.span) for f in model.forces if f.name in acting)
    return replace(outcome, left=outcome.left + left)


def _words(guard: Guard) -> str:
    return f"is taken out, guarded by {' and '.join(f'{margin} >= 0' for margin in guard.margins)}"


def _region(force: Force) -> Region:
    """The region in which a force's law, or all components of a load, are zero."""
    return zero_region_of(force.expressions)


def _reason(force: Force, scene: Scene) -> str:
    """The reason that a force stays, "" if it need not."""
    if not is_active(force, scene):
        return "stays: it is switched off anyway"
    if not force.can_be_guarded:
        return "stays: it has no law over one position"
    region = _region(force)
    if region is None:
        return "stays: its law has no case in which it is zero"
    return "" if region else "stays: its law is zero everywhere"
