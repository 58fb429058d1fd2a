"""Light links without mass: an approximation."""

from __future__ import annotations

from dataclasses import replace

import sympy

from cutjoint.model.evaluate import evaluate
from cutjoint.model.records import Body, Model, Scene
from cutjoint.reduce.links import shorten_links
from cutjoint.reduce.records import Note, Outcome

#: The share of the model's mass below which a body counts as light.
LIGHT = 0.02


def lighten_links(model: Model, scene: Scene) -> Outcome:
    """The pass: light bodies that without mass would be distances lose it; what they bear on their neighbours is lost with it."""
    values = {p.symbol: p.value for p in model.parameters}
    masses = {body.name: evaluate(sympy.sympify(body.mass), values) for body in model.bodies}
    whole = sum(masses.values())
    outcome = Outcome(model=model, scene=scene)
    for body in model.bodies:
        if 0 < masses[body.name] <= LIGHT * whole:
            outcome = _lighten(outcome, body, masses[body.name] / whole)
    return outcome


def _lighten(outcome: Outcome, body: Body, share: float) -> Outcome:
    zero = sympy.Integer(0)
    massless = replace(body, mass=zero, inertia=(zero,) * 6)
    bodies = tuple(massless if b.name == body.name else b for b in outcome.model.bodies)
    reduced = shorten_links(replace(outcome.model, bodies=bodies), outcome.scene)
    if not any(note.element == body.name for note in reduced.done):
        return outcome
    words = f"loses its mass, {100 * share:.2g} % of the whole, and becomes a distance"
    note = Note(element=body.name, words=words, span=body.span)
    return replace(outcome, model=reduced.model, scene=reduced.scene, done=(*outcome.done, note))
