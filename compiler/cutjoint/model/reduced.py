"""The marks by which a reduced model differs from one read from a file."""

from __future__ import annotations

from cutjoint.model.records import Model, RodForce, Scene


def is_reduced(model: Model, scene: Scene) -> bool:
    """Return whether a model has elements of passes: guards, sensors of rods, columns that stand for others."""
    return bool(model.guards or any(isinstance(r, RodForce) for r in model.reactions) or any(o.stands_for for o in scene.outputs))
