"""Runs models from their text."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate


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


__all__ = ["compile_text", "completed", "read_reference", "simulate", "with_numerics"]
