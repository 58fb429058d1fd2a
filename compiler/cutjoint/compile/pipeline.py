"""The compiler from end to end: read this first.

    model.yaml -> Model -> Topology -> Equations -> Program -> Source -> Binary -> Trajectory

The last arrow, a run, is `run.simulation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from time import perf_counter
from typing import Any

from cutjoint.analysis.mobility import require_soundness
from cutjoint.compile.folders import plan_delivery
from cutjoint.emit.source import Source, emit
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.recursive.lanes import schedule_recursive
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, METHODS, PLAIN_CLOSURE, PRECISIONS, Implementation
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package.locations import AnyPath
from cutjoint.program.records import Program
from cutjoint.run.artifact import Artifact, require_choice
from cutjoint.run.scenes import find_scene
from cutjoint.toolchain.build import FLAGS, build
from cutjoint.toolchain.drivers import Kind
from cutjoint.toolchain.later import TakesLong, build_later
from cutjoint.topology.build import build_topology
from cutjoint.topology.reading import read_model


def compile_model(path: AnyPath, *, scene: str | None = None, opened: Sequence[str] = (), **how: Any) -> Artifact:
    """Compile a model file for a scene, the only one if none is named, the rest as in `compile_scene`; numbers whose names match one of the
    patterns ``opened``, such as "*.stiffness", become parameters."""
    model = read_model(path, opened=opened)  # model.yaml -> Model
    return compile_scene(model, find_scene(model, scene), **how)


def compile_scene(
    model: Model, scene: Scene, *, method: str = DEFAULT_METHOD, out: AnyPath | None = None, flags: Sequence[str] = FLAGS,
    outputs: Sequence[Output] | None = None, lanes: bool = True, comparison: bool = False, precision: str = DEFAULT_PRECISION,
    integrator: str | None = None, linearise: bool = False, patience: float = inf, made: tuple[Equations, Program, Source] | None = None,
) -> Artifact:  # fmt: skip
    """Compile a model for a scene; ``out`` receives a folder (`delivery`), which may have steps by another ``integrator`` than the scene's,
    and with ``linearise`` derivatives at a state.

    ``outputs`` are instead of the scene's.  ``comparison`` links the solvers of SuiteSparse too.  ``precision`` is one of PRECISIONS, the
    number type of the run; the start is found in double.  Compiling that takes more than ``patience`` (s) goes on in another process.
    ``made`` is what `generate` has made of all this already.

    Raises:
        ModelError, EquationsError, RunError: the model or the choice is wrong, or they do not go together.
        MissingLibraryError, ToolchainError: a library or a tool is not installed, or the C++ compiler failed.
        TakesLong: compiling goes on, and meanwhile the program can be interpreted.
        OutputError: a file of ``out`` is the model, or cannot be written.
    """
    require_choice(method, precision, comparison=comparison)
    # Model -> Source
    begin = perf_counter()
    outputs = scene.outputs if outputs is None else outputs
    equations, program, source = made = made or generate(model, scene, outputs, method=method, lanes=lanes, precision=precision)
    delivery = plan_delivery(out, made, method=method, precision=precision, integrator=integrator, lanes=lanes, linearise=linearise)
    generated = perf_counter()
    # Source -> Binary
    def finish() -> Artifact:
        binary = build(source, flags=(*flags, *PRECISIONS[precision].flags), kind=Kind(comparison=comparison, precision=precision))
        if delivery is not None:
            delivery.write(binary.path, flags)
        return Artifact(
            scene=scene, equations=equations, program=program, source=source, binary=binary, method=method, precision=precision,
            implementation=Implementation.GENERATED, generate_seconds=generated - begin, compile_seconds=perf_counter() - generated,
        )  # fmt: skip

    if patience < inf and (later := build_later(source, flags=flags, patience=patience)) is not None:
        raise TakesLong(later, made, generated - begin, finish)
    return finish()


def generate(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str = DEFAULT_METHOD, lanes: bool = True,
    precision: str = DEFAULT_PRECISION,
) -> tuple[Equations, Program, Source]:  # fmt: skip
    """The symbolic half; with ``lanes``, isomorphic subtrees are evaluated side by side in number types of which several fit a register."""
    lanes = lanes and PRECISIONS[precision].packed
    equations, program = schedule_method(model, scene, outputs, method=method, lanes=lanes)
    return equations, program, emit_scheduled(equations, program, lanes=lanes, precision=precision)


def schedule_method(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str = DEFAULT_METHOD, lanes: bool = True
) -> tuple[Equations, Program]:  # fmt: skip
    """Derive the equations and the program of a scene, without its source."""
    # Model -> Topology -> Equations -> Program
    if METHODS[method].has_system:
        from cutjoint.compile.systems import schedule_system  # the recursive method does not wait for what this imports

        return schedule_system(derive(model, scene, ()).starting, method, tuple(outputs), lanes=lanes)
    recursive = derive(model, scene, outputs, closure=METHODS[method].closure(scene.numerics.closure).name)
    return recursive, schedule_recursive(recursive, lanes=lanes)


def emit_scheduled(equations: Equations, program: Program, *, lanes: bool = True, precision: str = DEFAULT_PRECISION) -> Source:
    """The source of what `schedule_method` has made."""
    # Program -> Source
    if isinstance(equations, RecursiveEquations):
        return emit(program, equations)
    from cutjoint.compile import systems

    assert isinstance(equations, SystemEquations)
    return systems.emit_scheduled(equations, program, lanes=lanes, packed=PRECISIONS[precision].packed)


def derive(model: Model, scene: Scene, outputs: Sequence[Output], *, closure: str = PLAIN_CLOSURE) -> RecursiveEquations:
    """The recursive equations of a model, which start the runs of every method; errors as in `compile_scene`."""
    return require_soundness(formulate_recursive(build_topology(model), scene, tuple(outputs), closure=closure))
