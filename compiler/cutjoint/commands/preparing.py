"""From a model file to a prepared run and its trajectory: what `cutjoint simulate` does where none is kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from cutjoint.analysis.mobility import find_mobility
from cutjoint.commands import options
from cutjoint.methods import COMPARISON_SOLVERS
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Scene
from cutjoint.pipeline import Artifact, compile_scene, make_ready
from cutjoint.prepared import Prepared, Request, keep_prepared
from cutjoint.report.tables import topology_facts
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import RunError, changing
from cutjoint.run.scenes import find_scene, with_closure

Play = Callable[[Prepared], Trajectory]


def read_request(request: Request) -> tuple[Model, Scene, str]:
    """The model, the scene with the closure that is asked for, and the method.

    Raises:
        ModelError: the file is wrong.
        RunError: there is no such scene, or the method has no closure.
    """
    model = read_model(request.model)
    scene = find_scene(model, request.scene)
    method = request.method or scene.method or "recursive"
    if request.closure is None:
        return model, scene, method
    if method != "recursive":
        raise RunError(f"--closure {request.closure}: only the recursive method has one; use --method recursive")
    return model, with_closure(scene, request.closure), method


def prepare_and_play(
    request: Request, model: Model, scene: Scene, method: str, parameters: Mapping[str, float], play: Play
) -> tuple[Prepared, Trajectory]:  # fmt: skip
    """Compile a model as `read_request` found it, with ``parameters`` (SI units) changed, and play the run; keep what it needed.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError: the model is wrong.
        RunError: what is asked for does not go together, or the model does not have it.
        MissingLibraryError: a library that orders the method's matrices is not installed.
        ToolchainError, SimulatorError: the C++ side failed.
    """
    artifact = compile_request(request, model, scene, method)
    figures = {name: getattr(request, name) for name in ("dt", "end", "tolerance", "solver", "integrator", "events", "iterations")}
    prepared = prepare(artifact, **figures)
    keep_prepared(request, model.text, prepared)
    if parameters:
        prepared = replace(prepared, run=make_ready(artifact, parameters=parameters, **figures))
    return prepared, play(prepared)


def compile_request(request: Request, model: Model, scene: Scene, method: str) -> Artifact:
    """The model compiled for what is asked for.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError, RunError, MissingLibraryError, ToolchainError: as `prepare_and_play`.
    """
    if method == "recursive" and request.solver != "emitted":
        raise RunError(f"--solver {request.solver}: the recursive method has no linear solver; use --method augmented or classical")
    with options.progress_bar(f"compiling {request.model.name}"):
        if request.implementation == "generic":
            return _compile_generic(request, model, scene, method)
        return compile_scene(
            model, scene, method=method, precision=request.precision, comparison=request.solver in COMPARISON_SOLVERS
        )  # fmt: skip


def _compile_generic(request: Request, model: Model, scene: Scene, method: str) -> Artifact:
    from cutjoint.twin.artifact import compile_generic

    if request.precision != "double":
        raise RunError(f"--precision {request.precision}: the generic twin runs in double; use --implementation generated")
    return compile_generic(model, scene, method=method)


def prepare(artifact: Artifact, **figures: Any) -> Prepared:
    """The run of a compiled model that figures ask for, as in `pipeline.simulate`, and what is told of it."""
    model = artifact.topology.model
    return Prepared(
        model=model.name, counts=topology_facts(artifact.topology, find_mobility(artifact.mechanism)), places=artifact.places,
        compilation=artifact.compilation, following=changing(model, artifact.scene), run=make_ready(artifact, **figures),
    )  # fmt: skip


def require_own(who: str, reason: str, **asked: Any) -> None:
    """Some ways to run have their own choice of what these options say.

    Raises:
        RunError: one of them is given.
    """
    usual = {"implementation": "generated", "solver": "emitted", "precision": "double"}
    for name in (name for name, value in asked.items() if value != usual.get(name)):
        raise RunError(f"--{name} cannot go with {who}, which {reason}")
