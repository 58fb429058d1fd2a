"""Compiled models for tasks."""

from collections.abc import Sequence

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import ModelLike, load_model, method_of, with_default_closure


def compile_unless_compiled(
    model: ModelLike, scene: str | None = None, tunable: Sequence[str] = (), method: str | None = None, integrator: str | None = None,
    dt: float | None = None,
) -> Artifact:  # fmt: skip
    """A compiled model as it is; any other compiled by `compile_model`.
    The method is the scene's by default; the closure is that of the requested integrator, or of equal steps ``dt`` (s)."""
    if isinstance(model, Artifact) and scene is None and not tunable and method in (None, model.method):
        return model
    read, chosen = load_model(model, scene, tunable)
    wanted = method or method_of(chosen)
    return compile_scene(read, with_default_closure(chosen, wanted, integrator, dt), CompileOptions(method=wanted))
