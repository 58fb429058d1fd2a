"""What distinguishes a reduced model from one that is read from a file."""

from __future__ import annotations

from cutjoint.model.records import Model, RodForce, Scene


def is_reduced(model: Model, scene: Scene) -> bool:
    """Whether a model has what only passes put in: guards, sensors of rods, columns that stand for others."""
    return bool(model.guards or any(isinstance(r, RodForce) for r in model.reactions) or any(o.stands_for for o in scene.outputs))
