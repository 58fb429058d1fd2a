"""A reduced model holds for its scene's inputs: their laws stand in it, and it has no inputs."""

from __future__ import annotations

from dataclasses import replace

from cutjoint.formulate.inputs import input_functions
from cutjoint.model.records import Binding
from cutjoint.reduce.half.plane import put_in
from cutjoint.reduce.records import Outcome


def fix_inputs(outcome: Outcome) -> Outcome:
    """The outcome with the scene's functions of time in place of inputs."""
    model, scene = outcome.model, outcome.scene
    laws = input_functions(model, scene)
    if not laws:
        return outcome
    guards = (replace(put_in(g, laws), force=put_in(g.force, laws)) for g in model.guards)
    settled = replace(
        model, parameters=tuple(p for p in model.parameters if p.binding is not Binding.INPUT),
        joints=tuple(put_in(j, laws) for j in model.joints), forces=tuple(put_in(f, laws) for f in model.forces), guards=tuple(guards),
    )  # fmt: skip
    return replace(outcome, model=settled, scene=replace(scene, inputs={}))
