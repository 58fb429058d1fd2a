"""The compiler from end to end: read this first.

    model.yaml -> Model -> Topology -> Equations -> Program -> Source -> Binary -> Trajectory

The last arrow, a run, is `run.simulation`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from time import perf_counter
from typing import Any

from cutjoint.analysis.mobility import require_soundness
from cutjoint.analysis.redundancy import require_loads
from cutjoint.analysis.shaky import require_firmness
from cutjoint.compile.c_export import for_hosts, plan_delivery
from cutjoint.compile.options import DEFAULT, CompileOptions
from cutjoint.emit.interpreted import emit_interpreted
from cutjoint.emit.simulator import emit
from cutjoint.emit.source import Generated, Source
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, METHODS, PLAIN_CLOSURE, PRECISIONS, Implementation, Loops
from cutjoint.model.functions import require_code
from cutjoint.model.records import Model, Output, Scene
from cutjoint.model.tunable import with_inputs
from cutjoint.package.errors import EquationsError, MissingPartialsError, RunError
from cutjoint.program.records import Program
from cutjoint.run.artifact import Artifact, require_choice
from cutjoint.run.scenes import ModelLike, load_model, method_of, with_default_closure, with_loops
from cutjoint.run.settings import find_closure
from cutjoint.toolchain.build import FLAGS, build, build_interpreter
from cutjoint.toolchain.compiler import find_compiler, must_interpret
from cutjoint.toolchain.drivers import Kind, interpreter_is_there
from cutjoint.toolchain.later import BuildPending, build_later
from cutjoint.topology.build import build_topology


def compile_model(model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), **choices: Any) -> Artifact:
    """Compile a model or its file for a scene, by default the only one; further ``choices`` as of `CompileOptions`,
    the method by default the scene's.

    Args:
        tunable: patterns such as "*.stiffness"; constants whose names match become parameters.
    """
    read, chosen = load_model(model, scene, tunable)  # model.yaml -> Model
    options = CompileOptions(**{"method": method_of(chosen), **choices})
    return compile_scene(with_inputs(read, external_wrenches=options.external_wrenches, terrain=options.terrain), chosen, options)


def take_artifact(
    model: ModelLike, scene: str | None = None, tunable: Sequence[str] = (), method: str | None = None, integrator: str | None = None,
    dt: float | None = None,
) -> Artifact:  # fmt: skip
    """A compiled model as it is, and any other compiled by `compile_model` with a method, the scene's where none is named, and with the
    closure of the integrator that is asked for, or of equal steps ``dt`` (s)."""
    if isinstance(model, Artifact) and scene is None and not tunable and method in (None, model.method):
        return model
    read, chosen = load_model(model, scene, tunable)
    wanted = method or method_of(chosen)
    return compile_scene(read, with_default_closure(chosen, wanted, integrator, dt), CompileOptions(method=wanted))


def compile_scene(
    model: Model, scene: Scene, options: CompileOptions = DEFAULT, *, generated: Generated | None = None, patience: float = inf
) -> Artifact:  # fmt: skip
    """Compile a model for a scene.  ``generated`` is what `generate` has made of it already.  Compiling that takes more than ``patience``
    (s) goes on in another process.  Where there is no compiler the program is interpreted, if the package has the simulator
    and the options say nothing that only generated code has.

    Raises:
        ModelError, EquationsError, RunError: the model or the choice is wrong, or they do not go together.
        MissingLibraryError, ToolchainError: a library or a tool is not installed, or the C++ compiler failed.
        BuildPending: compiling goes on, and meanwhile the program can be interpreted.
        OutputError: a file of ``out`` is the model, or cannot be written.
    """
    scene = with_default_closure(scene, options.method, options.integrator)
    require_choice(options.method, options.precision, options.additions)
    require_code(model)
    if options.can_be_interpreted and must_interpret():
        scheduled = None if generated is None else (generated.equations, generated.program)
        return compile_interpreted(model, scene, method=options.method, outputs=options.outputs, scheduled=scheduled)
    # Model -> Source
    begin = perf_counter()
    if generated is None:
        outputs = scene.outputs if options.outputs is None else options.outputs
        generated = generate(
            model, scene, outputs, method=options.method, lanes=options.lanes, precision=options.precision, poses=options.poses
        )  # fmt: skip
    made, delivery = generated, plan_delivery(_for_hosts(generated, model, scene, options), options)
    seconds, written = perf_counter() - begin, perf_counter()

    # Source -> Binary
    def finish() -> Artifact:
        kind = Kind(precision=options.precision, additions=tuple(options.additions))
        binary = build(made.source, flags=(*options.flags, *PRECISIONS[options.precision].flags), kind=kind)
        if delivery is not None:
            delivery.write(binary.path, options.flags)
        return Artifact(
            scene=scene, equations=made.equations, program=made.program, source=made.source, binary=binary, method=options.method,
            precision=options.precision, implementation=Implementation.GENERATED, generate_seconds=seconds,
            compile_seconds=perf_counter() - written, additions=tuple(options.additions),
            exact=fallback(made.equations, lambda loops, exact: compile_scene(loops, exact, replace(options, out=None))),
            by_method=partial(_interpreted_by, model, scene),
        )  # fmt: skip

    if patience < inf and (later := build_later(made.source, flags=options.flags, patience=patience)) is not None:
        raise BuildPending(later, made, seconds, finish)
    return finish()


def _for_hosts(generated: Generated, model: Model, scene: Scene, options: CompileOptions) -> Generated:
    """Parts of a C export."""
    hosted = for_hosts(model, scene) if options.out is not None and options.precision == DEFAULT_PRECISION else model
    if not hosted.frozen:
        return generated
    outputs = scene.outputs if options.outputs is None else options.outputs
    return generate(hosted, scene, outputs, method=options.method, lanes=options.lanes, poses=options.poses)


def compile_interpreted(
    model: Model, scene: Scene, *, method: str = DEFAULT_METHOD, outputs: Sequence[Output] | None = None,
    scheduled: tuple[Equations, Program] | None = None,
) -> Artifact:  # fmt: skip
    """A model in a scene for the interpreter: its program as data, for a simulator that is compiled once for all models.  ``outputs`` are
    instead of the scene's, ``scheduled`` is what `schedule_method` has made of it already.

    Raises:
        ModelError, EquationsError: the model is wrong.
        RunError: there is no such method.
        MissingLibraryError: a library that orders the method's matrices is not installed.
        ToolchainError: the C++ side, which is built where it is not there, failed.
    """
    require_choice(method)
    for function in model.functions:
        words = "only generated code calls functions of the user, and this is interpreted"
        raise RunError(f"{function.span}: function '{function.name}': {words}; use --implementation generated, where there is a choice")
    # Model -> Source
    begin = perf_counter()
    outputs = scene.outputs if outputs is None else outputs
    equations, program = scheduled or schedule_method(model, scene, outputs, method=method)
    source, description = _interpret(equations, program)
    generated = perf_counter()
    # Binary
    binary = build_interpreter(source.driver)
    return Artifact(
        scene=scene, equations=equations, program=program, source=source, binary=binary, method=method,
        implementation=Implementation.INTERPRETED, precision=DEFAULT_PRECISION, generate_seconds=generated - begin,
        compile_seconds=perf_counter() - generated, description=description,
        exact=fallback(equations, lambda loops, exact: compile_interpreted(loops, exact, method=method, outputs=outputs)),
        by_method=partial(_interpreted_by, model, scene),
    )  # fmt: skip


def _interpreted_by(model: Model, scene: Scene, method: str) -> Artifact | None:
    """The model by another method, None where the simulator would have to be built first."""
    driver = "lagrangian" if METHODS[method].has_system else "recursive"
    if model.functions or not (must_interpret() or interpreter_is_there(driver, find_compiler(), FLAGS)):
        return None
    return compile_interpreted(model, with_default_closure(scene, method, None), method=method)


def _interpret(equations: Equations, program: Program) -> tuple[Source, dict[str, Any]]:
    if isinstance(equations, SystemEquations):
        from cutjoint.compile.systems import interpret_scheduled  # the recursive method does not wait for what this imports

        return interpret_scheduled(equations, program)
    assert isinstance(equations, RecursiveEquations)
    return emit_interpreted(program, equations)


def generate(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str = DEFAULT_METHOD, lanes: bool = True,
    precision: str = DEFAULT_PRECISION, poses: bool = False,
) -> Generated:  # fmt: skip
    """The symbolic half; with ``lanes``, isomorphic subtrees are evaluated side by side in number types of which several fit a register,
    with ``poses`` the mechanism has the function of that name.

    Raises:
        EquationsError: a derivative is needed that the code of a function does not have; others as of `compile_scene`.
    """
    lanes = lanes and PRECISIONS[precision].packed
    try:
        equations, program = schedule_method(model, scene, outputs, method=method, lanes=lanes, poses=poses)
        return Generated(equations, program, emit_scheduled(equations, program, lanes=lanes, precision=precision))
    except MissingPartialsError as error:
        place = next(f.span for f in model.functions if f.name == error.function)
        raise EquationsError(f"{place}: {error}") from None


def schedule_method(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str = DEFAULT_METHOD, lanes: bool = True,
    poses: bool = False,
) -> tuple[Equations, Program]:  # fmt: skip
    """Derive the equations and the program of a scene, without its source."""
    # Model -> Topology -> Equations -> Program
    if METHODS[method].has_system:
        from cutjoint.compile.systems import schedule_system  # the recursive method does not wait for what this imports

        tunable = scene if METHODS[method].functions else with_loops(scene, Loops.EXACT)
        start = require_firmness(derive(model, tunable, (), poses=poses), method)
        return schedule_system(start.starting, method, tuple(outputs), lanes=lanes)
    closure = find_closure(scene.numerics, METHODS[method]).name
    recursive = require_firmness(derive(model, scene, outputs, closure=closure, poses=poses), method)
    return recursive, schedule_recursive(recursive, lanes=lanes)


def emit_scheduled(equations: Equations, program: Program, *, lanes: bool = True, precision: str = DEFAULT_PRECISION) -> Source:
    """The source of what `schedule_method` has made."""
    # Program -> Source
    if isinstance(equations, RecursiveEquations):
        return emit(program, equations)
    from cutjoint.compile import systems

    assert isinstance(equations, SystemEquations)
    return systems.emit_scheduled(equations, program, lanes=lanes, packed=PRECISIONS[precision].packed)


def derive(
    model: Model, scene: Scene, outputs: Sequence[Output], *, closure: str = PLAIN_CLOSURE, poses: bool = False
) -> RecursiveEquations:  # fmt: skip
    """The recursive equations of a model, which start the runs of every method, with loops as the scene has them; errors as in
    `compile_scene`."""
    topology = require_loads(build_topology(with_requested_loops(model, scene, DEFAULT_METHOD)), scene)
    return require_soundness(formulate_recursive(topology, scene, tuple(outputs), closure=closure, poses=poses))


def with_requested_loops(model: Model, scene: Scene, method: str) -> Model:
    """The model with loops closed as a scene has them for a method: by their equations, or by functions where they hold."""
    if scene.numerics.loops == Loops.EXACT or not METHODS[method].functions or model.assemblies:
        return model
    from cutjoint.analysis.assembled import assemble_loops  # others do not wait for what this imports

    return assemble_loops(model, scene).model


def fallback(equations: Equations, compiled: Callable[[Model, Scene], Artifact]) -> Callable[[], Artifact] | None:
    """Return a function that compiles the loops' equations, for runs that leave the range of functions; None where the scene stops."""
    topology, scene = equations.mechanism.topology, equations.mechanism.scene
    if not topology.model.assemblies or scene.on_violation == "stop":
        return None
    from cutjoint.analysis.assembled import without_functions  # others do not wait for what this imports

    return lambda: compiled(without_functions(topology), with_loops(scene, Loops.EXACT))
