"""Tyres that roll straight on: their lateral forces are left out, an approximation, and guards watch that these would have stayed small."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import sympy

from cutjoint.formulate.forces import SIDE, is_active
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Guard, Model, Output, Scene, Tyre
from cutjoint.reduce.records import Note, Outcome
from cutjoint.reduce.sampling import run_scene
from cutjoint.run.errors import RunError
from cutjoint.run.simulator import SimulatorError

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
        Note(element=t.name, words=f"keeps its lateral force, which reaches {peaks[t.name][0]:.3g} N", span=t.span)
        for t in tyres if peaks[t.name][0] > SMALL * peaks[t.name][1]
    )  # fmt: skip
    return replace(outcome, left=left) if left else _without_lateral(outcome, tyres, peaks)


def _without_lateral(outcome: Outcome, tyres: list[Tyre], peaks: dict[str, tuple[float, float]]) -> Outcome:
    limits = {t.name: float(f"{SMALL * peaks[t.name][1]:.2g}") for t in tyres}
    guards = tuple(Guard(force=t, margins=tuple(sympy.Float(limits[t.name]) - s * SIDE for s in (1, -1)), index=None) for t in tyres)
    rolling = tuple(replace(f, lateral=False) if isinstance(f, Tyre) and f.name in limits else f for f in outcome.model.forces)
    words = "loses its lateral force of up to {:.3g} N, guarded by |Fy| <= {:g} N"
    notes = tuple(Note(element=t.name, words=words.format(peaks[t.name][0], limits[t.name]), span=t.span) for t in tyres)
    model = replace(outcome.model, forces=rolling, guards=(*outcome.model.guards, *guards))
    return replace(outcome, model=model, done=notes)
