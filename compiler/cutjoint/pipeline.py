"""The compiler from end to end: read this first.

    model.yaml -> Model -> Topology -> Equations -> Program -> Source -> Binary -> Trajectory
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from cutjoint.analysis.guides import require_guides
from cutjoint.analysis.inertia import require_inertia
from cutjoint.emit.factorisation import STRAIGHT_LINE
from cutjoint.emit.source import Source, emit
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.recursive.lanes import schedule_recursive
from cutjoint.methods import EVENTS, EXPLICIT, IMPLICIT, INTEGRATORS, ITERATIONS, LOCATING, METHODS
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Output, RodForce, Scene
from cutjoint.prepared import Compilation
from cutjoint.program.records import Program
from cutjoint.run.compiled_files import require_no_model, write_compiled
from cutjoint.run.ready import ReadyRun, start
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import RunError, make_run_file, require_figures
from cutjoint.run.scenes import find_scene, with_figures
from cutjoint.run.simulator import Progress
from cutjoint.systems import generate_system
from cutjoint.toolchain.build import FLAGS, PRECISIONS, Binary, Kind, build
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology

#: Number types of which several fit a register.
_SIDE_BY_SIDE = frozenset({"single", "double"})

#: How code of the others is optimised: with more, GCC takes minutes for a long function on the 80-bit registers' stack.
_SCALAR_FLAGS = ("-O1",)


@dataclass(frozen=True, kw_only=True)
class Artifact:
    """A compiled model: every stage's record, and the seconds that generating and compiling took.

    ``own_solver`` is the linear solver of a run that asks for none, ``description`` what a simulator that interprets models reads; None for
    generated code.
    """

    topology: Topology
    scene: Scene
    equations: Equations
    program: Program
    source: Source
    binary: Binary
    method: str
    implementation: str
    precision: str
    generate_seconds: float
    compile_seconds: float
    own_solver: str = "emitted"
    description: Mapping[str, Any] | None = None

    @property
    def compilation(self) -> Compilation:
        """What became of the compilation, in figures."""
        return Compilation(
            scene=self.scene.name, method=self.method, operations=self.program.operations(self.iteration),
            instructions=self.program.instructions(self.iteration), compiler=self.binary.compiler, flags=tuple(self.binary.flags),
            generate_seconds=self.generate_seconds, compile_seconds=self.compile_seconds if self.binary.fresh else 0.0,
        )  # fmt: skip

    @property
    def places(self) -> dict[str, str]:
        """Where each body, joint and gear stands in the model file."""
        return {name: str(span) for name, span in self.topology.model.constraint_spans.items()}

    @property
    def iteration(self) -> str:
        """The function that each iteration of a step calls."""
        return ITERATIONS[self.method]

    @property
    def mechanism(self) -> RecursiveEquations:
        """The recursive equations: the method's own, or those that start its runs."""
        equations = self.equations
        assert isinstance(equations, RecursiveEquations | SystemEquations)
        return equations.start if isinstance(equations, SystemEquations) else equations


def is_reduced(model: Model, scene: Scene) -> bool:
    """Whether a model has what only passes put in: guards, sensors of rods, columns that stand for others."""
    return bool(model.guards or any(isinstance(r, RodForce) for r in model.reactions) or any(o.stands_for for o in scene.outputs))


def generate(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str = "recursive", lanes: bool = True,
    straight_line: int = STRAIGHT_LINE,
) -> tuple[Equations, Program, Source]:
    """The symbolic half of the pipeline; with ``lanes``, isomorphic subtrees are evaluated side by side.

    A factorisation of more multiply-adds than ``straight_line`` is emitted as index data and a loop.

    Raises:
        TopologyError: the cuts that the model gives cannot be honoured.
        NoInertiaError: some motion moves no mass.
        GuideError: guides tear a loop open.
        ModelError: an output or an element that the method does not know.
        RunError: the method's equations depend on each other.
        MissingLibraryError: a library that orders the method's matrices is not installed.
    """
    closure, reported = (scene.numerics.closure, tuple(outputs)) if method == "recursive" else ("penalty", ())
    recursive = derive(model, scene, reported, closure=closure)
    if method != "recursive":
        return generate_system(only_starting(recursive), method, tuple(outputs), lanes=lanes, straight_line=straight_line)
    # Equations -> Program
    program = schedule_recursive(recursive, lanes=lanes)
    # Program -> Source
    return recursive, program, emit(program, recursive)


def derive(model: Model, scene: Scene, outputs: Sequence[Output], *, closure: str = "penalty") -> RecursiveEquations:
    """The recursive equations of a model, which every method starts from.

    Raises:
        TopologyError, NoInertiaError, GuideError: as `generate`.
    """
    # Model -> Topology
    topology = build_topology(model)
    # Topology -> Equations
    recursive = formulate_recursive(topology, scene, tuple(outputs), closure=closure)
    require_inertia(recursive)
    require_guides(recursive)
    return recursive


def generate_for(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str, lanes: bool, precision: str
) -> tuple[Equations, Program, Source]:  # fmt: skip
    """The same for a number type: lanes and straight-line factorisations are for those of which several fit a register."""
    packed = precision in _SIDE_BY_SIDE
    return generate(model, scene, outputs, method=method, lanes=lanes and packed, straight_line=STRAIGHT_LINE if packed else 0)


def only_starting(equations: RecursiveEquations) -> RecursiveEquations:
    """The equations without what a start does not call."""
    return replace(equations, functions=tuple(f for f in equations.functions if f.name not in ("project", "events")), switches=())


def compile_model(path: Path, *, scene: str | None = None, **how: Any) -> Artifact:
    """Compile a model file for one scene; ``how`` as in `compile_scene`.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError: the file is wrong.
        RunError: there is no such scene, method or precision, or the method does not take the model.
        MissingLibraryError: a library that orders the method's matrices is not installed.
        ToolchainError: the C++ side failed.
    """
    # model.yaml -> Model
    model = read_model(path)
    return compile_scene(model, find_scene(model, scene), **how)


def compile_scene(
    model: Model, scene: Scene, *, method: str = "recursive", out: Path | None = None, flags: Sequence[str] = FLAGS,
    outputs: Sequence[Output] | None = None, lanes: bool = True, comparison: bool = False, precision: str = "double",
) -> Artifact:  # fmt: skip
    """Compile a model for a scene; ``out`` receives the generated source and the simulator.

    ``outputs`` are instead of the scene's.  ``comparison`` links the solvers of SuiteSparse too, see COMPARISON_SOLVERS.  ``precision``
    is one of PRECISIONS, the number type of the run; the start is found in double.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError: the model is wrong.
        RunError: there is no such method or precision, or the method does not take the model.
        MissingLibraryError: a library that orders the method's matrices is not installed.
        ToolchainError: the C++ side failed.
        OutputError: a file of ``out`` is the model, or cannot be written.
    """
    if method not in METHODS:
        raise RunError(f"no method '{method}'; there is {', '.join(METHODS)}")
    if precision not in PRECISIONS or (precision != "double" and comparison):
        raise RunError(f"no precision '{precision}' here: there is {', '.join(PRECISIONS)}, with generated code and its own solvers")
    # Model -> Source
    begin = perf_counter()
    wanted = scene.outputs if outputs is None else outputs
    equations, program, source = generate_for(model, scene, wanted, method=method, lanes=lanes, precision=precision)
    generated = perf_counter()
    if out is not None:
        require_no_model(source.files, out, Path(model.span.file))
    # Source -> Binary
    kind = Kind(comparison=comparison, precision=precision)
    flags = flags if precision in _SIDE_BY_SIDE else (*flags, *_SCALAR_FLAGS)
    binary = build(source, flags=flags, kind=kind)
    if out is not None:
        write_compiled(source.files, binary.path, out)
    return Artifact(
        topology=equations.topology, scene=scene, equations=equations, program=program, source=source, binary=binary, method=method,
        implementation="generated", precision=precision, generate_seconds=generated - begin, compile_seconds=perf_counter() - generated,
    )  # fmt: skip


def simulate(
    artifact: Artifact, *, out: Path | None = None, dt: float | None = None, end: float | None = None, penalty: float | None = None,
    tolerance: float | None = None, parameters: Mapping[str, float] | None = None, solver: str = "emitted",
    integrator: str | None = None, events: str | None = None, iterations: int | None = None, steps: Path | None = None,
    tangents: Path | None = None, progress: Progress | None = None,
) -> Trajectory:  # fmt: skip
    """Run a compiled model; ``out`` receives the table and, beside it, a JSON file with the units.

    ``dt``, ``penalty`` and ``tolerance`` are instead of the scene's for the method.  ``solver`` is one of SOLVERS, ``integrator`` one of
    INTEGRATORS, by default the scene's, ``events`` one of EVENTS, by default the scene's, else what is usual with the integrator,
    ``iterations`` how many each step of the recursive method has then, ``steps`` a CSV file that receives iterations and residuals of each
    step, ``tangents`` a file that receives a line of JSON for each row, the Jacobians of the recursive method's accelerations.  A run that
    fails numerically is returned as far as it came, with its failure; then the files are those of `partial_of`.

    Raises:
        RunError: a parameter that cannot be set, figures that no run has, or that do not go together.
        SimulatorError: the simulator could not begin, or could not write a file.
        OutputError: a file cannot be written, or is the same as another one.
        Interrupted, Terminated: a signal has ended the run.
    """
    if tangents is not None and (integrator != "trapezoidal" or events != "crossed"):
        raise RunError("tangents are those of the trapezoidal rule over events: pass integrator=\"trapezoidal\", events=\"crossed\"")
    ready = make_ready(
        artifact, dt=dt, end=end, penalty=penalty, tolerance=tolerance, parameters=parameters, solver=solver, integrator=integrator,
        events=events, iterations=iterations,
    )  # fmt: skip
    return start(ready, out=out, steps=steps, tangents=tangents, progress=progress)


def make_ready(
    artifact: Artifact, *, dt: float | None = None, end: float | None = None, penalty: float | None = None, tolerance: float | None = None,
    parameters: Mapping[str, float] | None = None, solver: str = "emitted", integrator: str | None = None, events: str | None = None,
    iterations: int | None = None,
) -> ReadyRun:  # fmt: skip
    """The run of a compiled model that these figures ask for, as in `simulate`, ready to be started.

    Raises:
        RunError: a parameter that cannot be set, figures that no run has, or that do not go together.
    """
    require_figures(dt=dt, end=end, penalty=penalty, tolerance=tolerance, iterations=iterations)
    changes = {name: value for name, value in (("dt", dt), ("penalty", penalty), ("tolerance", tolerance)) if value is not None}
    scene = with_figures(artifact.scene, artifact.method, changes)
    integrator = _checked_integrator(artifact, integrator)
    located = ends_at_events(artifact, integrator, events)
    if iterations is not None:
        require_fixed_cost(artifact, integrator, events=located)
    run_file = make_run_file(
        artifact.topology.model, replace(scene, end=scene.end if end is None else end), parameters or {}, task="simulate",
        method=artifact.method, solver=_solver(artifact, solver) if integrator in ("trapezoidal", *IMPLICIT) else "",
        integrator=integrator, events=located, fixed_cost=iterations,
    )  # fmt: skip
    return ReadyRun(
        simulator=artifact.binary.path, run_file=run_file, units={c.name: c.unit for c in artifact.equations.columns},
        description=artifact.description,
    )  # fmt: skip


def _has_integrator(artifact: Artifact, integrator: str) -> bool:
    """Whether the equations of an artifact are those that an explicit or implicit integrator takes."""
    needed = {**dict.fromkeys(EXPLICIT, "recursive"), **dict.fromkeys(IMPLICIT, "recursive-newton")}
    return artifact.method == needed.get(integrator) and artifact.implementation == "generated"


def _checked_integrator(artifact: Artifact, asked: str | None) -> str:
    """The integrator of a run; a scene's is meant for the methods that have it, others have the trapezoidal rule."""
    own = artifact.scene.numerics.integrator if _has_integrator(artifact, artifact.scene.numerics.integrator) else "trapezoidal"
    integrator = own if asked is None else asked
    if integrator not in INTEGRATORS:
        raise RunError(f"no integrator '{integrator}'; there is {', '.join(INTEGRATORS)}")
    if integrator in EXPLICIT and not _has_integrator(artifact, integrator):
        raise RunError(f"the integrator {integrator} takes generated code of the method recursive")
    if integrator in IMPLICIT and not _has_integrator(artifact, integrator):
        raise RunError(f"the integrator {integrator} takes the method recursive-newton")
    if integrator == "reference" and (artifact.method in ("augmented", "recursive-newton") or artifact.implementation == "generic"):
        raise RunError("the reference integrator takes generated code of the method recursive or classical")
    if integrator in (*EXPLICIT, "reference") and artifact.method == "recursive" and artifact.scene.numerics.closure == "proximal":
        raise RunError(f"the integrator {integrator} closes loops in its own way: use closure: penalty")
    return integrator


def ends_at_events(artifact: Artifact, integrator: str, asked: str | None = None) -> bool | None:
    """Whether the steps of a run end at events; None of what does not have that, for which a scene's ``events`` are not meant.

    Raises:
        RunError: what is asked for is none of EVENTS, or located events of what does not have them.
    """
    if asked is not None and asked not in EVENTS:
        raise RunError(f"no events '{asked}'; there is {', '.join(EVENTS)}")
    has = artifact.method in ("recursive", "recursive-newton") and artifact.implementation == "generated"
    if asked == "located" and not has:
        raise RunError("events are located by generated code of the methods recursive and recursive-newton")
    if asked == "located" and integrator == "reference":
        raise RunError("the reference integrator takes steps over events: use events: crossed")
    if not has or integrator == "reference":
        return None
    events = artifact.scene.numerics.events if asked is None else asked
    return integrator in LOCATING if events is None else events == "located"


def require_fixed_cost(artifact: Artifact, integrator: str = "trapezoidal", *, events: bool | None = None) -> None:
    """Check that steps can have a fixed number of iterations.

    Raises:
        RunError: what else a step does takes as long as it takes.
    """
    if artifact.method != "recursive" or integrator != "trapezoidal" or artifact.scene.numerics.closure != "penalty":
        raise RunError("a fixed number of iterations needs the method recursive with the trapezoidal rule and closure: penalty")
    if events:
        raise RunError("a fixed number of iterations needs events: crossed: a step that ends at an event is taken in parts")


def _solver(artifact: Artifact, solver: str) -> str:
    """What a run file names as solver."""
    if artifact.method == "recursive":
        return ""
    return artifact.own_solver if solver == "emitted" else solver
