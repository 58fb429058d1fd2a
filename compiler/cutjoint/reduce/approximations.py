"""Approximations that a measure judges: light links without mass, and tyres that roll straight on.

Lateral forces of these tyres are left out, and guards watch that they would have stayed small.
"""

from dataclasses import replace

import numpy as np
import sympy

from cutjoint.formulate.forces import is_active, variable
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.outcome import Note, Outcome
from cutjoint.model.records import Body, Guard, Model, Output, Scene, Tyre
from cutjoint.package.errors import RunError
from cutjoint.reduce.links import shorten_links
from cutjoint.reduce.sampling import run_scene
from cutjoint.run.simulator import SimulatorError

# Light links

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
    text = f"loses its mass, {100 * share:.2g} % of the whole, and becomes a distance"
    note = Note(element=body.name, text=text, span=body.span)
    return replace(outcome, model=reduced.model, scene=reduced.scene, done=(*outcome.done, note))


# Rolling tyres

#: A tyre rolls straight on as long as its lateral force is below this share of the largest load that it has in the scene.
SMALL = 0.15


def roll_straight(model: Model, scene: Scene) -> Outcome:
    """The pass: all tyres lose lateral force and aligning moment if those of none get large in a run of the model."""
    outcome = Outcome(model=model, scene=scene)
    tyres = [f for f in model.forces if isinstance(f, Tyre) and is_active(f, scene) and f.lateral]
    if not tyres:
        return outcome
    asked = [Output(element=tyre.name, quantity=name, span=tyre.span) for tyre in tyres for name in ("Fy", "Fz")]
    try:
        run = run_scene(model, scene, asked)
    except (ModelError, RunError, SimulatorError):
        return outcome
    if run.failure is not None:
        return outcome
    peaks = {t.name: (float(np.abs(run[f"{t.name}.Fy"]).max()), float(run[f"{t.name}.Fz"].max())) for t in tyres}
    left = tuple(
        Note(element=t.name, text=f"keeps its lateral force, which reaches {peaks[t.name][0]:.3g} N", span=t.span)
        for t in tyres if peaks[t.name][0] > SMALL * peaks[t.name][1]
    )  # fmt: skip
    return replace(outcome, left=left) if left else _without_lateral(outcome, tyres, peaks)


def _without_lateral(outcome: Outcome, tyres: list[Tyre], peaks: dict[str, tuple[float, float]]) -> Outcome:
    limits = {t.name: float(f"{SMALL * peaks[t.name][1]:.2g}") for t in tyres}
    side = variable("side")
    guards = tuple(Guard(force=t, margins=tuple(sympy.Float(limits[t.name]) - s * side for s in (1, -1)), index=None) for t in tyres)
    rolling = tuple(replace(f, lateral=False) if isinstance(f, Tyre) and f.name in limits else f for f in outcome.model.forces)
    text = "loses its lateral force of up to {:.3g} N, guarded by |Fy| <= {:g} N"
    notes = tuple(Note(element=t.name, text=text.format(peaks[t.name][0], limits[t.name]), span=t.span) for t in tyres)
    model = replace(outcome.model, forces=rolling, guards=(*outcome.model.guards, *guards))
    return replace(outcome, model=model, done=notes)
