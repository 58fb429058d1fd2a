"""A model made ready for the interpreter: its program as data, for a simulator that is compiled once for all models."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

from cutjoint.compile.pipeline import schedule_method, way_on
from cutjoint.emit.interpreted import emit_interpreted
from cutjoint.emit.source import Source
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, Implementation
from cutjoint.model.records import Model, Output, Scene
from cutjoint.program.records import Program
from cutjoint.run.artifact import Artifact, require_choice
from cutjoint.toolchain.build import build_interpreter


def compile_interpreted(
    model: Model, scene: Scene, *, method: str = DEFAULT_METHOD, outputs: Sequence[Output] | None = None,
    scheduled: tuple[Equations, Program] | None = None,
) -> Artifact:  # fmt: skip
    """A model in a scene for the interpreter, of which nothing is compiled; ``outputs`` are instead of the scene's.  ``scheduled`` is what
    `pipeline.schedule_method` has made of it already.

    Raises:
        ModelError, EquationsError: the model is wrong.
        RunError: there is no such method.
        MissingLibraryError: a library that orders the method's matrices is not installed.
        ToolchainError: the C++ side, which is built where it is not there, failed.
    """
    require_choice(method)
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
        exact=way_on(equations, lambda loops, exact: compile_interpreted(loops, exact, method=method, outputs=outputs)),
    )  # fmt: skip


def _interpret(equations: Equations, program: Program) -> tuple[Source, dict[str, Any]]:
    if isinstance(equations, SystemEquations):
        from cutjoint.compile.systems import interpret_scheduled  # the recursive method does not wait for what this imports

        return interpret_scheduled(equations, program)
    assert isinstance(equations, RecursiveEquations)
    return emit_interpreted(program, equations)
