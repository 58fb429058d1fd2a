"""The generic twin as an implementation beside generated code; its modules are imported when a model is compiled for it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cutjoint.extensions import Backend

if TYPE_CHECKING:
    from cutjoint.model.records import Model, Scene
    from cutjoint.run.artifact import Artifact

_HERE = Path(__file__).resolve().parent

#: The C++ of the twin, which includes the product's.
RUNTIME = _HERE.parent / "runtime"


def _compile(model: Model, scene: Scene, method: str) -> Artifact:
    from cutjoint_bench.twin.artifact import compile_generic

    return compile_generic(model, scene, method=method)


BACKEND = Backend(name="generic", compile=_compile, code=(_HERE, RUNTIME))
