"""The compiler from end to end: read this first.

    model.yaml -> Model -> Topology -> Equations -> Program -> Source -> Binary -> Trajectory
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from cutjoint.analysis.guides import require_guides
from cutjoint.analysis.inertia import require_inertia
from cutjoint.emit.source import Source, emit
from cutjoint.formulate.records import Equations, RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.recursive.lanes import schedule_recursive
from cutjoint.locations import AnyPath, path_of
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, METHODS, PLAIN_CLOSURE, PRECISIONS, Implementation
from cutjoint.model.records import Model, Output, Scene
from cutjoint.program.records import Program
from cutjoint.run.accuracy import run_accurately
from cutjoint.run.artifact import Artifact, make_simulator_run, require_choice, require_end
from cutjoint.run.compiled_files import require_no_model, write_compiled
from cutjoint.run.errors import RunError
from cutjoint.run.inputs import GivenInput
from cutjoint.run.options import Options
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulator import Progress
from cutjoint.standalone import make_standalone
from cutjoint.toolchain.build import FLAGS, build
from cutjoint.toolchain.drivers import Kind
from cutjoint.topology.build import build_topology
from cutjoint.topology.reading import read_model


def compile_model(path: AnyPath, *, scene: str | None = None, opened: Sequence[str] = (), **how: Any) -> Artifact:
    """Compile a model file for one scene, the only one if none is named; numbers whose names match one of the patterns ``opened``, such as
    "*.stiffness", become parameters; ``how`` and errors as in `compile_scene`."""
    model = read_model(path, opened=opened)  # model.yaml -> Model
    return compile_scene(model, find_scene(model, scene), **how)


def compile_scene(
    model: Model, scene: Scene, *, method: str = DEFAULT_METHOD, out: AnyPath | None = None, flags: Sequence[str] = FLAGS,
    outputs: Sequence[Output] | None = None, lanes: bool = True, comparison: bool = False, precision: str = DEFAULT_PRECISION,
    integrator: str | None = None,
) -> Artifact:  # fmt: skip
    """Compile a model for a scene; ``out`` receives a folder that stands alone (`standalone`), with steps by ``integrator`` instead of the
    scene's, or where the method has none the source and the simulator.

    ``outputs`` are instead of the scene's.  ``comparison`` links the solvers of SuiteSparse too.  ``precision`` is one of PRECISIONS, the
    number type of the run; the start is found in double.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError: the model is wrong.
        RunError: there is no such method or precision, or the method does not take the model.
        MissingLibraryError, ToolchainError: a library or a tool is not installed, or the C++ compiler failed.
        OutputError: a file of ``out`` is the model, or cannot be written.
    """
    require_choice(method, precision, comparison=comparison)
    # Model -> Source
    begin = perf_counter()
    outputs = scene.outputs if outputs is None else outputs
    equations, program, source = generate(model, scene, outputs, method=method, lanes=lanes, precision=precision)
    folder, files, name = path_of(out), source.files, "simulator"
    alone = folder is not None and METHODS[method].stands_alone and precision == DEFAULT_PRECISION
    if integrator is not None and not alone:
        raise RunError("integrator: only folders that stand alone have one of their own; give it to simulate instead")
    if alone:
        standalone = make_standalone(equations, program, source, integrator=integrator, lanes=lanes)
        files, name = standalone.files, standalone.simulator
    if folder is not None:
        require_no_model((*files, name), folder, Path(model.span.file))
    generated = perf_counter()
    # Source -> Binary
    binary = build(source, flags=(*flags, *PRECISIONS[precision].flags), kind=Kind(comparison=comparison, precision=precision))
    if folder is not None:
        write_compiled(files, name, standalone.build_simulator(flags) if alone else binary.path, folder)
    return Artifact(
        scene=scene, equations=equations, program=program, source=source, binary=binary, method=method, precision=precision,
        implementation=Implementation.GENERATED, generate_seconds=generated - begin, compile_seconds=perf_counter() - generated,
    )  # fmt: skip


def generate(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str = DEFAULT_METHOD, lanes: bool = True,
    precision: str = DEFAULT_PRECISION,
) -> tuple[Equations, Program, Source]:  # fmt: skip
    """The symbolic half; with ``lanes``, isomorphic subtrees are evaluated side by side in number types of which several fit a register."""
    if METHODS[method].has_system:
        from cutjoint.systems import generate_system  # the recursive method does not wait for what this imports

        return generate_system(derive(model, scene, ()).starting, method, tuple(outputs), lanes=lanes, precision=precision)
    # Model -> Topology -> Equations
    recursive = derive(model, scene, outputs, closure=METHODS[method].closure(scene.numerics.closure).name)
    # Equations -> Program
    program = schedule_recursive(recursive, lanes=lanes and PRECISIONS[precision].packed)
    # Program -> Source
    return recursive, program, emit(program, recursive)


def derive(model: Model, scene: Scene, outputs: Sequence[Output], *, closure: str = PLAIN_CLOSURE) -> RecursiveEquations:
    """The recursive equations of a model, which start the runs of every method; errors as in `compile_scene`."""
    recursive = formulate_recursive(build_topology(model), scene, tuple(outputs), closure=closure)
    require_inertia(recursive)
    require_guides(recursive)
    return recursive


def simulate(
    artifact: Artifact, *, out: AnyPath | None = None, steps: AnyPath | None = None, tangents: AnyPath | None = None,
    parameters: Mapping[str, float] | None = None, progress: Progress | None = None, dt: float | None = None, end: float | None = None,
    penalty: float | None = None, tolerance: float | None = None, iterations: int | None = None, solver: str | None = None,
    integrator: str | None = None, events: str | None = None, error: bool = True, check: bool = True,
    inputs: Mapping[str, GivenInput] | None = None, coordinates: bool = False,
) -> Trajectory:  # fmt: skip
    """Run a compiled model with ``parameters`` (SI units); settings from ``dt`` on are those of `Options`, by default the scene's.

    ``inputs`` are what drives the run instead of the scene's laws: by name a number, which ``parameters`` may have too, or a table with
    times "t" and as many of "value", between which the input is "interpolation" "cubic" (the default; through the given "rate" if there is
    one) or "linear".

    ``out`` receives the table, with its units beside it, ``steps`` a CSV file with iterations and residuals of each step, ``tangents`` a
    line of JSON for each row, the Jacobians of the accelerations.  With ``error`` the run keeps the scene's tolerance and has an ``error``.
    With ``coordinates`` the trajectory has those of each row, by which `write_view` draws it.
    Without ``check`` a run that fails is returned with its failure; its files are those of `partial_of`.

    Raises:
        RunError: a parameter or an input that cannot be set, or settings that no run has or that do not go together.
        SimulatorError, OutputError: the simulator could not begin, or a file cannot be written.
        FailedRunError, Interrupted, Terminated: the run failed (the error has its trajectory), or a signal has ended it.
    """
    options = Options(
        dt=dt, end=end, penalty=penalty, tolerance=tolerance, iterations=iterations, solver=solver, integrator=integrator, events=events
    )  # fmt: skip
    plan = make_simulator_run(artifact, options, parameters, inputs=inputs, tangents=tangents is not None)
    plan = replace(plan, with_coordinates=coordinates)
    run = run_accurately(plan, out=out, steps=steps, tangents=tangents, progress=progress, estimate=error, advise=check)
    return require_end(run, artifact) if check else run
