"""A model's runs at one step after another, as calibrations make them: interpreted while that takes less than compiling.

Work in another thread goes on while this one derives equations or waits for a simulator or a compiler.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextvars import copy_context
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from threading import RLock, Thread
from typing import Any, TypeVar

from cutjoint.compile.derivation import emit_scheduled, schedule_method
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.emit.source import Generated
from cutjoint.formulate.records import Equations
from cutjoint.methods import METHODS
from cutjoint.model.records import Model, Scene
from cutjoint.program.records import Program
from cutjoint.reduce.sampling import compiling_seconds
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate

_RESIDUAL = "dynamic_residual"  #: the function of a system that each iteration calls in addition to its Jacobian
_INTERPRETING = 4e-9  #: initial estimate of the time of an interpreted operation, s
Result = TypeVar("Result")
DERIVING = RLock()  #: lock of threads that derive equations, since SymPy is not thread-safe


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Equal steps of ``dt`` (s), or, with dt 0, adaptive steps of an ``integrator`` with a ``tolerance``."""

    dt: float = 0.0
    integrator: str = ""
    tolerance: float = 0.0

    @property
    def is_equal(self) -> bool:
        """Return whether all are as long as the others."""
        return not self.integrator

    @property
    def options(self) -> dict[str, Any]:
        """Options of a run with these steps."""
        return {"dt": self.dt} if self.is_equal else {"integrator": self.integrator, "tolerance": self.tolerance}

    def __str__(self) -> str:
        return f"{1e3 * self.dt:.4g} ms" if self.is_equal else f"{self.integrator} {self.tolerance:.1e}"


class Trials:
    """Runs of a model by a method with given steps and without a goal; ``scheduled`` is what `derivation.schedule_method` made of it."""

    def __init__(self, model: Model, scene: Scene, method: str, *, scheduled: tuple[Equations, Program] | None = None) -> None:
        self._model, self._scene, self._method = model, scene, method
        with DERIVING:
            self._scheduled = scheduled or schedule_method(model, scene, scene.outputs, method=method)
            interpreted = compile_interpreted(model, scene, method=method, scheduled=self._scheduled)
            self._interpreted = interpreted.with_rows(scene.output_step)  # determines what its loops leave open
        self._left = compiling_seconds(self._operations, method)
        self._step_seconds = _INTERPRETING * self._operations
        self._last = 0.0
        self._compiling: Future[Artifact] | None = None

    @property
    def is_compiled(self) -> bool:
        """Return whether further runs are by generated code."""
        return self._compiling is not None

    @property
    def compiled(self) -> Artifact:
        """The generated code, when it is there. Raises ToolchainError: the C++ side failed."""
        return self.begin_compiling().result()

    def begin_compiling(self) -> Future[Artifact]:
        """Compile it in another thread, unless that was begun."""
        self._compiling = self._compiling or begin(self._compile)
        return self._compiling

    def _compile(self) -> Artifact:
        with DERIVING:
            generated = Generated(*self._scheduled, emit_scheduled(*self._scheduled))
        return compile_scene(self._model, self._scene, CompileOptions(method=self._method), generated=generated)

    def run(self, steps: Steps, parameters: Mapping[str, float]) -> Trajectory:
        """A run whose rows are some of the scene's; it may have failed.
        Raises SimulatorError: the simulator could not run; ToolchainError: the C++ side failed."""
        expected = self._scene.end / steps.dt * self._step_seconds if steps.is_equal else self._last
        if self.is_compiled or self._left < expected:
            return run_at(self.compiled, steps, parameters)
        run = run_at(self._interpreted, steps, parameters)
        self._left -= run.seconds
        if steps.is_equal and run.failure is None:
            self._step_seconds = run.seconds * steps.dt / self._scene.end
        elif not steps.is_equal:
            self._last = run.seconds
        return run

    def instructions(self, run: Trajectory) -> float:
        """The instructions of a run's evaluations, less those that solve linear systems: a lower bound for all machines."""
        return count_instructions(self._interpreted.program, self._method, run)

    @property
    def _operations(self) -> int:
        return self._interpreted.program.operations(self._interpreted.iteration)


def count_instructions(program: Program, method: str, run: Trajectory) -> float:
    """The instructions of a run's evaluations; of tangents there are as many as factorisations."""
    evaluation = program.instructions(METHODS[method].iteration)
    if not METHODS[method].has_system:
        return run.statistics.iterations * evaluation
    return run.statistics.iterations * program.instructions(_RESIDUAL) + run.statistics.factorisations * evaluation


def at_step(artifact: Artifact, steps: Steps) -> Artifact:
    """The artifact with rows that steps reach."""
    return artifact.with_rows(common_step(steps.dt, artifact.scene.output_step)) if steps.is_equal else artifact


def run_at(artifact: Artifact, steps: Steps, parameters: Mapping[str, float]) -> Trajectory:
    """A run whose rows are some of the scene's."""
    return simulate(at_step(artifact, steps), parameters=parameters, error=False, check=False, **steps.options)


def begin(work: Callable[[], Result]) -> Future[Result]:
    """Start work in a daemon thread, which does not delay the end of the program."""
    future: Future[Result] = Future()
    context = copy_context()  # who listens to the compiler

    def perform() -> None:
        try:
            future.set_result(context.run(work))
        except BaseException as error:
            future.set_exception(error)

    Thread(target=perform, daemon=True).start()
    return future


def exact(seconds: float) -> Fraction:
    """The short fraction that a step was written as."""
    return Fraction(repr(seconds)).limit_denominator(10**9)


def common_step(dt: float, row: float) -> float:
    """The shortest time that is a whole number of steps and of rows."""
    a, b = exact(dt), exact(row)
    return float(Fraction(lcm(a.numerator * b.denominator, b.numerator * a.denominator), a.denominator * b.denominator))
