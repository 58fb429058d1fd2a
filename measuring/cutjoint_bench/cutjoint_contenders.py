"""The methods of cutjoint as contenders: every formulation, generic solver and linear solver that there is."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene, generate
from cutjoint.emit.source import Source
from cutjoint.methods import (
    DEFAULT_INTEGRATOR,
    DEFAULT_PRECISION,
    DEFAULT_SOLVER,
    INTEGRATORS,
    METHODS,
    Events,
    Implementation,
    Loops,
    names_of,
)
from cutjoint.package.errors import RunError
from cutjoint.reduce.sequence import ReducedModel, reduction_sequence
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import with_default_closure, with_loops
from cutjoint.run.simulation import simulate
from cutjoint.toolchain.cache import runtime_digest
from cutjoint.toolchain.temporary import temporary_folder
from cutjoint_bench.driver import ADDED_SOLVERS, ALL_SOLVERS
from cutjoint_bench.generic.artifact import compile_generic
from cutjoint_bench.generic.build import measuring_digest
from cutjoint_bench.records import Case, Contender
from cutjoint_bench.steps import common_step

#: Number types with the relative change of the accelerations at which a step ends: so small that rounding alone is left to see.
TOLERANCES: Mapping[str, float] = {"single": 1e-4, "double": 1e-10, "extended": 1e-13, "quad": 1e-18}

#: Integrators besides the default, by the method that they take; methods without others are left out.
_INTEGRATORS = tuple(
    (method, names) for method in METHODS
    if (names := [i.name for i in INTEGRATORS.values() if method in i.methods and i.name != DEFAULT_INTEGRATOR])
)  # fmt: skip


#: Adaptive integrators that are tried with embedded loops, by methods.
ADAPTIVE_IN_LOOPS = (("recursive", "dormand-prince"), ("recursive", "dop853"), ("recursive-newton", "radau5"))


@dataclass(frozen=True, kw_only=True)
class OwnRunner:
    """A compiled case; ``events`` are treated otherwise than the integrator would."""

    artifact: Artifact
    solver: str | None = None
    integrator: str = DEFAULT_INTEGRATOR
    events: Events | None = None
    tolerance: float | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def configuration(self) -> Mapping[str, str]:
        """Compiler, flags and digest of the generated code."""
        a = self.artifact
        made = {"compiler": a.binary.compiler, "flags": " ".join(a.binary.flags), "precision": a.precision}
        return {**made, **identity(a.source, added=has_added(a))}

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        """A run whose rows are some of the case's.

        It is of a copy of the simulator: where the pages of a file lie in memory changes times by up to 40 %, and stays as long as the file
        is there, so that repetitions of the same one would not show it.
        """
        scene, binary = self.artifact.scene, self.artifact.binary
        with temporary_folder() as folder:
            copied = replace(binary, path=Path(shutil.copy2(binary.path, folder)))
            artifact = replace(self.artifact, scene=replace(scene, output_step=common_step(dt, scene.output_step)), binary=copied)
            steps = folder / "steps.csv" if measured else None
            events = self.events or INTEGRATORS[self.integrator].events
            return simulate(
                artifact, dt=dt, solver=self.solver, integrator=self.integrator, events=events, tolerance=self.tolerance,
                parameters=self.parameters, steps=steps, error=False, check=False,
            )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class AdaptiveRunner(OwnRunner):
    """A compiled case whose integrator takes steps of its own: ``dt`` says how accurate it is asked to be.

    The tolerance is 1e-6 at the scene's own step and goes with the fifth power, as the errors of such steps do.
    """

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        """A run whose rows are the case's."""
        step = self.artifact.scene.numerics.of_method(self.artifact.method).step
        with_tolerance = replace(self, tolerance=tolerance_of(dt, step))
        return OwnRunner.__call__(with_tolerance, self.artifact.scene.output_step, measured=measured)


def tolerance_of(dt: float, own: float) -> float:
    """The tolerance of adaptive steps that stands for a step size, beside a scene's own (s), to three digits."""
    return float(f"{min(max(1e-6 * (dt / own) ** 5, 1e-13), 1e-2):.3g}")


def tolerated_steps(own: float) -> list[float]:
    """The step sizes that stand for tolerances from 1e-2 to 1e-12, two a decade and 1e-6 among them."""
    return [own * 10.0 ** ((6 - k / 2) / 5) for k in range(4, 25)]


def cutjoint_contenders() -> Iterator[Contender]:
    """Generated code by each method in the order of METHODS, then its variants.
    Other integrators, steps that end at events, without lanes, of the reduced model, other solvers, generic solvers."""
    for method in METHODS:
        yield _contender(method, method, "generated", method=method)
    for method, integrators in _INTEGRATORS:
        for integrator in integrators:
            yield _contender(f"{method}/{integrator}", f"{method}, {integrator}", "integrators", method=method, integrator=integrator)
    for method, _ in _INTEGRATORS:
        yield _contender(f"{method}/events", f"{method}, steps end at events", "integrators", method=method, events=Events.LOCATED)
    for method in METHODS:
        yield _contender(f"{method}/scalar", f"{method}, without lanes", "scalar", method=method, lanes=False)
    for method in METHODS:
        yield Contender(
            name=f"{method}/reduced", label=f"{method}, reduced model", group="reduced", prepare=partial(_reduced, method=method),
            identify=partial(_identify_reduced, method=method),
        )  # fmt: skip
    for method, integrators in _INTEGRATORS:
        for integrator in (x for x in integrators if INTEGRATORS[x].adaptive):
            yield Contender(
                name=f"{method}/{integrator}/reduced", label=f"{method}, {integrator}, reduced model", group="reduced",
                prepare=partial(_reduced, method=method, integrator=integrator),
                identify=partial(_identify_reduced, method=method, integrator=integrator), adaptive=True,
            )  # fmt: skip
    for method, integrator in (*((m, DEFAULT_INTEGRATOR) for m, _ in _INTEGRATORS), *ADAPTIVE_IN_LOOPS):
        name = method if integrator == DEFAULT_INTEGRATOR else f"{method}/{integrator}"
        for ending, events in (("", None), *([(", steps pass over events", Events.CROSSED)] if integrator != DEFAULT_INTEGRATOR else [])):
            yield _contender(
                f"{name}/functions{'/crossed' if ending else ''}", f"{name.replace('/', ', ')}, embedded loops{ending}", "functions",
                method=method, integrator=integrator, loops=Loops.EMBEDDED, events=events,
            )  # fmt: skip
    for method in METHODS:
        for solver in (s.name for s in ALL_SOLVERS.values() if s.suits(METHODS[method]) and s.name != DEFAULT_SOLVER):
            yield _contender(f"{method}/{solver}", f"{method}, {solver}", "solvers", method=method, solver=solver)
    for method in names_of(METHODS, lambda m: m.has_generic):
        yield Contender(
            name=f"{method}/generic", label=f"{method}, generic solver", group="generic", prepare=partial(_prepare_generic, method=method),
            identify=partial(identify_code, method=method, implementation=Implementation.GENERIC),
            options=partial(command_options, method=method, implementation=Implementation.GENERIC.value),
        )  # fmt: skip


def precision_contenders() -> Iterator[Contender]:
    """Each method in each number type; then the Lagrangian ones with the balance in 64 bits and the factors in 53."""
    for method in METHODS:
        for precision, tolerance in TOLERANCES.items():
            yield _contender(
                f"{method}/{precision}", f"{method}, {precision}", "precision", method=method, precision=precision, tolerance=tolerance
            )
    for method, solver in (("augmented", "double-ldlt"), ("classical", "double-lu")):
        yield _contender(
            f"{method}/mixed", f"{method}, extended with factors in double", "precision", method=method, precision="extended",
            solver=solver, tolerance=TOLERANCES["extended"],
        )  # fmt: skip


def _contender(name: str, label: str, group: str, **how: Any) -> Contender:
    adaptive = INTEGRATORS[how.get("integrator", DEFAULT_INTEGRATOR)].adaptive
    is_named = how.get("lanes", True) and how.get("solver") in (None, *ALL_SOLVERS)
    options = partial(command_options, **how) if is_named else None
    return Contender(
        name=name, label=label, group=group, prepare=partial(_prepare, **how), identify=partial(identify_code, **how), options=options,
        adaptive=adaptive,
    )  # fmt: skip


def command_options(
    case: Case, dt: float, *, method: str, solver: str | None = None, precision: str = DEFAULT_PRECISION, tolerance: float | None = None,
    integrator: str = DEFAULT_INTEGRATOR, events: Events | None = None, loops: str | None = None, implementation: str | None = None,
    lanes: bool = True,
) -> list[str]:  # fmt: skip
    """The options of `cutjoint simulate` for a run of a contender at a step or at the tolerance that it stands for."""
    assert lanes, "no option leaves lanes out"
    steps: dict[str, object] = {"dt": dt}
    if INTEGRATORS[integrator].adaptive:
        steps, tolerance = {}, tolerance_of(dt, case.scene.numerics.of_method(method).step)
    wanted: dict[str, object] = {
        "method": method, "implementation": implementation, "integrator": integrator, "loops": loops, **steps,
        "solver-tolerance": tolerance, "solver": solver, "precision": None if precision == DEFAULT_PRECISION else precision,
        "events": _events(case, integrator, events),
    }  # fmt: skip
    return [word for name, value in wanted.items() if value is not None for word in (f"--{name}", f"{value}")] + ["--no-error"]


def _events(case: Case, integrator: str, events: Events | None) -> Events | None:
    """What a command line has to say of events: nothing where the integrator's own are meant, and the scene names none."""
    usual = INTEGRATORS[integrator].events
    return (events or usual) if case.scene.numerics.events or events not in (None, usual) else None


def _prepare(
    case: Case, *, method: str, solver: str | None = None, lanes: bool = True, precision: str = DEFAULT_PRECISION,
    tolerance: float | None = None, integrator: str = DEFAULT_INTEGRATOR, events: Events | None = None,
    loops: str | None = None,
) -> OwnRunner:  # fmt: skip
    """The runner of a case.

    Raises:
        RunError: functions are asked for, and no loop can be closed by them.
    """
    additions = (solver,) if solver in ADDED_SOLVERS else ()
    options = CompileOptions(method=method, outputs=case.outputs, lanes=lanes, precision=precision, additions=additions)
    artifact = compile_scene(case.model, with_default_closure(with_loops(case.scene, loops), method, integrator), options)
    if loops == Loops.EMBEDDED and not artifact.topology.model.embedded_loops:
        raise RunError("no loops can be closed by functions")
    return _runner(integrator)(
        artifact=artifact, solver=solver, integrator=integrator, events=events, tolerance=tolerance, parameters=case.parameters
    )


def _prepare_generic(case: Case, *, method: str) -> OwnRunner:
    return OwnRunner(artifact=compile_generic(case.model, case.scene, method=method, outputs=case.outputs), parameters=case.parameters)


def _runner(integrator: str) -> type[OwnRunner]:
    return AdaptiveRunner if INTEGRATORS[integrator].adaptive else OwnRunner


def identify_code(
    case: Case, *, method: str, implementation: str = Implementation.GENERATED, lanes: bool = True, precision: str = DEFAULT_PRECISION,
    solver: str | None = None, loops: str | None = None, integrator: str = DEFAULT_INTEGRATOR, **_: object,
) -> Mapping[str, str]:  # fmt: skip
    """The `identity` of what a case's generated code is now, without compiling it."""
    scene = with_loops(case.scene, loops)
    if implementation != Implementation.GENERIC:
        scene = with_default_closure(scene, method, integrator)
    made = generate(case.model, scene, case.outputs, method=method, lanes=lanes, precision=precision)
    added = implementation == Implementation.GENERIC or precision != DEFAULT_PRECISION or solver in ADDED_SOLVERS
    return identity(made[-1], added=added)


def has_added(artifact: Artifact) -> bool:
    """Return whether a simulator has C++ of this package: it is the generic solver, or its driver has additions."""
    return artifact.implementation.is_generic or artifact.precision != DEFAULT_PRECISION or bool(artifact.additions)


def identity(source: Source, *, added: bool = False) -> Mapping[str, str]:
    """Identity of generated code besides machine and compiler: its digest and that of the runtime.
    C++ that this package has ``added`` counts too."""
    return {"digest": source.digest, "runtime": measuring_digest() if added else runtime_digest()}


def _reduced(case: Case, *, method: str, integrator: str = DEFAULT_INTEGRATOR) -> OwnRunner:
    variant = _last_exact(case, method)
    artifact = compile_scene(variant.model, with_default_closure(variant.scene, method, integrator), CompileOptions(method=method))
    return _runner(integrator)(artifact=artifact, integrator=integrator, parameters=case.parameters)


def _identify_reduced(case: Case, *, method: str, integrator: str = DEFAULT_INTEGRATOR) -> Mapping[str, str]:
    variant = _last_exact(case, method)
    scene = with_default_closure(variant.scene, method, integrator)
    return identity(generate(variant.model, scene, scene.outputs, method=method)[-1])


def _last_exact(case: Case, method: str) -> ReducedModel:
    """The last exact reduced model of the reduction sequence.

    Raises:
        RunError: there is none but the full model.
    """
    sequence = reduction_sequence(case.model, replace(case.scene, outputs=case.outputs), method)
    variants = [variant for variant in sequence if variant.motion == "exact"]
    if len(variants) == 1:
        raise RunError("no pass makes the model smaller")
    return variants[-1]
