"""Motions about a state: modes, the search for the equilibrium, degrees of freedom; and the effect of a reduction on the topology."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cutjoint.analysis.body_poses import BodyPose
from cutjoint.analysis.closing import Pose, design_coordinates
from cutjoint.analysis.inertia import find_momentary_motions
from cutjoint.analysis.modes import Complex, Mode, Modes, Participant
from cutjoint.analysis.redundancy import find_redundancy
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.expressions.quantities import bodies_of
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.sequence import ReducedModel
from cutjoint.report.tasks import mode_figures, participants
from cutjoint.run.results import MechanismState
from cutjoint.tasks.states import find_start_coordinates
from cutjoint.topology.build import build_topology
from cutjoint.view.graph import Graph, draw_graph
from cutjoint.view.motions import PERIOD, Motion, Mover, motion_times
from cutjoint.view.page import PlotColumn
from cutjoint.view.records import Array
from cutjoint.view.views import ViewSpec

#: Smaller entries of a direction are rounding.
_PART = 1e-6


def show_modes(model: Model, scene: Scene, parameters: Mapping[str, float], modes: Modes) -> ViewSpec:
    """The mechanism in each of its modes, then in each rigid-body mode; decay and growth are left out."""
    mover = Mover(model=model, scene=scene, parameters=parameters, time=modes.time)
    motions = [
        Motion(name=f"{i}: {_title(mode)}", facts=(*mode_figures(mode), *participants(mode.shape)),
               poses=mover.swing(modes.q, _amplitudes(mode.shape)))
        for i, mode in enumerate(modes.modes, 1)
    ]  # fmt: skip
    motions += [
        Motion(name=f"eigenvalue of zero: {name}", facts=participants(shape), poses=mover.swing(modes.q, _amplitudes(shape)))
        for name, shape in modes.rigid_body_modes.items()
    ]
    return _shown(mover, modes.q, motions)


def _title(mode: Mode) -> str:
    if mode.frequency:
        return f"{mode.frequency:.4g} Hz"
    constant = mode.time_constant
    assert constant is not None
    return f"{'decays' if constant > 0 else 'grows'} in {abs(constant):.3g} s"


def _amplitudes(shape: Mapping[str, Participant]) -> Complex:
    return np.array([p.amplitude for p in shape.values()], dtype=np.complex128)


def _shown(mover: Mover, q: Array, motions: list[Motion], columns: tuple[PlotColumn, ...] = ()) -> ViewSpec:
    return ViewSpec(
        model=mover.model, scene=mover.scene, parameters=mover.parameters, t=np.zeros(1), poses=mover.poses(q[np.newaxis]),
        motions=tuple(motions), columns=columns,
    )  # fmt: skip


def show_equilibrium(model: Model, scene: Scene, parameters: Mapping[str, float], found: MechanismState) -> ViewSpec:
    """The way from the design position to the equilibrium and back, loops closed, and the quantities of the equilibrium.

    Raises:
        RunError: the scene has no start there.
        ToolchainError, SimulatorError: as for a run.
    """
    mover = Mover(model=model, scene=scene, parameters=parameters)
    resting = replace(scene, pose="equilibrium", rates={}) if scene.trim is None else scene
    end = find_start_coordinates(model, resting, parameters)
    start = design_coordinates(mover.equations)
    shares = (1 - np.cos(2 * np.pi * motion_times() / PERIOD)) / 2
    rows = np.array([mover.closed(_between(mover.equations, start, end, share), np.zeros(0)) for share in shares])
    way = Motion(name="design position to equilibrium", facts=(), poses=mover.poses(rows))
    of = bodies_of(model)
    columns = tuple(
        PlotColumn(name=name, unit=found.units[name], bodies=of.get(name.rpartition(".")[0], ()), values=np.array([value]))
        for name, value in found.values.items()
    )
    return _shown(mover, end, [way], columns)


def _between(equations: RecursiveEquations, start: Array, end: Array, share: float) -> Array:
    """Interpolated coordinates; quaternions take the shorter arc."""
    q = start + share * (end - start)
    for chart in equations.charts:
        if chart.ball:
            e = slice(chart.q + chart.scalars, chart.q + chart.scalars + 4)
            rotated = (1 - share) * start[e] + share * end[e] * (-1.0 if start[e] @ end[e] < 0 else 1.0)
            q[e] = rotated / np.linalg.norm(rotated)
    return q


def show_directions(model: Model, scene: Scene, equations: RecursiveEquations, pose: Pose, graph: Graph) -> ViewSpec:
    """The directions that the loops leave free at a pose, each named by a speed that no other one has, beside the topology's ``graph``."""
    mover = Mover(model=model, scene=scene, parameters={})
    motions = [
        Motion(
            name=f"free: {equations.speed_names[dominant]}", poses=mover.swing(pose.q, column.astype(np.complex128)),
            facts=tuple((equations.speed_names[i], f"{column[i]:.4g}") for i in np.flatnonzero(column)),
        )
        for dominant, column in free_directions(pose.free)
    ]  # fmt: skip
    return replace(_shown(mover, pose.q, motions), graph=graph)


def free_directions(free: Array) -> Iterator[tuple[int, Array]]:
    """The directions (speeds,) of a space (speeds, directions), each with the speed that is 1 in it and 0 in all others."""
    rest, dominants = free.copy(), []
    for _ in range(free.shape[1]):
        dominant = int(np.linalg.norm(rest, axis=1).round(9).argmax())
        dominants.append(dominant)
        along = rest[dominant] / np.linalg.norm(rest[dominant])
        rest -= np.outer(rest @ along, along)
    basis = free @ np.linalg.inv(free[dominants]) if dominants else free
    yield from sorted(zip(dominants, np.where(np.abs(basis) > _PART, basis, 0.0).T, strict=True), key=lambda pair: pair[0])


def find_notes(equations: RecursiveEquations, poses: Sequence[Pose]) -> Mapping[str, Sequence[str]]:
    """Faults of elements: equations of cut joints that follow from others, bodies whose motion no mass resists for a moment."""
    notes: dict[str, list[str]] = {}
    redundancy = find_redundancy(equations, poses) if equations.equation_names else None
    if redundancy is not None:
        for when, found in (("in every pose", redundancy.structural), ("in the design position", redundancy.momentary)):
            for joint in dict.fromkeys(r.joint for r in found):
                names = ", ".join(r.equation for r in found if r.joint == joint)
                notes.setdefault(joint, []).append(f"redundant {when}: {names}")
    for motion in find_momentary_motions(equations, poses):
        for t in motion.joints:
            notes.setdefault(t.child, []).append(f"no mass resists its motion in the design position: {', '.join(motion.speeds)}")
    return notes


def show_reduction(model: Model, scene: Scene, parameters: Mapping[str, float], variants: Sequence[ReducedModel]) -> ViewSpec:
    """The design position of the full model, and its topology: left-out elements are faint, changed ones have a note."""
    last = variants[-1]
    elements, kept = _names(model), _names(last.model)
    facts = [(v.name, f"{v.unknowns} coordinates, {v.equations} equations, {v.operations} operations") for v in variants]
    facts += [(note.element, note.text) for note in last.done if note.element not in elements]
    graph = draw_graph(build_topology(model), facts, _notes(last), gone=elements - kept)
    still = BodyPose(rotation=np.eye(3)[np.newaxis], shift=np.zeros((1, 3)))
    return ViewSpec(
        model=model, scene=scene, parameters=parameters, t=np.zeros(1), poses={body.name: still for body in model.bodies}, graph=graph,
        note=f"{last.name}, from the full model",
    )  # fmt: skip


def _names(model: Model) -> frozenset[str]:
    return frozenset([*(b.name for b in model.bodies), *(j.name for j in model.joints), *(g.name for g in model.gears)])


def _notes(variant: ReducedModel) -> Mapping[str, Sequence[str]]:
    notes: dict[str, list[str]] = {}
    for note in (*variant.done, *variant.left):
        notes.setdefault(note.element, []).append(note.text)
    return notes
