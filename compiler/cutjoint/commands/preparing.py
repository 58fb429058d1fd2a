"""From a model file to a prepared run and its trajectory, as `cutjoint simulate` does without a cached run."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf

from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.skew import describe_geometry
from cutjoint.commands import options
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.compile.prepared import PreparedRun, Request, cache_run
from cutjoint.formulate.inputs import input_parameters, tunable_parameters
from cutjoint.formulate.records import Equations
from cutjoint.methods import (
    AUTO,
    DEFAULT_METHOD,
    DEFAULT_PRECISION,
    IMPLEMENTATIONS,
    METHODS,
    SOLVERS,
    Implementation,
    Loops,
    find_additions,
    join_and,
    join_or,
    names_of,
)
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.program.records import Program
from cutjoint.report.tables import topology_facts
from cutjoint.run.additions import Backend
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.reading import file_digests, read_model
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import changing_parts
from cutjoint.run.scenes import find_case, with_closure, with_default_closure, with_loops
from cutjoint.run.settings import Options, find_integrator
from cutjoint.toolchain.background import BuildPending
from cutjoint.toolchain.compiler import find_compiler, must_interpret

#: Executes a run; a function that it calls now and then may raise, which ends the run.
Execute = Callable[..., Trajectory]

#: If compilation takes longer than this (s), it continues while the program is interpreted.
PATIENCE = 2.0


@dataclass(frozen=True)
class FinishedRun:
    """A finished run: model, scene, method, ``parameters`` (SI units) and, of method auto, ``variant``."""

    model: Model
    scene: Scene
    method: str
    parameters: Mapping[str, float]
    variant: str = ""


def read_request(request: Request) -> tuple[Model, Scene, str]:
    """The model, the scene with the requested closure, and the method.

    Raises:
        ModelError: the file is wrong.
        RunError: there is no such scene, or the method has no closure.
    """
    model, scene = find_case(read_model(request.model, tunable=request.tunable, functions=request.functions), request.scene)
    method = request.method or scene.method or DEFAULT_METHOD
    able = names_of(METHODS, lambda m: m.functions)
    if request.loops == Loops.EMBEDDED and (method not in (*able, AUTO) or request.implementation == Implementation.GENERIC):
        words = f"only generated and interpreted programs of the methods {join_and(able)} have it"
        raise RunError(f"--loops embedded: {words}; use --loops exact")
    scene = with_loops(scene, request.loops)
    if request.options.accuracy is not None:
        scene = replace(scene, accuracy=request.options.accuracy, targets={})
    if request.closure is None:
        if request.implementation == Implementation.GENERIC:
            return model, scene, method
        return model, with_default_closure(scene, method, request.options.integrator, request.options.dt), method
    if method not in (able := names_of(METHODS, lambda m: request.closure in m.closures)):
        raise RunError(f"--closure {request.closure}: only the {join_or(able)} method has one; use --method {join_or(able)}")
    return model, with_closure(scene, request.closure), method


def prepare_and_run(
    request: Request, model: Model, scene: Scene, method: str, parameters: Mapping[str, float], execute: Execute
) -> tuple[PreparedRun, Trajectory]:  # fmt: skip
    """Compile a model that `read_request` found, with ``parameters`` (SI units) changed; execute the run and cache it.

    Raises:
        ModelError, EquationsError: the model is wrong.
        RunError: options exclude each other, or the model does not have what they name.
        MissingLibraryError: a library that orders the method's matrices is not installed.
        ToolchainError, SimulatorError: the C++ side failed.
    """
    try:
        patience = PATIENCE if request.implementation == AUTO and options.is_watched() else inf
        artifact = compile_request(request, model, scene, method, patience=patience)
    except BuildPending as compiling:
        with suppress(_CompiledFirst):
            return _run_meanwhile(request, model, scene, method, parameters, execute, compiling)
        artifact = compiling.wait()
    prepared = prepare(artifact, request.options)
    if artifact.topology.model.joints == model.joints:  # each run warns of a misfit that was taken out
        cache_run(request, model.text, prepared)
    if parameters:
        prepared = replace(prepared, run=make_simulator_run(artifact, request.options, parameters))
    return prepared, execute(prepared)


class _CompiledFirst(Exception):  # noqa: N818 -- no error
    """The compiled code is ready before the interpreted run has ended."""


def _run_meanwhile(
    request: Request, model: Model, scene: Scene, method: str, parameters: Mapping[str, float], execute: Execute, compiling: BuildPending,
) -> tuple[PreparedRun, Trajectory]:  # fmt: skip
    """Interpret the program while it is compiled, which ends it; nothing is cached, since the next run finds compiled code."""

    def watch() -> None:
        if compiling.done:
            raise _CompiledFirst

    artifact = _compile_interpreted(request, model, scene, method, compiling.generated[:2])
    artifact = replace(artifact, generate_seconds=compiling.seconds + artifact.generate_seconds)
    prepared = prepare(artifact, request.options, parameters)
    run = execute(prepared, watch)
    options.err.print(f"interpreted, since {compiling}; compiling continues in the background for later runs")
    return prepared, run


def compile_request(request: Request, model: Model, scene: Scene, method: str, *, patience: float = inf) -> Artifact:
    """The model compiled for a request.

    Raises:
        BuildPending: as `compile_scene`, if there is a ``patience``.
        ModelError, EquationsError, RunError, MissingLibraryError, ToolchainError: as `prepare_and_run`.
    """
    solver = request.options.solver
    if solver is not None and not METHODS[method].has_system:
        others = join_or(names_of(METHODS, SOLVERS[solver].suits))
        raise RunError(f"--solver {solver}: the {method} method has no linear solver; use --method {others}")
    by = Implementation.GENERATED if request.implementation == AUTO else Implementation(request.implementation)
    find_integrator(scene.numerics.of_method(method), METHODS[method], by, request.options)  # refused before minutes of compiling
    with options.progress_bar(f"compiling {request.model.name}"):
        if request.implementation == Implementation.GENERIC:
            backend: Backend = IMPLEMENTATIONS.load(request.implementation)
            if request.precision != DEFAULT_PRECISION:
                words = f"the generic solver runs in {DEFAULT_PRECISION}; use --implementation generated"
                raise RunError(f"--precision {request.precision}: {words}")
            return backend.compile(model, scene, method)
        if request.implementation == Implementation.INTERPRETED:
            return _compile_interpreted(request, model, scene, method)
        additions = find_additions(solver)
        if request.precision != DEFAULT_PRECISION or additions or model.functions:
            patience = inf  # only generated code has that
        if request.implementation == Implementation.GENERATED and must_interpret():
            find_compiler()  # its error says what is missing
        choices = CompileOptions(method=method, precision=request.precision, additions=additions)
        return compile_scene(model, scene, choices, patience=patience)


def _compile_interpreted(
    request: Request, model: Model, scene: Scene, method: str, scheduled: tuple[Equations, Program] | None = None
) -> Artifact:  # fmt: skip
    from cutjoint.compile.interpreted import compile_interpreted

    if request.precision != DEFAULT_PRECISION:
        raise RunError(f"--precision {request.precision}: programs are interpreted in {DEFAULT_PRECISION}; use --implementation generated")
    if find_additions(request.options.solver):
        raise RunError(f"--solver {request.options.solver}: only generated code has it; use --implementation generated")
    return compile_interpreted(model, scene, method=method, scheduled=scheduled)


def prepare(artifact: Artifact, requested: Options, parameters: Mapping[str, float] | None = None) -> PreparedRun:
    """The prepared run of a compiled model with options and ``parameters`` (SI units), and the facts reported about it."""
    model, mobility = artifact.topology.model, find_mobility(artifact.mechanism)
    counts = topology_facts(artifact.topology, mobility, describe_geometry(artifact.mechanism, mobility))
    return PreparedRun(
        model=model.name, counts=counts, places=artifact.places, compilation=artifact.compilation,
        dependent_parts=changing_parts(model, artifact.scene), inputs=tuple(p.name for p in input_parameters(model)),
        units={p.name: p.unit for p in (*tunable_parameters(model), *input_parameters(model))},
        run=make_simulator_run(artifact, requested, parameters), plots=artifact.scene.plots, display=model.display,
        files=file_digests(model),
    )  # fmt: skip


def assemble_and_run(
    request: Request, model: Model, scene: Scene, method: str, parameters: Mapping[str, float], execute: Execute
) -> tuple[PreparedRun, Trajectory, FinishedRun]:  # fmt: skip
    """Compile a model with loop embeddings and execute the run.

    Where the run leaves their range and cannot continue, it is repeated with loop equations, unless the scene has ``on_violation: stop``.
    """
    from cutjoint.analysis.embedding.embed import embed_loops  # imported here, so that other runs do not wait for it

    with options.progress_bar(f"closing loops of {request.model.name}"):
        outcome = embed_loops(model, scene)
    options.err.print_each((*outcome.done, *outcome.left))
    prepared, run = prepare_and_run(request, model, scene, method, parameters, execute)
    if run.failure is not None and run.failure.guards and scene.on_violation != "stop":
        options.err.print(f"{run.failure}; repeated with the loop equations")
        scene = with_loops(scene, Loops.EXACT)
        prepared, run = prepare_and_run(request, model, scene, method, parameters, execute)
    return prepared, run, FinishedRun(model, scene, method, parameters)
