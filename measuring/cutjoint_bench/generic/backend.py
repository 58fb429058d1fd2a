"""The generic solver as an implementation beside generated code; its modules are imported when a model is compiled for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cutjoint.run.additions import Backend
from cutjoint_bench.generic import ADDITIONS, FOLDER, RUNTIME

if TYPE_CHECKING:
    from cutjoint.model.records import Model, Scene
    from cutjoint.run.artifact import Artifact


def _compile(model: Model, scene: Scene, method: str) -> Artifact:
    from cutjoint_bench.generic.artifact import compile_generic

    return compile_generic(model, scene, method=method)


BACKEND = Backend(
    name="generic", compile=_compile, code=(FOLDER, RUNTIME, ADDITIONS), solvers={"augmented": "eigen-ldlt", "classical": "klu"}
)
