"""The effect of a reduction on the picture of the full model's topology."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cutjoint.analysis.body_poses import BodyPose
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.sequence import ReducedModel
from cutjoint.topology.build import build_topology
from cutjoint.view.graph import draw_graph
from cutjoint.view.views import ViewSpec


def show_reduction(model: Model, scene: Scene, parameters: Mapping[str, float], variants: Sequence[ReducedModel]) -> ViewSpec:
    """The design position of the full model, and its topology: left-out elements are faint, changed ones have a note."""
    last = variants[-1]
    elements, kept = _names(model), _names(last.model)
    facts = [(v.name, f"{v.unknowns} coordinates, {v.equations} equations, {v.operations} operations") for v in variants]
    facts += [(note.element, note.words) for note in last.done if note.element not in elements]
    graph = draw_graph(build_topology(model), facts, _notes(last), gone=elements - kept)
    still = BodyPose(rotation=np.eye(3)[np.newaxis], shift=np.zeros((1, 3)))
    return ViewSpec(
        model=model, scene=scene, parameters=parameters, t=np.zeros(1), poses={body.name: still for body in model.bodies}, graph=graph,
        note=f"{last.name}, from the full model",
    )  # fmt: skip


def _names(model: Model) -> frozenset[str]:
    return frozenset([*(b.name for b in model.bodies), *(j.name for j in model.joints), *(g.name for g in model.gears)])


def _notes(variant: ReducedModel) -> Mapping[str, Sequence[str]]:
    notes: dict[str, list[str]] = {}
    for note in (*variant.done, *variant.left):
        notes.setdefault(note.element, []).append(note.words)
    return notes
