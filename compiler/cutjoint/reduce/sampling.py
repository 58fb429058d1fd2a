"""Runs that passes look at, by the recursive method."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.interpreted import compile_interpreted
from cutjoint.methods import DEFAULT_METHOD, METHODS
from cutjoint.model.records import Model, Output, Scene
from cutjoint.pipeline import compile_scene
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate

#: Of `compiling_seconds`, s: some, and some for each operation of an evaluation; a system's factorisation is as long as its evaluation.
_COMPILING, _COMPILING_AN_OPERATION, _WITH_FACTORISATION = 1.0, 1.5e-4, 2

#: Seconds that an interpreted operation takes, in all evaluations of a step, and of steps that are halved twice.
_INTERPRETING = 0.4e-9 * 5 * (1 + 2 + 4)


def run_scene(model: Model, scene: Scene, outputs: Sequence[Output] | None = None) -> Trajectory:
    """A scene's run, which may have failed, with ``outputs`` instead of the scene's; interpreted where that takes less than compiling.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError, RunError, SimulatorError: the scene cannot be run.
        ToolchainError: the C++ side failed.
    """
    artifact = compile_interpreted(model, scene, outputs=outputs)
    operations = artifact.compilation.operations
    steps = scene.end / scene.numerics.of_method(DEFAULT_METHOD).step
    if _INTERPRETING * steps * operations > compiling_seconds(operations, DEFAULT_METHOD):
        artifact = compile_scene(model, scene, outputs=outputs)
    return simulate(artifact, check=False)


def compiling_seconds(operations: int, method: str) -> float:
    """About what compiling takes, s, of a model with so many operations an evaluation."""
    return _COMPILING + _COMPILING_AN_OPERATION * operations * (_WITH_FACTORISATION if METHODS[method].has_system else 1)
