"""Runs models from their text: interpreted, since compiling takes fifty times as long as such a run.

In `make full` the same tests run generated code, which `tests/compile_run` compares with the interpreter.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.compile import pipeline
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import DEFAULT, CompileOptions
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Scene
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate


def is_generated() -> bool:
    """Return whether generated code is run, as `make full` has it."""
    return os.environ.get("CUTJOINT_TEST_CODE") == "generated"


def compile_model(path: Path, scene: str | None = None, tunable: Sequence[str] = (), **choices: Any) -> Artifact:
    """As `pipeline.compile_model`, for the interpreter."""
    model = read_model(path, tunable=tunable)
    return compile_scene(model, find_scene(model, scene), CompileOptions(**choices))


def compile_scene(model: Model, scene: Scene, options: CompileOptions = DEFAULT) -> Artifact:
    """As `pipeline.compile_scene`, for the interpreter, which has no other options than the method and the outputs."""
    if is_generated() or options != CompileOptions(method=options.method, outputs=options.outputs):
        return pipeline.compile_scene(model, scene, options)
    return compile_interpreted(model, scene, method=options.method, outputs=options.outputs)


def compile_text(folder: Path, text: str, scene: str | None = None) -> Artifact:
    path = folder / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return compile_model(path, scene=scene)


def with_numerics(artifact: Artifact, **changes: Any) -> Artifact:
    """The binary with other settings of numerics."""
    numerics = replace(artifact.scene.numerics, **changes)
    return replace(artifact, scene=replace(artifact.scene, numerics=numerics))


def completed(run: Trajectory) -> Trajectory:
    assert run.failure is None, str(run.failure)
    return run


def read_reference(path: Path) -> dict[str, np.ndarray]:
    """Columns of a reference file by name."""
    lines = [x for x in path.read_text().splitlines() if not x.startswith("#")]
    table = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    return {name: table[:, i] for i, name in enumerate(lines[0].split(","))}


__all__ = ["compile_model", "compile_scene", "compile_text", "completed", "is_generated", "read_reference", "simulate", "with_numerics"]
