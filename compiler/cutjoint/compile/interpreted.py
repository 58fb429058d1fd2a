"""Interpreted models: the interpreter is compiled once for all models."""

from collections.abc import Sequence
from functools import partial
from time import perf_counter

from cutjoint.compile.derivation import fallback, schedule_method
from cutjoint.emit.interpreted import emit_interpreted
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.records import Equations, SystemEquations
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, METHODS, Implementation
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package.errors import RunError
from cutjoint.program.records import Program
from cutjoint.run.artifact import Artifact, require_choice
from cutjoint.run.scenes import with_default_closure
from cutjoint.toolchain.build import FLAGS, build_interpreter
from cutjoint.toolchain.compiler import find_compiler, must_interpret
from cutjoint.toolchain.drivers import interpreter_is_there


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
    start = schedule_recursive(equations.start, lanes=True) if isinstance(equations, SystemEquations) else None
    source, description = emit_interpreted(program, equations, start)
    generated = perf_counter()
    # Binary
    binary = build_interpreter(source.driver)
    return Artifact(
        scene=scene, equations=equations, program=program, source=source, binary=binary, method=method,
        implementation=Implementation.INTERPRETED, precision=DEFAULT_PRECISION, generate_seconds=generated - begin,
        compile_seconds=perf_counter() - generated, description=description,
        exact=fallback(equations, lambda loops, exact: compile_interpreted(loops, exact, method=method, outputs=outputs)),
        by_method=partial(interpreted_by, model, scene),
    )  # fmt: skip


def interpreted_by(model: Model, scene: Scene, method: str) -> Artifact | None:
    """The interpreted model by another method; None if its simulator is not built yet."""
    driver = "lagrangian" if METHODS[method].has_system else "recursive"
    if model.functions or not (must_interpret() or interpreter_is_there(driver, find_compiler(), FLAGS)):
        return None
    return compile_interpreted(model, with_default_closure(scene, method, None), method=method)
