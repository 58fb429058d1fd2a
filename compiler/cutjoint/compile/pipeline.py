"""The compiler from end to end: read this first.

model.yaml -> Model -> Topology -> Equations -> Program -> Source -> Binary -> Trajectory

`derivation` makes all up to Source; `run.simulation` runs the binary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import inf
from time import perf_counter
from typing import Any

from cutjoint.analysis.aims import with_aims
from cutjoint.compile.c_export import freeze_start_parameters, needs_load_events, plan_export
from cutjoint.compile.derivation import emit_scheduled, fallback, schedule_method
from cutjoint.compile.interpreted import compile_interpreted, interpreted_by
from cutjoint.compile.options import DEFAULT, CompileOptions
from cutjoint.emit.source import Generated
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, PRECISIONS, Implementation
from cutjoint.model.expressions.functions import require_code
from cutjoint.model.expressions.tunable import with_inputs
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package.errors import EquationsError, MissingPartialsError
from cutjoint.run.artifact import Artifact, require_choice
from cutjoint.run.run_file import trimmed
from cutjoint.run.scenes import ModelLike, load_model, method_of, with_default_closure
from cutjoint.toolchain.background import BuildPending, build_in_background
from cutjoint.toolchain.build import build
from cutjoint.toolchain.compiler import must_interpret
from cutjoint.toolchain.drivers import Kind


def compile_model(model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), **choices: Any) -> Artifact:
    """Compile a model or its file for a scene, by default the only one; ``choices`` are fields of `CompileOptions`.

    Args:
        choices: the method is by default the scene's.
        tunable: patterns such as "*.stiffness"; constants whose names match become parameters.
    """
    read, chosen = load_model(model, scene, tunable)  # model.yaml -> Model
    options = CompileOptions(**{"method": method_of(chosen), **choices})
    return compile_scene(with_inputs(read, external_wrenches=options.external_wrenches, terrain=options.terrain), chosen, options)


def compile_scene(
    model: Model, scene: Scene, options: CompileOptions = DEFAULT, *, generated: Generated | None = None, patience: float = inf
) -> Artifact:  # fmt: skip
    """Compile a model for a scene; ``generated`` is the result of `generate`, if there is one.
    A build that takes more than ``patience`` (s) continues in another process.  Without a C++ compiler the program is interpreted, if the
    package has a simulator and no option requires generated code.

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
    made = _generate(model, scene, options) if generated is None else generated
    delivery = plan_export(_frozen_for_export(made, model, scene, options), options)
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
            by_method=partial(interpreted_by, model, scene),
        )  # fmt: skip

    if patience < inf and (background := build_in_background(made.source, flags=options.flags, patience=patience)) is not None:
        raise BuildPending(*background, made, seconds, finish)
    return finish()


def _frozen_for_export(generated: Generated, model: Model, scene: Scene, options: CompileOptions) -> Generated:
    """Source with start-only parameters as constants if the export allows it, else ``generated``."""
    is_hosted = options.out is not None and options.precision == DEFAULT_PRECISION
    hosted = freeze_start_parameters(model, scene, trims=True) if is_hosted else model
    return _generate(hosted, scene, options) if hosted.frozen else generated


def _generate(model: Model, scene: Scene, options: CompileOptions) -> Generated:
    derives = options.out is not None and (options.linearise or options.adjoint)
    return generate(
        model, scene, scene.outputs if options.outputs is None else options.outputs, method=options.method, lanes=options.lanes,
        precision=options.precision, poses=options.poses, trims=options.out is not None,
        load_events=derives and needs_load_events(scene, options.method, options.integrator, equal_steps=True),
    )  # fmt: skip


def generate(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str = DEFAULT_METHOD, lanes: bool = True,
    precision: str = DEFAULT_PRECISION, poses: bool = False, load_events: bool = False, trims: bool = False,
) -> Generated:  # fmt: skip
    """Derive the equations and the source. A scene's trim is solved once, here. With ``lanes``, isomorphic subtrees are evaluated together
    in SIMD registers. ``poses`` adds a function for poses of bodies. With ``load_events``, steps end where the load of a friction force
    passes zero. ``trims`` adds what a simulation needs to solve the trim for other parameters. Raises EquationsError: a derivative is
    needed that the code of a function does not have; others as of `compile_scene`."""
    lanes = lanes and PRECISIONS[precision].packed
    model, scene, _ = trimmed(model, scene, {})
    solved = scene.solved_trim if trims else None
    scene = replace(scene, solved_trim=solved)
    model, aims = with_aims(model, [(aim, aim.expression - aim.value) for aim in (() if solved is None else solved.aims)])
    try:
        equations, program = schedule_method(
            model, scene, outputs, method=method, lanes=lanes, poses=poses, load_events=load_events, aims=aims
        )  # fmt: skip
        return Generated(equations, program, emit_scheduled(equations, program, lanes=lanes, precision=precision))
    except MissingPartialsError as error:
        place = next(f.span for f in model.functions if f.name == error.function)
        raise EquationsError(f"{place}: {error}") from None
