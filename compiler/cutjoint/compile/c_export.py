"""Mechanisms behind a C interface: C exports, libraries, and the files of ``compile --out``.

Program -> files -> simulator or library
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from math import sqrt
from pathlib import Path

import sympy

from cutjoint.analysis.mobility import find_mobility
from cutjoint.compile.options import CompileOptions
from cutjoint.emit.classes import Defaults, SimulationCode, System
from cutjoint.emit.library import emit_library
from cutjoint.emit.sizes import simulation_size
from cutjoint.emit.source import Generated, Page, Source, environment
from cutjoint.emit.standalone import digest_of, emit_standalone
from cutjoint.formulate.events import guides_jump
from cutjoint.formulate.implicit.equations import formulate_residual
from cutjoint.formulate.inputs import tunable_parameters
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.records import POSES, Equations, SystemEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.transposed import Derived, linearise_residual, transpose
from cutjoint.methods import (
    DEFAULT_INTEGRATOR,
    DEFAULT_METHOD,
    DEFAULT_PRECISION,
    INTEGRATORS,
    METHODS,
    STEPS,
    Events,
    Formulation,
    Implementation,
    Steps,
    join_and,
    join_or,
    linearised_methods,
)
from cutjoint.model.expressions.functions import functions_of_host
from cutjoint.model.records import Binding, Model, Scalar, Scene
from cutjoint.package.errors import MissingPartialsError, RunError
from cutjoint.package.locations import licence_of_musl, path_of, templates_folder
from cutjoint.program.records import Program
from cutjoint.run.outputs import require_apart
from cutjoint.run.record import RunFile
from cutjoint.run.result_files import write_files
from cutjoint.run.run_file import make_run_file, sources_of_parts
from cutjoint.run.settings import Options, StepSettings, find_closure, find_integrator, find_tolerance
from cutjoint.toolchain.build import FLAGS, build, build_files, simulator_of
from cutjoint.toolchain.wasm import build_matching_library, build_module, mathematics, with_section

# Folders and libraries

#: Processor seconds that lanes take to compile: some, and some for each operation of an evaluation.
_COMPILING, _COMPILING_AN_OPERATION = 1.0, 1e-3

#: Processor seconds that lanes save in a step, for the root of the operations, since mechanisms of many have lanes of their own.
_SAVED = 30e-9


def fits_lanes(model: Model, scene: Scene, method: str, integrator: str) -> bool:
    """Return whether runs of a scene can go side by side: lanes have no impacts of guides, and no controllers."""
    return METHODS[method].batch and INTEGRATORS[integrator].batch and not guides_jump(model, scene) and not model.controllers


def lanes_break_even(operations: int, steps: float) -> bool:
    """Return whether lanes save more than they take to compile.
    ``steps`` are those of all simulations, ``operations`` those of an evaluation. Workers do not count, so that results are the same for
    any number. The figures are measured: docs/evidence/measured/sweep.md."""
    return steps * _SAVED * sqrt(operations) > _COMPILING + _COMPILING_AN_OPERATION * operations


@dataclass(frozen=True, kw_only=True)
class Standalone:
    """A C export: the library and the folder of a mechanism.

    * ``name``: of the model; ``digest``: of its source; ``parts``: the code of both; ``code``: the library's text behind its interface
    * ``calls``: those of that interface, by default all
    * ``integrator``: the rule of its steps; ``run_file``: settings, parameters and start
    * ``reproducible``: same bits on all processors; ``lays_roads``: a host changes the road under its wheels
    """

    name: str
    digest: str
    parts: SimulationCode
    integrator: str
    run_file: RunFile
    code: str = ""
    calls: Sequence[str] = ()
    reproducible: bool = False
    lays_roads: bool = False

    @property
    def method(self) -> str:
        """The name of the method."""
        return self.parts.method

    @property
    def steps(self) -> Steps:
        """The properties of the integrator."""
        return STEPS[self.method][self.integrator]

    @property
    def fits_lanes(self) -> bool:
        """Return whether its simulations can go side by side."""
        equations = self.parts.stepped
        return fits_lanes(equations.topology.model, equations.scene, self.method, self.integrator)

    @property
    def size(self) -> int:
        """The bytes that a simulation takes at most."""
        return simulation_size(self.parts, self.steps)

    @property
    def mark(self) -> str:
        """The digest in the C header: of the model, its scene's steps and the version."""
        return digest_of(self.digest, self.integrator)

    @cached_property
    def files(self) -> Mapping[str, str]:
        """The files of the folder by name."""
        libm = mathematics() if self.reproducible else None
        return emit_standalone(self.parts, self.defaults, self.digest, libm=libm, lays_roads=self.lays_roads)

    @cached_property
    def library(self) -> Source:
        """The source of the shared library with the same interface."""
        return emit_library(self.parts, self.defaults, self.digest, self.code, self.calls)

    @property
    def defaults(self) -> Defaults:
        """The part of the run file that generated code begins with."""
        file, settings, held = self.run_file, self.run_file.settings, self.run_file.settings.stabilisation
        return Defaults(
            integrator=settings.integrator, closure=held.closure, closure_penalty=held.penalty, damping_ratio=held.damping_ratio,
            frequency=held.frequency, dt=settings.dt, penalty=settings.penalty, tolerance=settings.tolerance,
            iterations=settings.iterations, multiplier_updates=settings.multiplier_updates, fixed_cost=settings.fixed_cost,
            events=settings.events, absolute_tolerance=settings.absolute_tolerance,
            spectral_radius=settings.spectral_radius, end=file.end, output_step=file.output_step,
            pose=file.pose, parameters=file.parameters, positions=file.positions, rates=file.rates, roads=file.roads,
            surface=file.surface, near=file.near,
        )  # fmt: skip

    @property
    def settings(self) -> StepSettings:
        """The settings of its steps until a host changes them."""
        return StepSettings.of(self.run_file.settings)

    def with_code(self, template: str, **view: object) -> "Standalone":
        """Copy the folder with more code in its library, by a template."""
        text = environment().get_template(template).render(p=self.name, P=self.name.upper(), **view)
        return replace(self, code=self.code + text)

    def build_simulator(self, flags: Sequence[str] = FLAGS) -> Path:
        """Compile the folder's program; errors as of `toolchain.build.build_files`."""
        return build_files(self.name, self.files, simulator_of(self.name), self.digest, flags)

    def build_library(self, flags: Sequence[str] = FLAGS) -> Path:
        """The shared library; errors as of `toolchain.build.build`."""
        return build(self.library, flags=flags).path

    def build_module(self) -> bytes:
        """The C export as a WebAssembly module with its JavaScript interface; errors as of `toolchain.wasm.build_module`.
        Raises RunError: functions are left to a host, which WebAssembly has no pointers to."""
        if hosted := functions_of_host(self.parts.stepped.topology.model):
            raise RunError(f"target wasm: function '{hosted[0]}' is left to a host, but modules call none; provide its code by --functions")
        facts = {
            "name": self.name, "scene": self.parts.stepped.scene.name, "method": self.method, "integrator": self.integrator,
            "dt": self.settings.step, "end": self.run_file.end, "size": self.size, "mark": self.mark,
        }  # fmt: skip
        return with_section(build_module(self.name, self.files, self.digest), json.dumps(facts).encode())

    def build_matching_library(self) -> Path:
        """The shared library whose results equal those of the module bit by bit; errors as of `toolchain.wasm.build_matching_library`."""
        return build_matching_library(self.name, self.files, self.digest)

    @property
    def module_files(self) -> Mapping[str, str]:
        """The JavaScript and TypeScript files that accompany a module, by name."""
        equations = self.parts.stepped
        page = Page.of(equations, self.method)
        kinds = {
            "Parameter": [p.name for p in equations.parameters], "Input": [p.name for p in equations.inputs],
            "Output": [c.name for c in equations.columns], "Pose": list(self.parts.poses),
        }  # fmt: skip
        code = (templates_folder() / "wasm" / "module.js").read_text(encoding="utf-8")
        return {
            f"{self.name}.mjs": page.render("wasm/module.mjs.jinja", p=self.name, code=code),
            f"{self.name}.d.mts": page.render("wasm/module.d.mts.jinja", kinds=kinds),
            "LICENSE.musl": licence_of_musl(),
        }


def freeze_start_parameters(model: Model, scene: Scene, *, trims: bool = False) -> Model:
    """The model with parameters ``frozen`` on which only the start of the scene depends; with ``trims`` its trim is solved again.
    Exported code has numbers there, which setting such a parameter would not change."""
    start = sources_of_parts(model, scene)
    once = () if scene.trim is not None and trims else (scene.assemble, scene.trim)
    requested = _symbols((start["positions"], start["rates"], once)) & {p.symbol for p in tunable_parameters(model)}
    if requested:
        states = tuple(replace(state, initial=sympy.Integer(0)) for state in model.states)
        rest = replace(model, parameters=(), derived=(), scenes={}, states=states)
        requested -= _symbols((rest, replace(scene, positions={}, rates={}, starts={}, assemble=(), trim=None)))
    parameters = tuple(replace(p, binding=Binding.CONST) if p.symbol in requested else p for p in model.parameters)
    return replace(model, parameters=parameters, frozen=tuple(p.name for p in model.parameters if p.symbol in requested))


def describe_frozen(model: Model) -> str:
    """The frozen parameters of a model in a sentence; "" without any."""
    if not model.frozen:
        return ""
    names = join_and([f"'{name}'" for name in model.frozen])
    return f"without {names}: only the start depends on {'it' if len(model.frozen) == 1 else 'them'}, and is fixed here"


def _symbols(part: object) -> set[Scalar]:
    if isinstance(part, sympy.Basic):
        return set(part.free_symbols)
    if is_dataclass(part) and not isinstance(part, type):
        part = [getattr(part, f.name) for f in fields(part)]
    inner = part.values() if isinstance(part, Mapping) else part if isinstance(part, list | tuple) else ()
    return set[Scalar]().union(*map(_symbols, inner))


def make_standalone(
    generated: Generated, *, integrator: str | None = None, equal_steps: bool = False, lanes: bool = True, linearise: bool = False,
    derives_steps: bool = True, adjoint: bool = False, side_by_side: bool = False,
) -> Standalone:  # fmt: skip
    """The C export of a model in a scene, from the results of `pipeline.generate`.
    The integrator follows from ``integrator`` and ``equal_steps`` (`choose_steps`). ``lanes`` computes isomorphic parts side by side.
    ``linearise`` adds derivatives, ``derives_steps`` those of steps, ``adjoint`` adjoint sensitivities, ``side_by_side`` the class of
    several instances. Raises RunError: the method does not support the integrator, derivatives or poses, or a setting or the start is not
    finite.
    """
    equations, program, source = generated
    if isinstance(equations, SystemEquations) and not equations.unknowns:
        file = equations.topology.model.span.file
        raise RunError(f"{file}: nothing in the model moves, so that '{equations.method}' has no equation; use {DEFAULT_METHOD}")
    linearise = linearise or adjoint
    if linearise:
        _require_relative(equations, "linearise", "which have no derivatives")
        for function in equations.topology.model.functions:
            if not function.partials:
                raise RunError(f"{function.span}: {MissingPartialsError(function.name)}")
    if any(f.name == POSES for f in equations.mechanism.functions):
        _require_relative(equations, POSES, "which do not determine the poses of all bodies")
    dofs = find_mobility(equations.mechanism).degrees_of_freedom if linearise else None
    parts = replace(_parts(equations, program, lanes), dofs=dofs, derives_steps=derives_steps)
    options = choose_steps(equations.scene, parts.method, integrator, equal_steps=equal_steps)
    chosen = str(options.integrator)
    if adjoint:
        parts = replace(parts, transposed=_transposed(parts))
    if linearise:
        residual = formulate_residual(parts.mechanism, find_closure(equations.scene.numerics, METHODS[parts.method]).name)
        scheduled = schedule_recursive(residual, lanes=parts.program.lanes)
        parts = replace(parts, force_residual=linearise_residual(residual, scheduled))
    run_file = make_run_file(equations.topology.model, equations.scene, {}, task="simulate", method=parts.method, options=options)
    standalone = Standalone(name=equations.topology.model.name, digest=source.digest, parts=parts, integrator=chosen, run_file=run_file)
    if not (side_by_side and standalone.fits_lanes):
        return standalone
    return replace(standalone, parts=replace(parts, side_by_side=schedule_recursive(parts.mechanism, lanes=False)))


def choose_steps(scene: Scene, method: str, integrator: str | None, *, equal_steps: bool = False) -> Options:
    """The integrator, tolerance and events of a host that takes steps of a scene by a method, where none is named those of `simulate`.
    With ``equal_steps`` a scene that names no integrator has the trapezoidal rule. So has one whose integrator the core has not for the
    method. Raises RunError: the core has not the integrator."""
    known = STEPS[method]
    if integrator is not None and integrator not in known:
        raise RunError(f"integrator: '{integrator}' is not one of C exports, {', '.join(known)}")
    wanted = integrator or scene.numerics.integrator
    if integrator is None and not equal_steps:
        wanted = find_integrator(scene.numerics, METHODS[method], Implementation.GENERATED, Options()).name
    chosen = DEFAULT_INTEGRATOR if wanted is None or wanted not in known else wanted
    tolerance = None if integrator or equal_steps else find_tolerance(scene, method, chosen)
    return Options(integrator=chosen, tolerance=tolerance, events=None if known[chosen].finds_events else Events.CROSSED)


def needs_load_events(scene: Scene, method: str, integrator: str | None, *, equal_steps: bool = False) -> bool:
    """Return whether derivatives of adaptive steps are exact only if steps end where the load of a friction force passes zero."""
    chosen = str(choose_steps(scene, method, integrator, equal_steps=equal_steps).integrator)
    return INTEGRATORS[chosen].adaptive


def _require_relative(equations: Equations, requested: str, why: str) -> None:
    """Check that the state has relative coordinates, from which minimal ones and the poses of all bodies are computed."""
    if isinstance(equations, SystemEquations) and METHODS[equations.method].formulation is Formulation.NATURAL:
        able = join_or(linearised_methods())
        raise RunError(f"{requested}: the state of method '{equations.method}' has natural coordinates, {why}; use {able}")


def _parts(equations: Equations, program: Program, lanes: bool) -> SimulationCode:
    start = equations.mechanism
    if not isinstance(equations, SystemEquations):
        return SimulationCode(mechanism=start, program=program, system=None)
    assert equations.plan is not None
    system = System(equations=equations, program=program, plan=equations.plan)
    return SimulationCode(mechanism=start, program=schedule_recursive(start, lanes=lanes), system=system)


def _transposed(parts: SimulationCode) -> Derived:
    if parts.system is None:
        return transpose(parts.mechanism, parts.program)
    start, outputs = parts.mechanism, parts.system.equations.outputs  # whose columns are the system's
    mechanism = formulate_recursive(start.topology, start.scene, outputs)
    return transpose(mechanism, schedule_recursive(mechanism, lanes=parts.program.lanes))


# Files of compile --out


@dataclass(frozen=True, kw_only=True)
class ExportPlan:
    """The ``files`` of a folder by name, the name of its ``program``, and for a C export its code, ``standalone``."""

    folder: Path
    files: Mapping[str, str]
    program: str
    standalone: Standalone | None

    def write(self, simulator: Path, flags: Sequence[str]) -> None:
        """Write all files or none; each is replaced atomically, so that a running program keeps its earlier file.
        Raises ToolchainError: the C++ compiler failed; OutputError: a file cannot be written."""
        built = simulator if self.standalone is None else self.standalone.build_simulator(flags)
        files: dict[str, str | bytes] = {**self.files, self.program: built.read_bytes()}
        write_files(self.folder, files, {self.program: built.stat().st_mode & 0o777})


def plan_export(generated: Generated, options: CompileOptions) -> ExportPlan | None:
    """Plan a folder for the results of `pipeline.generate`; None if the options have no ``out``.
    Raises RunError: an ``integrator`` is named that the folder cannot have, or derivatives (``linearise``) or ``poses`` of one that has
    none; OutputError: one of the files is the model."""
    folder, integrator, linearise = path_of(options.out), options.integrator, options.linearise or options.adjoint
    if folder is None or options.precision != DEFAULT_PRECISION:
        if integrator is not None:
            raise RunError("integrator: only C exports have one of their own; pass it to simulate instead")
        if linearise:
            able = f"use method {join_or(linearised_methods())}, in {DEFAULT_PRECISION}"
            raise RunError(f"linearise: only C exports have derivatives; set out, and {able}")
        if options.reproducible:
            raise RunError(f"reproducible: only C exports are; set out, in {DEFAULT_PRECISION}")
        if options.poses:
            raise RunError(f"poses: only C exports have them; set out, in {DEFAULT_PRECISION}")
        delivery = None if folder is None else ExportPlan(folder=folder, files=generated.source.files, program="simulator", standalone=None)
    else:
        standalone = make_standalone(
            generated, integrator=integrator, equal_steps=True, lanes=options.lanes, linearise=linearise, adjoint=options.adjoint
        )  # fmt: skip
        standalone = replace(standalone, reproducible=options.reproducible)
        delivery = ExportPlan(folder=folder, files=standalone.files, program=simulator_of(standalone.name), standalone=standalone)
    if delivery is not None:
        model, names = Path(generated.equations.topology.model.span.file), (*delivery.files, delivery.program)
        require_apart({"the model": model}, documents=[(f"--out {folder}: file", delivery.folder / name) for name in names])
    return delivery
