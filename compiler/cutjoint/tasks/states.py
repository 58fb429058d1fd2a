"""Studies of a model besides runs: its static equilibrium, and its small motions about a state.

A search takes hundreds of evaluations, so that compiling would take longer than it: programs are interpreted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np

from cutjoint.analysis.closing import retract, retract_changes, speed_scales
from cutjoint.analysis.linearise import NoMassError, linearise
from cutjoint.analysis.mobility import find_mobility, moving_joints
from cutjoint.analysis.modes import Modes, find_mode_shapes
from cutjoint.analysis.trims import Trimmed
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.methods import LINEARISED, PLAIN_CLOSURE, Loops
from cutjoint.model.expressions.quantities import POSE, Element, quantities, unit_of
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.failures import IncompleteError, describe_failure, is_impossible
from cutjoint.run.modes import NotReachedError, linearise_at, point_of
from cutjoint.run.record import RunFile
from cutjoint.run.results import Array, Columns, FailureReport, MechanismState, read_locking_forces
from cutjoint.run.run_file import find_trim as find_scene_trim
from cutjoint.run.run_file import make_run_file, parameter_values
from cutjoint.run.scenes import ModelLike, load_model, with_closure, with_loops
from cutjoint.run.settings import PLAIN_STEPS, require_settings
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import Progress, call_simulator, failure_of
from cutjoint.run.simulator_run import start
from cutjoint.topology.build import build_topology

_ABOUT_A_MOTION = ", or linearise about a motion"
#: The share of the largest singular value below which a direction may be neutral; how far beside an equilibrium (rad, arms) that is tried.
_NEARLY_ZERO, _BESIDE = 1e-8, 0.01
_SPEEDS = ("vx", "vy", "vz", "wx", "wy", "wz")


class NoEquilibriumError(IncompleteError):
    """No static equilibrium was found."""

    @property
    def report(self) -> FailureReport:
        """The end of the search."""
        report: FailureReport = self.args[1]
        return report


def find_equilibrium(
    model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), parameters: Mapping[str, float] | None = None
) -> MechanismState:  # fmt: skip
    """Static equilibrium of a model, or the start of a scene with a trim; ``tunable`` as of `compile_model`."""
    return find_scene_equilibrium(*load_model(model, scene, tunable), parameters=parameters)


def find_scene_equilibrium(
    model: Model, scene: Scene, *, parameters: Mapping[str, float] | None = None, neutral: bool = False
) -> MechanismState:  # fmt: skip
    """The static equilibrium of a model, or the trimmed start of a scene, with every quantity of bodies, forces and reactions.
    It also has the forces that lock the scene's positions, or the result of the trim; what is ``neutral`` in an equilibrium on request.

    Raises:
        NoEquilibriumError: none was found near the design position.
        ModelError, EquationsError: the file is wrong.
        RunError: there is no such scene, or a parameter cannot be set.
        ToolchainError: the C++ side failed.
        SimulatorError: the simulator could not begin.
    """
    outputs = _everything(model)
    if scene.trim is not None:
        model, start, found = find_scene_trim(model, with_loops(scene, Loops.EXACT), parameters or {})
        return replace(_find_start(model, start, outputs, {}), trim=found)
    artifact = compile_interpreted(model, with_loops(scene, Loops.EXACT), outputs=outputs)
    run_file = make_run_file(model, replace(scene, pose="equilibrium"), parameters or {}, task="equilibrium", options=PLAIN_STEPS)
    summary = call_simulator(artifact.binary.path, {**run_file.entries(), "with_state": True}, description=artifact.description)
    failure = failure_of(summary)
    if failure is not None:
        raise NoEquilibriumError(_describe(failure, artifact, parameters), failure)
    named = tuple(_neutral(artifact, run_file, summary["state"])) if neutral else ()
    values = {name: nan if value is None else value for name, value in summary["columns"].items()}  # null: not finite
    units = {o.column: unit_of(model, o) for o in outputs}
    held = read_locking_forces(summary)
    return MechanismState(values=Columns({x: values[x] for x in units}), units=Columns(units), locking_forces=held, neutral=named)


def _neutral(artifact: Artifact, run_file: RunFile, state: Mapping[str, Any]) -> Iterator[str]:
    """What nothing restores: a candidate by the linear equations that a search from beside the equilibrium leaves there.
    Given positions are no candidates. A spring may restore what it does not in the first order, or is too soft beside others."""
    equations = formulate_implicit(artifact.mechanism, ())
    start, at = equations.start, linearise(equations, point := point_of(artifact, equations, run_file, state), at_rest=True)
    given, unit = run_file.positions.keys() - set(run_file.near), np.eye(len(at.M))
    rows = [c.v + min(i, c.scalars) + k for c in start.charts for i, name in enumerate(c.coordinate_names) if f"{c.joint}.{name}" in given
            for k in range(3 if i >= c.scalars else 1)]  # fmt: skip
    at = replace(at, J=np.concatenate([at.J, unit[rows]]), G=np.concatenate([at.G, 0 * unit[rows]]))
    shapes, of_states = find_mode_shapes(at, 0.0, _NEARLY_ZERO).rigid_body_modes, at.names[equations.state.speeds :]
    yield from (name for name in shapes if name in of_states)
    leading = [at.names.index(name) for name in shapes if name not in of_states]
    if not leading:
        return
    lengths, moves = _BESIDE * speed_scales(start), np.zeros(len(unit))
    for i in leading:
        way = np.array([p.amplitude.real for p in shapes[at.names[i]].values()])
        moves += lengths[i] / way[i] * way
    q = retract(start, point.q, moves)
    names = [f"{c.joint}.{name}" for c in start.charts for name in c.coordinate_names]
    positions = dict(zip(names, q.tolist(), strict=True))
    beside = {**run_file.entries(), "positions": positions, "near": [x for x in names if x not in given], "with_state": True}
    summary = call_simulator(artifact.binary.path, beside, description=artifact.description)
    if failure_of(summary) is not None:
        yield from (name for name in find_mode_shapes(at, 0.0).rigid_body_modes if name not in of_states)
        return
    moved = np.array(summary["state"]["q"]) - point.q
    for i, way in zip(leading, retract_changes(start, point.q, np.zeros(len(unit)), unit[leading]), strict=True):
        if 2 * moved @ way > lengths[i] * way @ way:
            yield at.names[i]


def find_start_coordinates(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Array:
    """The tree's coordinates where a scene starts.
    Raises RunError: it has no start; SimulatorError, ToolchainError: as for a run."""
    chosen = with_loops(with_closure(replace(scene, end=0.0), PLAIN_CLOSURE), Loops.EXACT)
    artifact = compile_interpreted(model, chosen, outputs=[])
    run = start(replace(make_simulator_run(artifact, PLAIN_STEPS, parameters), with_coordinates=True))
    if run.failure is not None:
        raise RunError(_describe(run.failure, artifact, parameters))
    assert run.coordinates is not None
    return np.asarray(run.coordinates[0])


def find_initial_state(
    model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), parameters: Mapping[str, float] | None = None
) -> MechanismState:  # fmt: skip
    """Initial state of a scene: poses and velocities of bodies, coordinates and velocities of the tree joints.

    Raises:
        FailedRunError: no start was found; its trajectory is empty.
        ModelError, EquationsError: the file is wrong.
        RunError: there is no such scene, or a parameter cannot be set.
        ToolchainError: the C++ side failed.
        SimulatorError: the simulator could not begin.
    """
    read, found = load_model(model, scene, tunable)
    tree = [t.joint for t in build_topology(read).tree]
    outputs = [*_outputs(read.bodies, (*POSE, *_SPEEDS)), *(o for joint in tree for o in _outputs([joint], quantities(joint)))]
    return _find_start(read, found, outputs, parameters)


def _find_start(model: Model, scene: Scene, outputs: Sequence[Output], parameters: Mapping[str, float] | None) -> MechanismState:
    """Outputs where a scene begins; errors as of `find_initial_state`."""
    chosen = with_loops(with_closure(replace(scene, end=0.0), PLAIN_CLOSURE), Loops.EXACT)
    artifact = compile_interpreted(model, chosen, outputs=outputs)
    run = simulate(artifact, parameters=parameters, integrator=PLAIN_STEPS.integrator, events=PLAIN_STEPS.events, error=False)
    values = Columns({name: float(column[0]) for name, column in run.columns.items()})
    return MechanismState(values=values, units=run.units, undetermined=run.undetermined)


def find_modes(
    model: ModelLike, *, scene: str | None = None, at: float | None = None, tunable: Sequence[str] = (),
    parameters: Mapping[str, float] | None = None, progress: Progress | None = None,
) -> Modes:  # fmt: skip
    """Eigenvalues and mode shapes about the static equilibrium, or about the motion at the time ``at`` (s)."""
    return find_scene_modes(*load_model(model, scene, tunable), at=at, parameters=parameters, progress=progress)


def find_scene_modes(
    model: Model, scene: Scene, *, at: float | None = None, parameters: Mapping[str, float] | None = None, progress: Progress | None = None
) -> Modes:  # fmt: skip
    """Eigenvalues and mode shapes of a model about its equilibrium, a trimmed start, or its motion ``at`` a time (s) of a scene.

    Raises:
        NoEquilibriumError: none was found near the design position.
        RunError: a time or a parameter that cannot be, the run ends before it, a direction moves no mass, or the loops have more freedom
            there than nearby.
        ModelError, EquationsError, MissingLibraryError, ToolchainError: as for compile_scene.
        SimulatorError: the simulator could not begin.
    """
    require_settings(at=at)
    parameter_values(model, parameters or {})
    scene = with_loops(scene, Loops.EXACT)
    trim = None
    if at is None and scene.trim is not None:
        model, scene, trim = find_scene_trim(model, scene, parameters or {})
    # Model -> Binary: an equilibrium is found by interpretation, a motion goes on by the method of the linearisation
    artifact = compile_interpreted(model, scene) if at is None else compile_scene(model, scene, CompileOptions(method=LINEARISED))
    equations = formulate_implicit(artifact.mechanism, ())
    where = f"{scene.span}: scene '{scene.name}'"
    try:
        # Binary -> Linearisation -> Modes
        if trim is None:
            time, linearised = linearise_at(artifact, equations, at, parameters or {}, progress)
        else:
            at_rest = not (any(trim.rates.values()) or moving_joints(artifact.mechanism))
            time, linearised = 0.0, linearise(equations, trim.point, at_rest=at_rest)
        steady, held = trim is not None and linearised.steady, tuple(controller.name for controller in model.controllers)
        modes = replace(find_mode_shapes(linearised, time), frozen_controllers=held, steady=steady)
    except NotReachedError as error:
        report = error.report
        if at is not None:
            impossible = _describe(report, artifact, parameters) if is_impossible(report) else ""
            raise RunError(impossible or f"{where}: the run does not reach {at:g} s: {report}") from error
        if not is_impossible(report):
            report = replace(report, advice=f"{report.advice.removesuffix(_ABOUT_A_MOTION)}{_ABOUT_A_MOTION} with --at")
        raise NoEquilibriumError(_describe(report, artifact, parameters), report) from error
    except NoMassError as error:
        raise RunError(f"{where}: {error}") from error
    usual = find_mobility(artifact.mechanism).degrees_of_freedom
    if modes.degrees_of_freedom != usual:
        raise RunError(
            f"{where}: a singular pose: {modes.degrees_of_freedom} directions are free there and {usual} nearby, so that small motions are "
            "not those of linear equations; linearise elsewhere"
        )
    return modes


def _describe(failure: FailureReport, artifact: Artifact, parameters: Mapping[str, float] | None) -> str:
    rubbing = [f"'{f.name}'" for f in artifact.mechanism.topology.model.forces if f.by_load and is_active(f, artifact.scene)]
    if rubbing and not is_impossible(failure):
        failure = replace(failure, advice=f"{failure.advice}, and that friction can hold what it must: {', '.join(rubbing)}")
    return describe_failure(failure, artifact.scene.name, artifact.places, artifact, parameters or {})


def _everything(model: Model) -> list[Output]:
    """The pose of each body, every force, and every state, signal and value of a controller."""
    others = (*model.forces, *model.reactions, *model.states, *model.signals, *model.controllers)
    return [*_outputs(model.bodies, POSE), *(o for element in others for o in _outputs([element], quantities(element)))]


def _outputs(elements: Iterable[Element], names: Iterable[str]) -> Iterator[Output]:
    yield from (Output(element=e.name, quantity=q, span=e.span) for e in elements for q in names)


def find_trim(
    model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), parameters: Mapping[str, float] | None = None,
    by: Sequence[str] = (),
) -> Trimmed:  # fmt: skip
    """Unknowns of a scene's trim, with gradients by tunable parameters.

    * ``tunable``: as of `compile_model`.
    * ``parameters``: values (SI units) of parameters and inputs.
    * ``by``: names of parameters.  The gradients follow from the conditions by the implicit function theorem; nothing is solved again.

    Raises:
        RunError: the scene has no trim, there is no such start, or it is not determined.
    """
    read, of = load_model(model, scene, tunable)
    if of.trim is None:
        raise RunError(f"{of.span}: scene '{of.name}' has no 'trim'; write one, or use find_equilibrium")
    return find_scene_trim(read, of, parameters or {}, by)[2]
