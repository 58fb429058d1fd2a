"""Removes forces that do not act in a scene; guards watch that they would not have acted.

A law is zero in a region.  Margins, from the conditions of the law's cases, are not negative in this region.
"""

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from functools import reduce
from itertools import combinations
from typing import TypeAlias

import sympy

from cutjoint.formulate.forces import is_active
from cutjoint.model.expressions.operations import choice
from cutjoint.model.outcome import Note, Outcome
from cutjoint.model.records import Force, Guard, Model, Scalar, Scene
from cutjoint.reduce.sampling import run_scene
from cutjoint.run.results import Trajectory

#: The region in which all of some margins are not negative: () is everywhere, None nowhere that is known.
Region: TypeAlias = tuple[Scalar, ...] | None


def guardable(model: Model, scene: Scene) -> tuple[str, ...]:
    """The active forces whose law is zero in a part of its range."""
    return tuple(f.name for f in model.forces if not _reason(f, scene))


def guard_forces(model: Model, scene: Scene, names: Collection[str] | None = None) -> Outcome:
    """Take the named forces, or all that can be, out of the model and put guards in their place.
    Forces, stiffnesses and dampings of a guarded force are reported as zero, the places of its parts as in the full model."""
    asked = guardable(model, scene) if names is None else names
    reasons = {f.name: _reason(f, scene) for f in model.forces if f.name in asked}
    places = {f.name: index for index, f in enumerate(model.force_elements)}
    new = [Guard(force=f, margins=_region(f) or (), index=places[f.name]) for f in model.forces if reasons.get(f.name) == ""]
    taken, text = {guard.name for guard in new}, "is taken out, guarded by {}"
    return Outcome(
        model=replace(
            model, forces=tuple(f for f in model.forces if f.name not in taken),
            guards=tuple(sorted((*model.guards, *new), key=lambda guard: places[guard.force.name])),
        ),
        scene=scene,
        done=tuple(Note(element=g.name, text=text.format(" and ".join(f"{m} >= 0" for m in g.margins)), span=g.span) for g in new),
        left=tuple(Note(element=f.name, text=reasons[f.name], span=f.span) for f in model.forces if reasons.get(f.name)),
    )  # fmt: skip


def speculate(model: Model, scene: Scene, run: Callable[[Model, Scene], Trajectory]) -> tuple[Outcome, Trajectory | None]:
    """Run without the forces that can be guarded, and again with the forces of violated guards, until none is violated.
    If a run fails otherwise, all forces stay. Returns the last model and its run, None if all forces stay."""
    out = set(guardable(model, scene))
    while True:
        outcome = guard_forces(model, scene, out)
        result = run(outcome.model, outcome.scene) if out else None
        if result is None or result.failure is None:
            return outcome, result
        out -= set(result.failure.guards) or out


def guard_idle(model: Model, scene: Scene) -> Outcome:
    """The pass: the forces without action in the scene at its step, found by runs that put the acting ones back."""
    if not guardable(model, scene):
        return Outcome(model=model, scene=scene)
    outcome, _ = speculate(model, scene, run_scene)
    acting = set(guardable(model, scene)) - {note.element for note in outcome.done}
    left = tuple(Note(element=f.name, text="stays: it acts in this scene", span=f.span) for f in model.forces if f.name in acting)
    return replace(outcome, left=outcome.left + left)


def _region(force: Force) -> "Region":
    """The region in which a force's law, or all components of a load, are zero."""
    return _all_of(zero_region(law) for law in force.expressions)


def _reason(force: Force, scene: Scene) -> str:
    """The reason that a force is not removed, "" if it can be."""
    if not is_active(force, scene):
        return "stays: it is switched off"
    if not force.interaction.can_be_guarded:
        return "stays: it has no law over one position"
    region = _region(force)
    if region is None:
        return "stays: its law has no case in which it is zero"
    return "" if region else "stays: its law is zero everywhere"


def zero_region(law: Scalar) -> Region:
    """The region in which an expression is zero; it may be zero elsewhere too. A region has an inside. A case is without effect where its
    value is zero, its condition does not hold, or an earlier one holds; a sum is zero where its terms are, a product where a factor is."""
    if law == 0:
        return ()
    if isinstance(law, sympy.Piecewise):
        return _cases(law)
    if law.is_Add:
        return _all_of(zero_region(term) for term in law.args)
    if law.is_Mul:
        return _any_of(zero_region(factor) for factor in law.args)
    return zero_region(law.base) if law.is_Pow and law.exp.is_positive else None


def _cases(law: Scalar) -> Region:
    regions: list[Region] = []
    conditions: list[Scalar] = []
    for value, condition in law.args:
        earlier = [_region_of(c, value, holds=True) for c in conditions]
        regions.append(_any_of([zero_region(value), _region_of(condition, value, holds=False), *earlier]))
        conditions.append(condition)
    return _all_of(regions)


def _region_of(condition: Scalar, value: Scalar, *, holds: bool) -> Region:
    """The region in which a condition holds, or fails; None if ``value`` is not zero on a border that the region leaves out."""
    if condition in (sympy.true, sympy.false):
        return () if holds == (condition == sympy.true) else None
    if isinstance(condition, sympy.And | sympy.Or):
        join = _all_of if holds == isinstance(condition, sympy.And) else _any_of
        return join(_region_of(part, value, holds=holds) for part in condition.args)
    margin = condition.gts - condition.lts if holds else condition.lts - condition.gts
    is_strict = holds == isinstance(condition, sympy.StrictLessThan | sympy.StrictGreaterThan)
    return None if is_strict and not _vanishes(value, margin) else (margin,)


def _vanishes(value: Scalar, margin: Scalar) -> bool:
    """Return whether a value without cases is zero wherever the margin is."""
    for x in sorted(margin.free_symbols, key=str):
        derivative = sympy.diff(margin, x)
        if not value.has(sympy.Piecewise) and derivative != 0 and x not in derivative.free_symbols:
            return bool(sympy.simplify(value.subs(x, x - margin / derivative)) == 0)
    return False


def _all_of(regions: Iterable[Region]) -> Region:
    margins: list[Scalar] = []
    for region in regions:
        if region is None:
            return None
        margins += [m for m in region if m not in margins]
    return None if any(_exclude(one, other) for one, other in combinations(margins, 2)) else tuple(margins)


def _exclude(one: Scalar, other: Scalar) -> bool:
    """Return whether two margins are nowhere positive together.  A law that is zero at one point only, as |x|, acts all around it."""
    if (one + other).has(sympy.Piecewise):
        return False
    total, share = sympy.expand(one + other), sympy.cancel(one / other)
    return bool(total.is_nonpositive or (share.is_number and share.is_negative))


def _any_of(regions: Iterable[Region]) -> Region:
    known = [region for region in regions if region is not None]
    if not known or () in known:
        return () if known else None
    if len(known) == 1:
        return known[0]
    return (reduce(_larger, dict.fromkeys(reduce(_smaller, region) for region in known)),)


def _extreme(relation: type) -> Callable[[Scalar, Scalar], Scalar]:
    return lambda one, other: choice((one, relation(one, other, evaluate=False)), (other, sympy.true))


_larger, _smaller = _extreme(sympy.StrictGreaterThan), _extreme(sympy.StrictLessThan)
