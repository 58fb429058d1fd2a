"""The compiler from end to end: read this first.

    model.yaml -> Model -> Topology -> Equations -> Program -> Source -> Binary -> Trajectory
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, TypeVar

from cutjoint.analysis.guides import require_guides
from cutjoint.analysis.inertia import require_inertia
from cutjoint.analysis.linearisation import NoMassError
from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.modes import Modes, find_mode_shapes
from cutjoint.analysis.natural import NaturalState, closed_states, dependent_equations, tangent_samples
from cutjoint.emit.factorisation import STRAIGHT_LINE
from cutjoint.emit.generic import describe_generic
from cutjoint.emit.generic_natural import describe_generic_natural
from cutjoint.emit.source import Source, emit
from cutjoint.emit.system import emit_system
from cutjoint.formulate.correspondence import find_corresponding
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.implicit.records import ImplicitEquations
from cutjoint.formulate.natural.equations import formulate_lagrangian, without
from cutjoint.formulate.natural.records import LagrangianEquations
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.recursive.families import find_families
from cutjoint.model.quantities import quantities, unit_of
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Numerics, Output, Road, RodForce, Scene
from cutjoint.program.fold import fold
from cutjoint.program.records import Program
from cutjoint.program.schedule import schedule
from cutjoint.run.modes import NotReachedError, linearise_at
from cutjoint.run.results import Equilibrium, FailureReport, Trajectory, read_effort, read_table
from cutjoint.run.run_file import RunError, make_run_file
from cutjoint.run.simulator import Progress, call_simulator, failure_of
from cutjoint.sparse.pattern import Pattern
from cutjoint.sparse.pivoting import NoPivotError, SingularError
from cutjoint.sparse.plan import Plan, plan_definite, plan_unsymmetric
from cutjoint.sparse.tangent import places, settle_entries
from cutjoint.toolchain.build import FLAGS, PRECISIONS, Binary, Kind, build, build_generic
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology

E = TypeVar("E", bound=SystemEquations)

METHODS = ("recursive", "augmented", "classical", "recursive-newton")

#: Methods that have a generic twin.
TWINS = ("recursive", "augmented", "classical")

#: How the recursive method holds its cut joints.
CLOSURES = ("penalty", "proximal")

#: What each iteration of a step calls, by method.
ITERATIONS = {"recursive": "evaluate", "augmented": "linearise", "classical": "linearise", "recursive-newton": "linearise"}

#: Linear solvers of the Lagrangian methods: the emitted factorisation, and libraries.
SOLVERS = ("emitted", "eigen-ldlt", "eigen-lu", "cholmod", "klu", "umfpack")

#: Those of SuiteSparse, some of them under the GPL: simulators that have them are for comparison.
COMPARISON_SOLVERS = frozenset({"cholmod", "klu", "umfpack"})

#: Explicit Runge-Kutta methods of the recursive equations: with steps of equal length, and with steps as long as the tolerance allows.
EXPLICIT = ("rk4", "dormand-prince")

#: Implicit methods of the equations `recursive-newton`: of order 4 with steps as long as the tolerance allows or of equal length, and of
#: order 2 with damping of what is fast.
IMPLICIT = ("sdirk4", "sdirk4-fixed", "generalised-alpha")

#: The trapezoidal rule of the methods, explicit and implicit methods, and accurate solutions to measure them by: extrapolation in
#: relative coordinates (recursive) and a Runge-Kutta method of order 8 in natural coordinates (classical).
INTEGRATORS = ("trapezoidal", *EXPLICIT, *IMPLICIT, "reference")

#: Code made for the model, or the generic twin that interprets the model at run time.
IMPLEMENTATIONS = ("generated", "generic")

#: Number types of which several fit a register.
_SIDE_BY_SIDE = frozenset({"single", "double"})

#: How code of the others is optimised: with more, GCC takes minutes for a long function on the 80-bit registers' stack.
_SCALAR_FLAGS = ("-O1",)


@dataclass(frozen=True, kw_only=True)
class Artifact:
    """A compiled model: every stage's record, and the seconds that generating and compiling took."""

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


class NoEquilibriumError(RuntimeError):
    """No static equilibrium was found; ``report`` says where the search ended."""

    def __init__(self, report: FailureReport) -> None:
        super().__init__(str(report))
        self.report = report


def is_reduced(model: Model, scene: Scene) -> bool:
    """Whether a model has what only passes put in: guards, sensors of rods, columns that stand for others."""
    return bool(model.guards or any(isinstance(r, RodForce) for r in model.reactions) or any(o.stands_for for o in scene.outputs))


def find_scene(model: Model, name: str | None) -> Scene:
    """The scene of that name, the only one, or an empty one when the model has none.

    Raises:
        RunError: there is no such scene, or several and none was named.
    """
    if name is None and len(model.scenes) <= 1:
        return next(iter(model.scenes.values()), _empty_scene(model))
    if name is None or name not in model.scenes:
        asked = "name a scene" if name is None else f"no scene '{name}'"
        raise RunError(f"{model.span.file}: {asked}; the model has {', '.join(model.scenes) or 'none'}")
    return model.scenes[name]


def _empty_scene(model: Model) -> Scene:
    return Scene(
        name="rest", end=1.0, output_step=1e-3, pose="design", positions={}, rates={}, inputs={}, switches={}, road=Road(),
        numerics=Numerics(), outputs=(), span=model.span,
    )  # fmt: skip


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
        ModelError: an output that the method does not know.
    """
    # Model -> Topology
    topology = build_topology(model)
    # Topology -> Equations
    closure, reported = (scene.numerics.closure, tuple(outputs)) if method == "recursive" else ("penalty", ())
    recursive = formulate_recursive(topology, scene, reported, closure=closure)
    require_inertia(recursive)
    require_guides(recursive)
    if method != "recursive":
        return generate_system(_only_starting(recursive), method, tuple(outputs), lanes=lanes, straight_line=straight_line)
    # Equations -> Program
    program = schedule_recursive(recursive, lanes=lanes)
    # Program -> Source
    return recursive, program, emit(program, recursive)


def generate_for(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str, lanes: bool, precision: str
) -> tuple[Equations, Program, Source]:  # fmt: skip
    """The same for a number type: lanes and straight-line factorisations are for those of which several fit a register."""
    packed = precision in _SIDE_BY_SIDE
    return generate(model, scene, outputs, method=method, lanes=lanes and packed, straight_line=STRAIGHT_LINE if packed else 0)


#: Functions of the recursive equations that are called several times a step, and that lanes are worth while for.
_OFTEN = frozenset({"evaluate", "project", "guard", "events"})


def schedule_recursive(equations: RecursiveEquations, *, lanes: bool) -> Program:
    """The program of the recursive method; what is called less than once a step stays out of the lanes."""
    families = find_families(equations.builder, equations.topology) if lanes else []
    folded = {f.name: fold(equations.builder, families, f.results) for f in equations.functions if f.name in _OFTEN}
    return schedule(equations.builder, [(f.name, folded.get(f.name, f.results)) for f in equations.functions])


def _only_starting(equations: RecursiveEquations) -> RecursiveEquations:
    """The equations without what a start does not call."""
    return replace(equations, functions=tuple(f for f in equations.functions if f.name not in ("project", "events")), switches=())


def generate_system(
    start: RecursiveEquations, method: str, outputs: tuple[Output, ...], *, lanes: bool, straight_line: int = STRAIGHT_LINE
) -> tuple[SystemEquations, Program, Source]:
    """The same for the methods with Newton's iteration; ``start`` finds where a run begins."""
    # Topology -> Equations
    equations, states = formulate_system(start, method, outputs)
    # Equations -> Program -> Plan
    equations, program, plan = plan_system(equations, states, lanes=lanes)
    # Program, Plan -> Source
    return equations, program, emit_system(schedule_recursive(start, lanes=lanes), program, equations, plan, straight_line=straight_line)


def formulate_system(
    start: RecursiveEquations, method: str, outputs: tuple[Output, ...]
) -> tuple[SystemEquations, list[NaturalState]]:
    """The equations, and the states where the pivots of ``classical`` are tried."""
    if method == "recursive-newton":
        return formulate_implicit(start, outputs), []
    equations = formulate_lagrangian(start, method, outputs)
    if method == "augmented":
        return equations, []
    states = closed_states(equations)
    return without(equations, dependent_equations(equations, states)), states


def plan_system(equations: E, states: Sequence[NaturalState], *, lanes: bool) -> tuple[E, Program, Plan]:
    """The program of a system and the plan of its factorisation; ``states`` are where the pivots of ``classical`` are tried.

    The equations returned know where the entries of their tangent stand.

    Raises:
        RunError: the equations depend on each other in one of the states.
        MissingLibraryError: a library that orders matrices is not installed.
    """
    families = find_corresponding(equations.correspondence, equations.topology) if lanes else []
    functions = [(f.name, fold(equations.builder, families, f.results)) for f in equations.functions]
    program, pattern = settle_entries(
        schedule(equations.builder, functions), len(equations.row_names), symmetric=equations.method == "augmented"
    )  # fmt: skip
    equations = equations.with_tangent(places(pattern))
    if isinstance(equations, LagrangianEquations) and equations.method == "classical":
        return equations, program, _plan_with_pivots(equations, pattern, states)
    return equations, program, plan_definite(pattern)


def _plan_with_pivots(equations: LagrangianEquations, pattern: Pattern, states: Sequence[NaturalState]) -> Plan:
    """The classical method's factorisation, with pivots that hold in all states.

    Raises:
        RunError: the equations depend on each other in one of the states.
    """
    dt = equations.scene.numerics.of_method("classical").dt
    try:
        return plan_unsymmetric(pattern, list(tangent_samples(equations, states, dt)))
    except NoPivotError as error:
        raise RunError(f"{equations.topology.model.span.file}: classical: {error}; use --method augmented or recursive") from error
    except SingularError as error:
        raise RunError(_singular(equations, [equations.row_names[row] for row in error.rows])) from error


def _singular(equations: LagrangianEquations, names: Sequence[str]) -> str:
    """What to say of coordinates and equations that have no equation of their own near the design position."""
    model = equations.topology.model
    spans = {body.name: body.span for body in model.bodies} | {joint.name: joint.span for joint in model.joints}
    lines = []
    for name in names:
        element = max((e for e in spans if name.startswith(f"{e}.")), key=len, default="")
        place = spans[element] if element else model.span.file
        lines.append(f"{place}: '{name}': the classical method finds no equation of its own for it near the design position")
    return "\n".join([*lines, "hint: use --method augmented or recursive"])


def compile_model(path: Path, *, scene: str | None = None, **how: Any) -> Artifact:
    """Compile a model file for one scene; ``how`` as in `compile_scene`.

    Raises:
        ModelError, TopologyError: the file is wrong.
        RunError: there is no such scene or method.
        ToolchainError: the C++ side failed.
    """
    # model.yaml -> Model
    model = read_model(path)
    return compile_scene(model, find_scene(model, scene), **how)


def compile_scene(
    model: Model, scene: Scene, *, method: str = "recursive", out: Path | None = None, flags: Sequence[str] = FLAGS,
    outputs: Sequence[Output] | None = None, implementation: str = "generated", lanes: bool = True, comparison: bool = False,
    precision: str = "double",
) -> Artifact:  # fmt: skip
    """Compile a model for a scene; ``out`` receives the generated source and the simulator.

    ``outputs`` are instead of the scene's.  ``comparison`` links the solvers of SuiteSparse too, see COMPARISON_SOLVERS.  ``precision``
    is one of PRECISIONS, the number type of the run; the start is found in double.

    Raises:
        ModelError, TopologyError: the model is wrong.
        RunError: there is no such method or precision, or the generic twin is asked to run a reduced model.
        ToolchainError: the C++ side failed.
    """
    if method not in METHODS:
        raise RunError(f"no method '{method}'; there is {', '.join(METHODS)}")
    if precision not in PRECISIONS or (precision != "double" and (comparison or implementation == "generic")):
        raise RunError(f"no precision '{precision}' here: there is {', '.join(PRECISIONS)}, with generated code and its own solvers")
    if implementation == "generic" and method not in TWINS:
        raise RunError(f"{method} has no generic twin: there is one of {', '.join(TWINS)}; use --implementation generated")
    if implementation == "generic" and is_reduced(model, scene):
        raise RunError("the generic twin knows neither guards nor columns of reduced models: run the full model")
    if implementation == "generic" and method == "recursive" and scene.numerics.closure != "penalty":
        raise RunError(f"the generic twin knows closure: penalty only, not {scene.numerics.closure}; use --implementation generated")
    # Model -> Source
    begin = perf_counter()
    wanted = scene.outputs if outputs is None else outputs
    equations, program, source = generate_for(model, scene, wanted, method=method, lanes=lanes, precision=precision)
    generated = perf_counter()
    # Source -> Binary
    kind = Kind(comparison=comparison, precision=precision)
    flags = flags if precision in _SIDE_BY_SIDE else (*flags, *_SCALAR_FLAGS)
    binary = build_generic(flags=flags) if implementation == "generic" else build(source, flags=flags, folder=out, kind=kind)
    return Artifact(
        topology=equations.topology, scene=scene, equations=equations, program=program, source=source, binary=binary, method=method,
        implementation=implementation, precision=precision, generate_seconds=generated - begin,
        compile_seconds=perf_counter() - generated,
    )  # fmt: skip


def simulate(
    artifact: Artifact, *, out: Path | None = None, dt: float | None = None, end: float | None = None, penalty: float | None = None,
    tolerance: float | None = None, parameters: Mapping[str, float] | None = None, solver: str = "emitted",
    integrator: str | None = None, steps: Path | None = None, tangents: Path | None = None, progress: Progress | None = None,
) -> Trajectory:  # fmt: skip
    """Run a compiled model; ``out`` receives the table and, beside it, a JSON file with the units.

    ``dt``, ``penalty`` and ``tolerance`` are instead of the scene's for the method.  ``solver`` is one of SOLVERS, ``integrator`` one of
    INTEGRATORS, by default the scene's, ``steps`` a CSV file that receives iterations and residuals of each step, ``tangents`` a file
    that receives a line of JSON for each row, the Jacobians of the recursive method's accelerations.  A run that fails numerically is
    returned as far as it came, with its failure.

    Raises:
        RunError: a parameter that cannot be set.
        SimulatorError: the simulator could not begin.
    """
    changes = {name: value for name, value in (("dt", dt), ("penalty", penalty), ("tolerance", tolerance)) if value is not None}
    scene = with_figures(artifact.scene, artifact.method, changes)
    integrator = _checked_integrator(artifact, integrator)
    scene = replace(scene, end=scene.end if end is None else end)
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        table = Path(folder) / "table.csv" if out is None else out
        if steps is not None:
            steps.parent.mkdir(parents=True, exist_ok=True)
        run_file = make_run_file(
            artifact.topology.model, scene, parameters or {}, task="simulate", method=artifact.method, out=str(table.resolve()),
            solver=_solver(artifact, solver) if integrator in ("trapezoidal", *IMPLICIT) else "", integrator=integrator,
            steps_out="" if steps is None else str(steps.resolve()), tangents_out="" if tangents is None else str(tangents.resolve()),
        )  # fmt: skip
        if artifact.implementation == "generic":
            run_file["model"] = str(_describe(artifact, Path(folder)))
        summary = call_simulator(artifact.binary.path, run_file, progress)
        failure = failure_of(summary)
        if not table.exists():
            table.write_text("t" + "".join(f",{c.name}" for c in artifact.equations.columns) + "\n", encoding="utf-8")
        t, columns = read_table(table)
    units = {c.name: c.unit for c in artifact.equations.columns}
    if out is not None:
        out.with_suffix(".units.json").write_text(json.dumps({"t": "s", **units}, indent=2) + "\n", encoding="utf-8")
    return Trajectory(
        t=t, columns=columns, units=units, steps=summary.get("steps", 0), evaluations=summary.get("evaluations", 0),
        seconds=summary.get("seconds", 0.0), undetermined=tuple(summary.get("undetermined", ())), failure=failure,
        effort=read_effort(summary),
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


def _solver(artifact: Artifact, solver: str) -> str:
    """What a run file names as solver; the generic twin has no emitted factorisation and takes a library's in its place."""
    if artifact.method == "recursive":
        return ""
    if solver == "emitted" and artifact.implementation == "generic":
        return {"augmented": "eigen-ldlt", "classical": "klu"}[artifact.method]
    return solver


def time_solver(artifact: Artifact, solver: str) -> dict[str, float]:
    """Seconds that the parts of a Newton iteration take at the start of the scene: ``analyse``, ``assemble``, ``factor``, ``solve``.

    Raises:
        SimulatorError: the solver does not suit the method, or the simulator does not have it.
    """
    run_file = make_run_file(artifact.topology.model, artifact.scene, {}, task="factor", method=artifact.method, solver=solver)
    summary = call_simulator(artifact.binary.path, run_file)
    return {name: value for name, value in summary.items() if isinstance(value, float | int)}


def with_closure(scene: Scene, closure: str) -> Scene:
    """The scene with another closure; what it says of the penalty stays, a default becomes the closure's own.

    Raises:
        RunError: the scene leaves the penalty to the closure "proximal".
    """
    before = scene.numerics
    if closure == "penalty" and not isfinite(before.penalty):
        raise RunError(f"{scene.span}: scene '{scene.name}': penalty: auto needs closure: proximal; write a number")
    default = closure == "proximal" and before.penalty == Numerics.penalty
    return replace(scene, numerics=replace(before, closure=closure, penalty=inf if default else before.penalty))


def with_figures(scene: Scene, method: str, changes: Mapping[str, float]) -> Scene:
    """The scene with other figures for one method."""
    own = {**scene.numerics.methods.get(method, {}), **changes}
    return replace(scene, numerics=replace(scene.numerics, methods={**scene.numerics.methods, method: own}))


def _describe(artifact: Artifact, folder: Path) -> Path:
    """The model as the generic twin reads it."""
    path = folder / "model.json"
    equations = artifact.equations
    if isinstance(equations, LagrangianEquations):
        description = describe_generic_natural(equations)
    else:
        description = describe_generic(artifact.topology, artifact.scene, equations.outputs)
    path.write_text(json.dumps(description), encoding="utf-8")
    return path


def find_equilibrium(path: Path, *, scene: str | None = None, parameters: Mapping[str, float] | None = None) -> Equilibrium:
    """The static equilibrium of a model with every quantity of its bodies, forces and reactions.

    Raises:
        NoEquilibriumError: none was found near the design position.
        ModelError, TopologyError, RunError, ToolchainError: as for compile_model.
    """
    model = read_model(path)
    chosen = find_scene(model, scene)
    outputs = _everything(model)
    _, _, source = generate(model, chosen, outputs)
    run_file = make_run_file(model, replace(chosen, pose="equilibrium"), parameters or {}, task="equilibrium")
    summary = call_simulator(build(source).path, run_file)
    failure = failure_of(summary)
    if failure is not None:
        raise NoEquilibriumError(failure)
    return Equilibrium(values=summary["columns"], units={o.column: unit_of(model, o) for o in outputs})


def find_modes(
    model: Model, scene: Scene, *, at: float | None = None, parameters: Mapping[str, float] | None = None, progress: Progress | None = None
) -> Modes:  # fmt: skip
    """Eigenvalues and mode shapes of a model about its static equilibrium, or about its motion ``at`` a time (s) of a scene.

    Raises:
        NoEquilibriumError: none was found near the design position.
        RunError: the run ends before that time, a direction moves no mass, or the loops have more freedom there than nearby.
        ModelError, TopologyError, ToolchainError: as for compile_scene.
    """
    # Model -> Binary
    artifact = compile_scene(model, scene, method="recursive-newton")
    equations = artifact.equations
    assert isinstance(equations, ImplicitEquations)
    where = f"{scene.span}: scene '{scene.name}'"
    try:
        # Binary -> Linearisation -> Modes
        time, linearised = linearise_at(artifact.binary.path, equations, at, parameters or {}, progress)
        modes = find_mode_shapes(linearised, time)
    except NotReachedError as error:
        if at is not None:
            raise RunError(f"{where}: the run does not reach {at:g} s: {error}") from error
        advice = f"{error.report.advice}, or linearise about a motion with --at"
        raise NoEquilibriumError(replace(error.report, advice=advice)) from error
    except NoMassError as error:
        raise RunError(f"{where}: {error}") from error
    usual = find_mobility(artifact.mechanism).degrees_of_freedom
    if modes.freedoms != usual:
        raise RunError(
            f"{where}: a singular pose: {modes.freedoms} directions are free there and {usual} nearby, so that small motions are not "
            "those of linear equations; linearise elsewhere"
        )
    return modes


def _everything(model: Model) -> list[Output]:
    """The pose of each body and every force."""
    joints = {j.name: j for j in model.joints}
    pose = ("x", "y", "z", "roll", "pitch", "yaw")
    bodies = [(b, [q for q in quantities(b, joints) if q in pose]) for b in model.bodies]
    others = [(e, list(quantities(e, joints))) for e in (*model.forces, *model.reactions)]
    return [Output(element=e.name, quantity=q, span=e.span) for e, names in (*bodies, *others) for q in names]
