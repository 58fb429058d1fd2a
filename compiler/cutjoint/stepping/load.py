"""From a model file to a simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from cutjoint.compile.c_export import Standalone, make_standalone, needs_load_events
from cutjoint.compile.pipeline import generate
from cutjoint.methods import METHODS, STEPS, linearised_methods
from cutjoint.model.expressions.functions import functions_of_host, leave_to_host
from cutjoint.model.expressions.tunable import with_inputs
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import changing_parts, find_dependent_parts, parameter_values
from cutjoint.run.scenes import ModelLike, load_model, method_of, with_default_closure
from cutjoint.stepping.library import HostFunction, Lanes, Library
from cutjoint.stepping.simulation import Simulation
from cutjoint.toolchain.build import FLAGS


def load(
    model: ModelLike, *, scene: str | None = None, method: str | None = None, integrator: str | None = None, tunable: Sequence[str] = (),
    linearise: bool = False, adjoint: bool = False, poses: bool = False, external_wrenches: Sequence[str] = (), terrain: Sequence[str] = (),
    flags: Sequence[str] = FLAGS, functions: Mapping[str, Callable[..., object]] | None = None,
) -> Simulation:  # fmt: skip
    """Compile a model or its file for stepping, or find it in the cache; `Simulation.reset` comes next.

    Args:
        method, integrator: names of docs/reference/integrators.md; default: the scene's; else recursive, and trapezoidal
            if the scene has a ``dt``, or dormand-prince.
        tunable: patterns; constants whose names match become parameters.
        linearise, adjoint: generate derivatives; compiling takes several times as long.
        poses: generate poses of bodies, markers and wheel contacts.
        external_wrenches: bodies and markers with inputs ``NAME.wrench.fx`` to ``NAME.wrench.tz`` (N, N m, global axes).
        terrain: patterns of wheels with inputs of the ground under them.
        functions: functions that the model declares, as ctypes or callables ``(arguments, memory, results, partials)``.

    Raises:
        ModelError, EquationsError, RunError: the model or the scene is wrong, or there is no such method or
            integrator.
        ToolchainError: a tool is not installed, or the compiler failed.
    """
    read, chosen = load_model(model, scene, tunable)
    if functions is not None:
        read = leave_to_host(read)
    return load_scene(
        with_inputs(read, external_wrenches=external_wrenches, terrain=terrain), chosen, method=method, integrator=integrator,
        linearise=linearise, adjoint=adjoint, poses=poses, flags=flags, functions=functions,
    )  # fmt: skip


def load_scene(
    model: Model, scene: Scene, *, method: str | None = None, integrator: str | None = None, linearise: bool = False,
    adjoint: bool = False, poses: bool = False, flags: Sequence[str] = FLAGS, functions: Mapping[str, Callable[..., object]] | None = None,
) -> Simulation:  # fmt: skip
    """Compile a scene of a loaded model; arguments and errors as of `load`."""
    method = method or method_of(scene, linearised_methods() if linearise or adjoint or poses else METHODS)
    if method not in STEPS:
        raise RunError(f"method: '{method}' is not one of simulations to step, {', '.join(STEPS)}")
    scene = with_default_closure(scene, method, integrator)
    load_events = (linearise or adjoint) and needs_load_events(scene, method, integrator)
    generated = generate(model, scene, scene.outputs, method=method, poses=poses, load_events=load_events, trims=True)
    alone = partial(make_standalone, generated, integrator=integrator, linearise=linearise, adjoint=adjoint)
    standalone = alone()

    def build() -> Path:
        return alone(side_by_side=True).with_code("stepping/rollout.cpp.jinja").build_library(flags)

    hosted = _functions_of(model, functions or {})
    fits = standalone.fits_lanes and not hosted  # a host function belongs to one simulation
    lanes = Lanes(standalone.name, generated.program.operations("evaluate"), build) if fits else None
    given = scene if scene.trim is None else replace(scene, trim=None, assemble=())
    changes = {"positions", "rates"} & set(changing_parts(model, given))
    find_start = partial(_find_start, model, given) if changes else None
    more = {"lanes": lanes, "functions": hosted, "find_start": find_start, "is_trimmed": scene.trim is not None}
    return open_standalone(standalone, standalone.build_library(flags), standalone.library.files, **more)


def open_standalone(standalone: Standalone, library: Path, files: Mapping[str, str], **more: Any) -> Simulation:
    """Open a simulation of a C export by its ``library``, with the header among ``files``; ``more`` are arguments of `Library`."""
    header = next(text for name, text in files.items() if name.endswith(".h"))
    return Simulation(Library(library, standalone.name, header, steps=standalone.steps, settings=standalone.settings, **more))


def _find_start(model: Model, scene: Scene, parameters: Mapping[str, float]) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """Coordinates and speeds of a scene's start with ``parameters``; empty if these are the compiled ones."""
    usual = parameter_values(model, {})
    changed = {**usual, **{name: value for name, value in parameters.items() if name in usual}}
    found = find_dependent_parts(model, scene, changed, ("positions", "rates")) if changed != usual else {}
    return found.get("positions", {}), found.get("rates", {})


def _functions_of(model: Model, callables: Mapping[str, Callable[..., object]]) -> dict[str, HostFunction]:
    names = functions_of_host(model)
    if not names:
        return {}
    if set(names) != set(callables):
        raise RunError(f"functions: the model has {', '.join(names)}, not {', '.join(callables) or 'none'}; give a callable for each name")
    found = {}
    for function in model.functions:
        numbers, memory = len(function.arguments), function.memory
        found[function.name] = HostFunction(arguments=numbers, memory=memory, results=len(function.results), call=callables[function.name])
        if update := callables.get(f"{function.name}_update"):
            found[f"{function.name}_update"] = HostFunction(arguments=numbers, memory=memory, results=0, call=update)
    return found
