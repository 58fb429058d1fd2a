"""A model's runs at one step after another, as calibrations make them: interpreted while that takes less than compiling."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from cutjoint.interpreted import compile_interpreted
from cutjoint.methods import METHODS
from cutjoint.model.records import Model, Scene
from cutjoint.pipeline import compile_scene
from cutjoint.program.records import Program
from cutjoint.reduce.sampling import compiling_seconds
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.run.steps import common_step

#: The function of a system that each iteration calls beside its tangent.
_RESIDUAL = "dynamic_residual"

#: Seconds that an interpreted operation takes, before a run has shown it.
_INTERPRETING = 4e-9


class Trials:
    """Runs of a model by a method whose steps are given, and which keep no tolerance."""

    def __init__(self, model: Model, scene: Scene, method: str) -> None:
        self._model, self._scene, self._method = model, scene, method
        self._interpreted = compile_interpreted(model, scene, method=method)
        self._left = compiling_seconds(self._operations, method)
        self._step_seconds = _INTERPRETING * self._operations
        self._is_compiled = False

    @property
    def is_compiled(self) -> bool:
        """Whether runs are by generated code."""
        return self._is_compiled

    @cached_property
    def compiled(self) -> Artifact:
        """The generated code, by which all further runs are."""
        self._is_compiled = True
        return compile_scene(self._model, self._scene, method=self._method)

    def run(self, dt: float, parameters: Mapping[str, float]) -> Trajectory:
        """A run of steps dt (s), whose rows are some of the scene's; it may have failed.

        Raises:
            SimulatorError: the simulator could not run.
            ToolchainError: the C++ side failed.
        """
        steps = self._scene.end / dt
        if self._is_compiled or self._left < steps * self._step_seconds:
            return run_at(self.compiled, dt, parameters)
        run = run_at(self._interpreted, dt, parameters)
        self._left -= run.seconds
        if run.failure is None:
            self._step_seconds = run.seconds / steps
        return run

    def instructions(self, run: Trajectory) -> float:
        """The instructions of a run's evaluations, less those that solve linear systems: what it takes at least, on whatever machine."""
        return count_instructions(self._interpreted.program, self._method, run)

    @property
    def _operations(self) -> int:
        return self._interpreted.program.operations(self._interpreted.iteration)


def count_instructions(program: Program, method: str, run: Trajectory) -> float:
    """The instructions of a run's evaluations; of tangents there are as many as factorisations."""
    evaluation = program.instructions(METHODS[method].iteration)
    if not METHODS[method].has_system:
        return run.effort.iterations * evaluation
    return run.effort.iterations * program.instructions(_RESIDUAL) + run.effort.factorisations * evaluation


def at_step(artifact: Artifact, dt: float) -> Artifact:
    """The artifact with rows that a step reaches."""
    return artifact.with_rows(common_step(dt, artifact.scene.output_step))


def run_at(artifact: Artifact, dt: float, parameters: Mapping[str, float]) -> Trajectory:
    """A run whose rows are some of the scene's."""
    return simulate(at_step(artifact, dt), dt=dt, parameters=parameters, error=False, check=False)
