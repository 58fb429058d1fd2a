"""The compiler's own methods as contenders: every formulation, twin and linear solver that there is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from cutjoint.bench.cases import common_step
from cutjoint.bench.records import Case, Contender
from cutjoint.pipeline import COMPARISON_SOLVERS, EXPLICIT, METHODS, SOLVERS, Artifact, compile_scene, simulate
from cutjoint.reduce.ladder import climb
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import RunError

#: Number types with the relative change of the accelerations at which a step ends: so small that rounding alone is left to see.
TOLERANCES: Mapping[str, float] = {"single": 1e-4, "double": 1e-10, "extended": 1e-13, "quad": 1e-18}

#: Solvers that need a symmetric matrix.
_SYMMETRIC = frozenset({"eigen-ldlt", "cholmod"})


@dataclass(frozen=True, kw_only=True)
class OwnRunner:
    """A compiled case."""

    artifact: Artifact
    solver: str = "emitted"
    integrator: str = "trapezoidal"
    tolerance: float | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def configuration(self) -> Mapping[str, str]:
        """Compiler, flags and digest of the generated code."""
        a = self.artifact
        return {"compiler": a.binary.compiler, "flags": " ".join(a.binary.flags), "digest": a.source.digest, "precision": a.precision}

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        """A run whose rows are some of the case's."""
        scene = self.artifact.scene
        artifact = replace(self.artifact, scene=replace(scene, output_step=common_step(dt, scene.output_step)))
        with TemporaryDirectory() as folder:
            steps = Path(folder) / "steps.csv" if measured else None
            return simulate(
                artifact, dt=dt, solver=self.solver, integrator=self.integrator, tolerance=self.tolerance, parameters=self.parameters,
                steps=steps,
            )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class AdaptiveRunner(OwnRunner):
    """A compiled case whose integrator takes steps of its own: ``dt`` says how accurate it is asked to be.

    The tolerance is 1e-6 at the scene's own step and goes with the fifth power, as the errors of such steps do.
    """

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        """A run whose rows are the case's."""
        own = self.artifact.scene.numerics.of_method("recursive").dt
        with_tolerance = replace(self, tolerance=min(max(1e-6 * (dt / own) ** 5, 1e-13), 1e-2))
        return OwnRunner.__call__(with_tolerance, self.artifact.scene.output_step, measured=measured)


def own_contenders() -> Iterator[Contender]:
    """Generated code by each method in the order of METHODS; explicit integrators; without lanes; of the reduced model; other solvers;
    generic twins."""
    for method in METHODS:
        yield Contender(name=method, label=method, group="generated", prepare=partial(_prepare, method=method))
    for integrator in EXPLICIT:
        yield Contender(
            name=f"recursive/{integrator}", label=f"recursive, {integrator}", group="explicit",
            prepare=partial(_prepare, method="recursive", integrator=integrator),
        )  # fmt: skip
    for method in METHODS:
        yield Contender(
            name=f"{method}/scalar", label=f"{method}, without lanes", group="scalar", prepare=partial(_prepare, method=method, lanes=False)
        )
    for method in METHODS:
        yield Contender(
            name=f"{method}/reduced", label=f"{method}, reduced model", group="reduced", prepare=partial(_reduced, method=method)
        )
    for method in METHODS[1:]:
        for solver in SOLVERS:
            if solver != "emitted" and (method == "augmented" or solver not in _SYMMETRIC):
                yield Contender(
                    name=f"{method}/{solver}", label=f"{method}, {solver}", group="solvers",
                    prepare=partial(_prepare, method=method, solver=solver),
                )  # fmt: skip
    for method in METHODS:
        yield Contender(
            name=f"{method}/generic", label=f"{method}, generic twin", group="generic",
            prepare=partial(_prepare, method=method, implementation="generic"),
        )  # fmt: skip


def _reduced(case: Case, *, method: str) -> OwnRunner:
    """The last exact rung of the ladder.

    Raises:
        RunError: there is none but the full model.
    """
    rungs = [rung for rung in climb(case.model, replace(case.scene, outputs=case.outputs), method) if rung.motion == "exact"]
    if len(rungs) == 1:
        raise RunError("no pass makes the model smaller")
    return OwnRunner(artifact=compile_scene(rungs[-1].model, rungs[-1].scene, method=method), parameters=case.parameters)


def precision_contenders() -> Iterator[Contender]:
    """Each method in each number type; then the Lagrangian ones with the balance in 64 bits and the factors in 53."""
    for method in METHODS:
        for precision, tolerance in TOLERANCES.items():
            yield Contender(
                name=f"{method}/{precision}", label=f"{method}, {precision}", group="precision",
                prepare=partial(_prepare, method=method, precision=precision, tolerance=tolerance),
            )  # fmt: skip
    for method, solver in (("augmented", "double-ldlt"), ("classical", "double-lu")):
        yield Contender(
            name=f"{method}/mixed", label=f"{method}, extended with factors in double", group="precision",
            prepare=partial(_prepare, method=method, precision="extended", solver=solver, tolerance=TOLERANCES["extended"]),
        )  # fmt: skip


def _prepare(
    case: Case, *, method: str, solver: str = "emitted", implementation: str = "generated", lanes: bool = True, precision: str = "double",
    tolerance: float | None = None, integrator: str = "trapezoidal",
) -> OwnRunner:  # fmt: skip
    artifact = compile_scene(
        case.model, case.scene, method=method, outputs=case.outputs, implementation=implementation, lanes=lanes,
        comparison=solver in COMPARISON_SOLVERS, precision=precision,
    )  # fmt: skip
    runner = AdaptiveRunner if integrator == "dormand-prince" else OwnRunner
    return runner(artifact=artifact, solver=solver, integrator=integrator, tolerance=tolerance, parameters=case.parameters)
