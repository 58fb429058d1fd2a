"""A model's runs with one setting after another, as calibrations make them, and their work: instructions estimated from counts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cutjoint.compile.derivation import emit_scheduled, schedule_method
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.emit.source import Generated
from cutjoint.formulate.records import Equations, SystemEquations
from cutjoint.methods import METHODS, STEPS
from cutjoint.model.records import Model, Scene
from cutjoint.program.records import Program
from cutjoint.reduce.sampling import compiling_seconds
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate

#: Instructions of an evaluation of the recursive method and of one with Newton's iteration: for each of its program, for the step's own
#: work, for each equation of a loop, or each unknown, and, with coupled stages, for each multiply-add of a factorisation; of a projection
#: and of a tangent for each of their programs.  Fitted to callgrind's counts of generated code.
RECURSIVE, PROJECTION, NEWTON, TANGENT = (1.2, 1200.0, 120.0), 9.0, (0.75, 1700.0, 210.0, 4.4), 1.3
ROWS = (2.2, 1.9), (5.0, 6.5)  #: evaluations and tangents of a row by Newton's iteration, without and with equations of loops
INTERPRETING = 2e-9  #: the time of an interpreted operation, s


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Steps of an ``integrator``: equal ones of ``dt`` (s), or, with dt 0, adaptive ones with a ``tolerance``. ``events`` is one of Events,
    None for the integrator's."""

    integrator: str
    dt: float = 0.0
    tolerance: float = 0.0
    events: str | None = None

    @property
    def options(self) -> dict[str, Any]:
        """Options of a run with these steps."""
        return {"integrator": self.integrator, "events": self.events, **({"dt": self.dt} if self.dt else {"tolerance": self.tolerance})}

    @property
    def setting(self) -> float:
        """The length of equal steps, or the tolerance."""
        return self.dt or self.tolerance

    def __str__(self) -> str:
        return f"{1e3 * self.dt:.4g} ms" if self.dt else f"{self.tolerance:.1e}".replace("e-0", "e-")


class Trials:
    """Runs of a model by a method with given steps, without a goal.

    They are interpreted, and generated once these are estimated to have taken as long as compiling. ``scheduled`` is what
    `derivation.schedule_method` made of the model; ``iteration`` are the instructions of an evaluation.  Raises CutjointError: the method
    cannot run it.
    """

    def __init__(self, model: Model, scene: Scene, method: str, *, scheduled: tuple[Equations, Program] | None = None) -> None:
        self._scheduled = scheduled or schedule_method(model, scene, scene.outputs, method=method)
        self.artifact: Artifact = compile_interpreted(model, scene, method=method, scheduled=self._scheduled)
        self._operations = self._scheduled[1].operations(self.artifact.iteration)
        self.iteration = self._scheduled[1].instructions(self.artifact.iteration)
        self._left = compiling_seconds(self._operations, method)

    def run(self, steps: Steps, parameters: Mapping[str, float]) -> Trajectory:
        """A run, which may have failed. Raises RunError: no run has these steps; SimulatorError, ToolchainError: the C++ side failed."""
        if self._left < 0 and self.artifact.description is not None:
            self.artifact = self.compile()
        run = simulate(self.artifact, parameters=parameters, error=False, check=False, **steps.options)
        self._left -= INTERPRETING * run.evaluations * self._operations
        return run

    def compile(self) -> Artifact:
        """The generated code."""
        generated, method = Generated(*self._scheduled, emit_scheduled(*self._scheduled)), self.artifact.method
        return compile_scene(self.artifact.model, self.artifact.scene, CompileOptions(method=method), generated=generated)

    def work(self, run: Trajectory, steps: Steps) -> float:
        """The estimated instructions of a run's steps and of rows between steps, which have accelerations of their own.
        Initial positions and velocities, and the text of rows, take the same by all methods."""
        (equations, program), method, closing = self._scheduled, METHODS[self.artifact.method], len(self.artifact.mechanism.equation_names)
        coupled = STEPS[method.name][steps.integrator].by_residual
        rows = len(run.t) if coupled or not steps.dt else 0
        if not isinstance(equations, SystemEquations):
            evaluation, projection = weighted(RECURSIVE, self.iteration, 1, closing), PROJECTION * program.instructions("project")
            return (run.evaluations + rows) * evaluation + (rows or run.steps) * projection
        counts = program.instructions("dynamic_residual"), 1, equations.mechanism.unknowns + closing
        evaluation = weighted(NEWTON, *counts, equations.plan.multiply_adds if coupled and equations.plan else 0)
        evaluations, tangents = ROWS[closing > 0]
        solved = run.statistics.factorisations + tangents * rows
        return (run.evaluations + evaluations * rows) * evaluation + solved * TANGENT * self.iteration


def weighted(weights: Sequence[float], *counts: int) -> float:
    """The sum of counts, each times its weight."""
    return sum(weight * count for weight, count in zip(weights, counts, strict=True))
