"""A mechanism as C99 for controllers: what it cannot be, and its start, which the C++ export finds."""

import ctypes
import subprocess
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from cutjoint.compile.c_export import Standalone, choose_steps, freeze_start_parameters, make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.emit.c99 import ITERATIONS, UPDATES, Start, emit_c99
from cutjoint.formulate.events import guides_jump
from cutjoint.methods import INTEGRATORS, METHODS, START, Events, Loops, join_or, names_of
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.toolchain.compiler import find_compiler
from cutjoint.toolchain.wasm import build_matching_library, mathematics
from cutjoint.topology.build import build_topology

#: The function by which the library of a C export shows the penalties of its cut joints.
_PENALTIES = 'extern "C" const double* {p}_penalties({p}_sim* sim) {{ return sim->sim.penalties().data(); }}\n'


@dataclass(frozen=True, kw_only=True)
class _Refusal:
    """What C99 code has not: the kind of element, those of a model in a scene, and the remedy."""

    kind: str
    found: Callable[[Model, Scene], Iterable[Any]]
    remedy: str


def _scenes_with(model: Model, scene: Scene, part: str) -> list[Scene]:
    return [scene] if part in scene.road.parts and any(force.has_road for force in model.forces) else []


_REFUSED = (
    _Refusal(kind="controller", found=lambda m, s: m.controllers,
        remedy="make its values inputs, and compute them in your program between steps"),
    _Refusal(kind="state", found=lambda m, s: m.states, remedy="make its value an input, and integrate it in your program"),
    _Refusal(kind="function", found=lambda m, s: m.functions, remedy="write it as an expression or a table"),
    _Refusal(kind="scene with a road surface", found=lambda m, s: _scenes_with(m, s, "surface"), remedy="write its heights as 'profile'"),
    _Refusal(kind="scene with friction of its road", found=lambda m, s: _scenes_with(m, s, "friction"), remedy="leave 'friction' out"),
    _Refusal(kind="omitted force", found=lambda m, s: m.guards, remedy="compile the full model"),
    _Refusal(kind="guide that may jump", found=lambda m, s: [j for j in m.joints if j.guide] if guides_jump(m, s) else [],
        remedy="write its motion without piecewise formulas, abs and sign"),
    _Refusal(kind="scene with located events", found=lambda m, s: [s] if s.numerics.events == Events.LOCATED else [],
        remedy="set events: crossed"),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class C99Export:
    """The ``files`` by name, header and code first, and the operations of an evaluation."""

    files: Mapping[str, str]
    operations: int


def make_c99(
    model: Model, scene: Scene, *, method: str, integrator: str | None = None, iterations: int | None = None, precision: str = "double"
) -> C99Export:  # fmt: skip
    """The C99 code of a model in a scene. Raises RunError: the method, the integrator or an element of the model has no C99, or the start
    or a step with floats fails; others as of `compile_scene`; ToolchainError: there is no C++ compiler, which the start needs."""
    require_c99(model, scene, method, integrator)
    find_compiler()  # raises an error without a compiler
    model = freeze_start_parameters(model, scene)
    standalone = make_standalone(
        generate(model, scene, scene.outputs, method=method, lanes=False), integrator=integrator, equal_steps=True, lanes=False
    )  # fmt: skip
    if fits := standalone.parts.mechanism.fits:
        loop = fits[0].embedded_loop
        raise RunError(
            f"{loop.span}: language c99: the embedded loop of '{loop.independent}' depends on parameters; make them constants, or set "
            "loops: exact"
        )
    if METHODS[method].has_system and (loops := standalone.parts.mechanism.equation_names):
        raise RunError(
            f"{scene.span}: language c99: method '{method}' has no loop equations, such as '{loops[0]}'; set loops: embedded, or use "
            f"--method {START}"
        )
    if explicit := standalone.steps.stages > 0:
        _require_explicit(standalone, scene, iterations)
    if iterations is None:
        iterations = (UPDATES if standalone.parts.mechanism.equation_names else 0) if explicit else ITERATIONS
    emit = partial(
        emit_c99, standalone.parts, standalone.defaults, standalone.digest, find_start(standalone), mathematics(), iterations=iterations,
        precision=precision,
    )  # fmt: skip
    files = emit()
    if precision != "double":
        files = emit(errors=_measure_floats(standalone, files, iterations))
    program = (standalone.parts.system or standalone.parts).program
    return C99Export(files=files, operations=program.operations(METHODS[method].iteration))


def _require_explicit(standalone: Standalone, scene: Scene, iterations: int | None) -> None:
    """Check that explicit steps have no events to find, and iterations only for loops."""
    chosen, equations = standalone.integrator, standalone.parts.mechanism
    faults = {
        "events; set events: crossed": standalone.defaults.events is not False and equations.indicators,
        "iterations without loops; omit --iterations": iterations is not None and not equations.equation_names,
    }  # fmt: skip
    if found := [what for what, there in faults.items() if there]:
        raise RunError("\n".join(f"{scene.span}: language c99: integrator '{chosen}' has no {what}" for what in found))


def _measure_floats(standalone: Standalone, files: Mapping[str, str], iterations: int) -> list[dict[str, object]]:
    """For each output its largest difference between float and double over the scene, at most 100 000 steps, and its largest value.
    Raises RunError: a step fails."""
    name, defaults = standalone.name, standalone.defaults
    with TemporaryDirectory() as folder:
        for file in (f"{name}.h", f"{name}.c"):
            (Path(folder) / file).write_text(files[file], encoding="utf-8")
        flags = ("-x", "c", "-std=c99", "-O1", "-ffp-contract=off", "-fPIC", "-shared")
        subprocess.run([*find_compiler().command, *flags, f"{name}.c", "-lm", "-o", "made.so"], cwd=folder, check=True)
        libraries = [(Path(folder) / "made.so", ctypes.c_float), (build_start(standalone), ctypes.c_double)]
        columns = standalone.parts.stepped.columns
        tables = []
        for path, kind in libraries:
            library = ctypes.CDLL(str(path))
            memory = (ctypes.c_double * (standalone.size // 8 + 1000))()
            sim, rows = _create(library, name, memory), []
            outputs = library[f"{name}_outputs"]
            outputs.restype = ctypes.POINTER(kind)
            if iterations:
                library[f"{name}_set_iterations"](sim, iterations)
            statuses = [library[f"{name}_start"](sim)]
            for _ in range(min(100_000, round(defaults.end / defaults.dt))):
                statuses.append(library[f"{name}_step"](sim))
                rows.append(outputs(sim)[: len(columns)])
            if any(statuses):
                step = next(k for k, status in enumerate(statuses) if status)
                raise RunError(f"language c99: step {step} of the scene fails with {kind.__name__[2:]}, status {statuses[step]}")
            tables.append(np.array(rows))
    errors, sizes = abs(tables[0] - tables[1]).max(axis=0), abs(tables[1]).max(axis=0)
    return [{"name": c.name, "error": e, "size": s} for c, e, s in zip(columns, errors, sizes, strict=True)]


def c99_methods(model: Model, scene: Scene) -> list[str]:
    """The methods that have C99 for a scene: where loops stay, those with loop equations."""
    loops = scene.numerics.loops != Loops.EMBEDDED and bool(build_topology(model).cuts)
    return [name for name, m in METHODS.items() if m.c99 and not (loops and m.has_system)]


def require_c99(model: Model, scene: Scene, method: str, integrator: str | None) -> None:
    """Check that a model in a scene can be C99; all that it has not is said at once. Raises RunError: it cannot."""
    able = names_of(METHODS, lambda m: m.c99)
    if method not in able:
        raise RunError(f"language c99: method '{method}' has no C99; use {join_or(able)}")
    chosen = str(choose_steps(scene, method, integrator, equal_steps=True).integrator)
    if not INTEGRATORS[chosen].c99:
        able = names_of(INTEGRATORS, lambda i: i.c99 and method in i.methods)
        raise RunError(f"{scene.span}: language c99: integrator '{chosen}' has no C99; use --integrator {join_or(able)}")
    faults = [
        f"{element.span}: language c99 has no {refusal.kind}, which '{element.name}' is; {refusal.remedy}"
        for refusal in _REFUSED for element in refusal.found(model, scene)
    ]  # fmt: skip
    if faults:
        raise RunError("\n".join(faults))


def build_start(standalone: Standalone) -> Path:
    """The shared library of a C export with its own mathematical library, and with a call for the penalties of its cut joints."""
    files = replace(standalone, reproducible=True).files
    more = _PENALTIES.format(p=standalone.name)
    return build_matching_library(standalone.name, {f: text + more * f.endswith(".cpp") for f, text in files.items()}, standalone.digest)


def find_start(standalone: Standalone) -> Start:
    """The start that the C++ code of an export finds. Raises RunError: it fails."""
    p, size = standalone.name, standalone.size
    library = ctypes.CDLL(str(build_start(standalone)))
    memory = (ctypes.c_double * (size // 8 + 1))()
    sim = _create(library, p, memory)
    if library[f"{p}_start"](sim):
        text = ctypes.create_string_buffer(1000)
        library[f"{p}_failure_text"](sim, text, ctypes.c_size_t(1000))
        raise RunError(f"the start fails: {text.value.decode()}")
    state = standalone.parts.stepped
    equations = len(state.equation_names)
    lengths = {
        "coordinates": len(state.coordinate_names), "speeds": len(state.speed_names), "accelerations": len(state.speed_names),
        "multipliers": equations, "penalties": len(state.mechanism.closures),
    }  # fmt: skip
    found = [_numbers(library[f"{p}_{name}"], sim, length) for name, length in lengths.items()]
    return Start(q=found[0], v=found[1], vdot=found[2], multipliers=found[3], penalties=found[4])


def _create(library: ctypes.CDLL, name: str, memory: ctypes.Array[Any]) -> ctypes.c_void_p:
    """A simulation in memory, which has to outlive it."""
    create = library[f"{name}_create"]
    create.restype, create.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_size_t]
    return ctypes.c_void_p(create(memory, ctypes.sizeof(memory)))


def _numbers(call: Any, sim: ctypes.c_void_p, length: int) -> list[float]:
    call.restype = ctypes.POINTER(ctypes.c_double)
    return call(sim)[:length] if length else []
