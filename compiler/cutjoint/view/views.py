"""Files that show a mechanism: a run over time, or a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.analysis.body_poses import BodyPose, find_poses, find_spanned_poses
from cutjoint.analysis.closing import design_coordinates
from cutjoint.formulate.natural.poses import derive_spans
from cutjoint.formulate.recursive.kinematics import derive_poses
from cutjoint.methods import METHODS, Formulation
from cutjoint.model.expressions.quantities import bodies_of
from cutjoint.model.records import GROUND, Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import AnyPath
from cutjoint.run.artifact import Artifact
from cutjoint.run.display import in_units
from cutjoint.run.inputs import with_constant_inputs
from cutjoint.run.outputs import OutputError
from cutjoint.run.result_files import write_whole
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import Evaluator, find_trim, parameter_values
from cutjoint.run.scenes import ModelLike, load_model, method_of
from cutjoint.tasks.states import find_start_coordinates
from cutjoint.topology.build import build_topology
from cutjoint.view.drawing import draw, find_camera
from cutjoint.view.ghost import GhostRun, read_page
from cutjoint.view.gltf import write_gltf
from cutjoint.view.graph import Graph
from cutjoint.view.motions import Motion, Mover, motion_times
from cutjoint.view.page import LAST_ROWS, Drive, PlotColumn, find_failure, make_page
from cutjoint.view.records import Array
from cutjoint.view.sizes import Placed, find_sizes
from cutjoint.view.sliders import Sliders, make_sliders

#: The suffixes of views.
PAGE, GLTF = ".html", ".glb"

#: The largest number of shown samples of a run, and their size in bytes, so that a page opens quickly.
_ROWS, _BYTES = 2000, 1_800_000

#: m; pictures have 32 bit numbers, in which squares of larger ones overflow.
_FAR = 1e18


@dataclass(frozen=True, kw_only=True)
class ViewSpec:
    """The contents of a view's file: a model in a scene with ``parameters`` (SI units) changed, and its motion.

    ``poses`` are those of its bodies at times ``t`` (times,), s, ``columns`` those of a table at these times, ``failure`` the reason of the
    run's stop, ``motions`` are about the pose of the first time.  ``note`` is said beside the scene, ``graph`` is the topology, ``sliders``
    change the pose.  Columns are shown in the units of ``display``, by default the model's, where these fit.
    """

    model: Model
    scene: Scene
    parameters: Mapping[str, float]
    t: Array
    poses: Mapping[str, BodyPose]
    columns: tuple[PlotColumn, ...] = ()
    failure: Mapping[str, Any] | None = None
    motions: tuple[Motion, ...] = ()
    note: str = ""
    graph: Graph | None = None
    sliders: Sliders | None = None
    display: tuple[str, ...] = ()


def read_ghost(ghost: Path | None, view: Path | None) -> GhostRun | None:
    """The run of the page ``ghost`` that a view shows too, if one is named.
    Raises RunError: the view is no page, or the other file is none of a run."""
    if ghost is None:
        return None
    if view is None or view.suffix != PAGE:
        raise RunError(f"--ghost {ghost}: only a page shows two runs; write --view with a name that ends in {PAGE}")
    return read_page(ghost, "--ghost")


def show_run(model: Model, scene: Scene, method: str, parameters: Mapping[str, float], run: Trajectory, *, variant: str = "") -> ViewSpec:
    """A run that has coordinates, in as many of its rows as a page takes; of a reduced model the ``variant`` is named."""
    assert run.coordinates is not None
    held, others = with_constant_inputs(model, scene, parameters)
    kept = _kept(run, len(model.bodies) + len(model.forces))
    t, q = run.t[kept], run.coordinates[kept]
    poses = _find_poses(model, held, method, t, q, parameter_values(model, others))
    of, elements = bodies_of(model), {o.column: o.element for o in scene.outputs}
    columns = tuple(
        PlotColumn(name=name, unit=run.units[name], bodies=of.get(elements.get(name, ""), ()), values=values[kept])
        for name, values in run.columns.items()
    )
    return ViewSpec(
        model=model, scene=held, parameters=parameters, t=t, poses=poses, columns=columns, failure=find_failure(model, run),
        note=f"{method}, {variant} model" if variant else method,
    )  # fmt: skip


def _find_poses(model: Model, scene: Scene, method: str, t: Array, q: Array, parameters: Mapping[str, float]) -> Mapping[str, BodyPose]:
    """The poses of all bodies from the coordinates of a method's rows; what is fixed to the ground has none of its own."""
    topology = build_topology(model)
    if METHODS[method].formulation is not Formulation.NATURAL:
        return find_poses(derive_poses(topology, scene), t, q, parameters)
    still = BodyPose(rotation=np.broadcast_to(np.eye(3), (t.size, 3, 3)), shift=np.zeros((t.size, 3)))
    return {**{body.name: still for body in model.bodies}, **find_spanned_poses(derive_spans(topology, scene), q, parameters)}


def show_start(model: Model, scene: Scene, parameters: Mapping[str, float]) -> ViewSpec:
    """The pose in which a scene starts; one as designed takes no simulator.

    Raises:
        RunError: the scene has no start, or a parameter cannot be set.
        SimulatorError, ToolchainError: as for a run.
    """
    is_posed = scene.positions or scene.assemble or scene.trim
    is_designed = scene.pose == "design" and not is_posed and all(joint.guide is None for joint in model.joints)
    if scene.trim is not None:
        model, scene, _ = find_trim(model, scene, parameters)
    mover = Mover(model=model, scene=scene, parameters=parameters)
    q = design_coordinates(mover.equations) if is_designed else find_start_coordinates(model, scene, parameters)
    return ViewSpec(
        model=model, scene=scene, parameters=parameters, t=np.zeros(1), poses=mover.poses(q[np.newaxis]), sliders=make_sliders(mover, q)
    )  # fmt: skip


def write_view(
    path: AnyPath, model: ModelLike, run: Trajectory, *, scene: str | None = None, tunable: Sequence[str] = (), method: str | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Path:  # fmt: skip
    """Write a run as a page (.html) or as glTF (.glb); further arguments as of the run.

    Raises:
        RunError: `simulate` was not asked for the run's coordinates.
        OutputError: the file cannot be written, or its ending names no kind.
    """
    if run.coordinates is None:
        raise RunError("the run has no coordinates to draw it by; write simulate(model, coordinates=True)")
    read, chosen = load_model(model, scene, tunable)
    if isinstance(model, Artifact):
        chosen, method = replace(chosen, outputs=model.equations.outputs), method or model.method
    return write_shown(Path(path), show_run(read, chosen, method or method_of(chosen), parameters or {}, run))


def write_shown(path: Path, shown: ViewSpec, *, ghost: GhostRun | None = None) -> Path:
    """Write what is shown as a page, with an earlier run (``ghost``) if there is one, or as a .glb file.
    Raises OutputError: the file cannot be written, its ending names no kind, or a body starts too far away for any picture."""
    if path.suffix not in (PAGE, GLTF):
        raise OutputError(f"{path}: no such kind of file; write a name that ends in {PAGE} or {GLTF}")
    shown = _in_reach(path, shown)
    return write_whole(path, _content(path.suffix, shown, ghost))


def live_page(model: Model, scene: Scene, parameters: Mapping[str, float]) -> str:
    """The page of a scene's start that then follows a host; see `view.live`.
    Raises RunError, SimulatorError, ToolchainError: as of `show_start`."""
    content = _content(PAGE, _in_reach(Path(model.name), show_start(model, scene, parameters)), None, is_live=True)
    assert isinstance(content, str)
    return content


def drive_page(model: Model, scene: Scene, parameters: Mapping[str, float], drive: Drive) -> str:
    """The page of a scene's start whose simulation then runs; errors as of `live_page`."""
    content = _content(PAGE, _in_reach(Path(model.name), show_start(model, scene, parameters)), None, drive=drive)
    assert isinstance(content, str)
    return content


def _content(kind: str, shown: ViewSpec, ghost: GhostRun | None, *, is_live: bool = False, drive: Drive | None = None) -> str | bytes:
    placed = _placed(shown, shown.poses, shown.t)
    outputs = {o.column: (o.element, o.quantity) for o in shown.scene.outputs}
    values = {outputs[c.name]: c.values for c in shown.columns if c.name in outputs and c.values.size == shown.t.size}
    has_arrows = kind == PAGE and not shown.motions  # forces are known for runs only
    drawing = draw(placed, shown.t, failed=shown.failure["element"] if shown.failure else "", columns=values if has_arrows else {})
    camera = find_camera(placed, drawing)
    if drive:  # the page draws the road that it lays
        drawing = replace(drawing, nodes=tuple(node for node in drawing.nodes if "road" not in node.about))
        camera |= {"road": False, "floor": 0.0 if camera["road"] else camera["floor"]}
    times = motion_times()
    moving = {motion.name: draw(_placed(shown, motion.poses, times), times) for motion in shown.motions}
    glb = write_gltf(drawing, moving or None)
    if kind == GLTF:
        return glb
    columns, ghost = _displayed(shown, ghost)
    return make_page(
        title=shown.model.name, scene=shown.scene.name, note=shown.note, bodies=[b.name for b in shown.model.bodies], glb=glb, t=shown.t,
        columns=columns, camera=camera, failure=shown.failure, motions=shown.motions,
        ghost=ghost, graph=shown.graph, sliders=shown.sliders, is_live=is_live, plots=() if drive else shown.scene.plots, drive=drive,
    )  # fmt: skip


def _displayed(shown: ViewSpec, ghost: GhostRun | None) -> tuple[list[PlotColumn], GhostRun | None]:
    """The columns of a page in its units, and a ghost with its columns of these units."""
    display = shown.display or shown.model.display
    values, units = in_units({c.name: c.values for c in shown.columns}, {c.name: c.unit for c in shown.columns}, display)
    if ghost is not None:
        others, named = in_units(ghost.columns, ghost.units, display)
        ghost = replace(ghost, columns={name: others[name] for name in others if units.get(name, named[name]) == named[name]})
    return [replace(c, values=values[c.name], unit=units[c.name]) for c in shown.columns], ghost


def _in_reach(path: Path, shown: ViewSpec) -> ViewSpec:
    """The shown motion, up to the first time at which a body is too far away to be drawn; then the note says so."""
    near = np.array([np.abs(pose.shift).max(axis=1) < _FAR for pose in shown.poses.values()]).reshape(-1, shown.t.size).all(axis=0)
    rows = int(np.append(near, False).argmin())
    if not rows:
        raise OutputError(f"{path}: a body starts further than {_FAR:g} m away, and no picture shows that; mind units")
    if rows == shown.t.size:
        return shown
    return replace(
        shown, t=shown.t[:rows], note=f"{shown.note}, drawn up to {shown.t[rows]:.4g} s, where a body is {_FAR:g} m away",
        poses={name: BodyPose(rotation=pose.rotation[:rows], shift=pose.shift[:rows]) for name, pose in shown.poses.items()},
        columns=tuple(replace(column, values=column.values[:rows]) for column in shown.columns),
    )  # fmt: skip


def _placed(shown: ViewSpec, poses: Mapping[str, BodyPose], t: Array) -> Placed:
    numbers = Evaluator(shown.model, parameter_values(shown.model, shown.parameters))
    still = BodyPose(rotation=np.broadcast_to(np.eye(3), (t.size, 3, 3)), shift=np.zeros((t.size, 3)))
    return Placed(
        model=shown.model, scene=shown.scene, numbers=numbers, sizes=find_sizes(shown.model, shown.scene, numbers),
        poses={**poses, GROUND: still},
    )  # fmt: skip


def _kept(run: Trajectory, nodes: int) -> Array:
    """The indices of the shown samples: all, or evenly selected ones; all of the last ones if the run failed."""
    rows = run.t.size
    place = max(200, _BYTES // (40 * nodes + 4 * len(run.columns)))
    most = min(rows, _ROWS, place)
    last = np.arange(max(0, rows - (0 if run.failure is None else LAST_ROWS)), rows)
    return np.union1d(np.rint(np.linspace(0, rows - 1, most)).astype(int), last)
