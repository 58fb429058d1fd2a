"""A model made ready for the generic solver, which runs it from a description."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

from cutjoint.compile.pipeline import generate
from cutjoint.formulate.natural.equations import LagrangianEquations
from cutjoint.formulate.records import Equations
from cutjoint.methods import CLOSURES, DEFAULT_METHOD, DEFAULT_PRECISION, METHODS, Implementation, join_and, names_of
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import AnyPath
from cutjoint.run.artifact import Artifact, require_choice
from cutjoint.run.scenes import find_scene
from cutjoint.toolchain.build import FLAGS
from cutjoint.topology.reading import read_model
from cutjoint_bench.generic.build import build_generic
from cutjoint_bench.generic.mechanism import describe_generic
from cutjoint_bench.generic.system import describe_generic_natural
from cutjoint_bench.mechanics_alone import is_reduced, require_mechanics_alone


def compile_generic_model(path: AnyPath, *, scene: str | None = None, **how: Any) -> Artifact:
    """A model file for the generic solver; ``how`` as in `compile_generic`.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError, RunError, MissingLibraryError, ToolchainError: as `compile_generic`.
    """
    model = read_model(path)
    return compile_generic(model, find_scene(model, scene), **how)


def compile_generic(
    model: Model, scene: Scene, *, method: str = DEFAULT_METHOD, flags: Sequence[str] = FLAGS, outputs: Sequence[Output] | None = None
) -> Artifact:  # fmt: skip
    """A model in a scene for the generic solver; ``outputs`` are instead of the scene's.

    The artifact has the code that would be generated too, which is not compiled: what the generic solver is compared with.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError: the model is wrong.
        RunError: there is no such method, it has no generic solver, or the generic solver does not take the model.
        MissingLibraryError: a library that orders the method's matrices is not installed.
        ToolchainError: the C++ side failed.
    """
    require_choice(method)
    _require_generic(model, scene, method)
    # Model -> Source and description
    begin = perf_counter()
    equations, program, source = generate(model, scene, scene.outputs if outputs is None else outputs, method=method)
    description = _describe(equations, scene)
    generated = perf_counter()
    # Binary
    binary = build_generic(flags=flags)
    return Artifact(
        scene=scene, equations=equations, program=program, source=source, binary=binary, method=method,
        implementation=Implementation.GENERIC, precision=DEFAULT_PRECISION, generate_seconds=generated - begin,
        compile_seconds=perf_counter() - generated, description=description,
    )  # fmt: skip


def _require_generic(model: Model, scene: Scene, method: str) -> None:
    if not METHODS[method].has_generic:
        methods = ", ".join(names_of(METHODS, lambda m: m.has_generic))
        raise RunError(f"{method} has no generic solver: there is one of {methods}; use --implementation generated")
    require_mechanics_alone(model)
    if is_reduced(model, scene):
        raise RunError("the generic solver knows neither guards nor columns of reduced models: run the full model")
    closure = METHODS[method].closure(scene.numerics.closure, Implementation.GENERIC)
    if not closure.has_generic:
        known = join_and(names_of(CLOSURES, lambda c: c.has_generic))
        raise RunError(f"the generic solver knows closure: {known} only, not {closure.name}; use --implementation generated")


def _describe(equations: Equations, scene: Scene) -> dict[str, Any]:
    """The model as the generic solver reads it."""
    if isinstance(equations, LagrangianEquations):
        return describe_generic_natural(equations)
    return describe_generic(equations.topology, scene, equations.outputs)
