"""A model made ready for the interpreter: its program as data, for a simulator that is compiled once for all models."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

from cutjoint.emit.interpreted import emit_interpreted
from cutjoint.emit.source import Source
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.lanes import schedule_recursive
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, METHODS, Implementation
from cutjoint.model.records import Model, Output, Scene
from cutjoint.pipeline import derive
from cutjoint.program.records import Program
from cutjoint.run.artifact import Artifact, require_choice
from cutjoint.toolchain.build import FLAGS, build_interpreter


def compile_interpreted(
    model: Model, scene: Scene, *, method: str = DEFAULT_METHOD, flags: Sequence[str] = FLAGS, outputs: Sequence[Output] | None = None,
    made: tuple[Equations, Program, Source] | None = None,
) -> Artifact:  # fmt: skip
    """A model in a scene for the interpreter, of which nothing is compiled; ``outputs`` are instead of the scene's.  ``made`` is what
    `pipeline.generate` has made of it already: it is not derived again but for a saddle point, whose pivots are chosen anew.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError: the model is wrong.
        RunError: there is no such method.
        MissingLibraryError: a library that orders the method's matrices is not installed.
        ToolchainError: the C++ side, which is built where it is not there, failed.
    """
    require_choice(method, DEFAULT_PRECISION, comparison=False)
    # Model -> Source
    begin = perf_counter()
    outputs = scene.outputs if outputs is None else outputs
    equations, program, source, description = _interpret(model, scene, tuple(outputs), method, made)
    generated = perf_counter()
    # Binary
    binary = build_interpreter(source.driver, flags=flags)
    return Artifact(
        scene=scene, equations=equations, program=program, source=source, binary=binary, method=method,
        implementation=Implementation.INTERPRETED, precision=DEFAULT_PRECISION, generate_seconds=generated - begin,
        compile_seconds=perf_counter() - generated, description=description,
    )  # fmt: skip


def _interpret(
    model: Model, scene: Scene, outputs: tuple[Output, ...], method: str, made: tuple[Equations, Program, Source] | None
) -> tuple[Equations, Program, Source, dict[str, Any]]:  # fmt: skip
    if METHODS[method].has_system:
        # The recursive method does not wait for what this imports.
        from cutjoint.systems import interpret_scheduled, interpret_system

        if made is None or METHODS[method].saddle_point:
            return interpret_system(derive(model, scene, ()).starting, method, outputs)
        system, program, _ = made
        assert isinstance(system, SystemEquations)
        return interpret_scheduled(system, program)
    if made is None:
        derived = derive(model, scene, outputs, closure=METHODS[method].closure(scene.numerics.closure).name)
        program = schedule_recursive(derived, lanes=True)
        return derived, program, *emit_interpreted(program, derived)
    equations, program, _ = made
    assert isinstance(equations, RecursiveEquations)
    return equations, program, *emit_interpreted(program, equations)
