"""Files that show a mechanism: a run over time, or a pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cutjoint.analysis.body_poses import BodyPose, find_poses
from cutjoint.export.numbers import Numbers
from cutjoint.export.start import find_start
from cutjoint.formulate.recursive.poses import derive_poses
from cutjoint.methods import METHODS, Formulation, either, names_of
from cutjoint.model.records import Model, Scene
from cutjoint.run.errors import RunError
from cutjoint.run.inputs import with_held_inputs
from cutjoint.run.outputs import OutputError
from cutjoint.run.result_files import write_whole
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import parameter_values
from cutjoint.topology.build import build_topology
from cutjoint.view.columns import bodies_of
from cutjoint.view.drawing import draw
from cutjoint.view.gltf import write_gltf
from cutjoint.view.outlook import find_outlook
from cutjoint.view.page import PlotColumn, make_page
from cutjoint.view.records import Array
from cutjoint.view.sizes import find_sizes

#: The endings of files that show something.
PAGE, GLTF = ".html", ".glb"

#: How many rows of a run are shown at most, and how many bytes they take: a page opens at once, and nobody sees more.
_ROWS, _BYTES = 2000, 1_800_000


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What a file shows: a model in a scene with ``parameters`` (SI units) changed, the ``poses`` of its bodies at times ``t`` (times,), s,
    and columns of a table at these times."""

    model: Model
    scene: Scene
    parameters: Mapping[str, float]
    t: Array
    poses: Mapping[str, BodyPose]
    columns: tuple[PlotColumn, ...] = ()


def require_view(path: Path, option: str) -> None:
    """Check that a file's ending says what it is.

    Raises:
        OutputError: it is neither a page nor a glTF file.
    """
    if path.suffix not in (PAGE, GLTF):
        raise OutputError(f"{option} {path}: no such kind of file; write a name that ends in {PAGE} or {GLTF}")


def require_poses(method: str) -> None:
    """Check that the coordinates of a method's runs say where bodies are.

    Raises:
        RunError: they are natural ones.
    """
    if METHODS[method].formulation is Formulation.NATURAL:
        able = either(names_of(METHODS, lambda m: m.formulation is not Formulation.NATURAL))
        raise RunError(f"--view: rows of the method {method} are natural coordinates, not those of the tree; use --method {able}")


def show_run(model: Model, scene: Scene, parameters: Mapping[str, float], run: Trajectory) -> Shown:
    """A run that has coordinates, in as many of its rows as a page takes."""
    assert run.coordinates is not None
    held, others = with_held_inputs(model, scene, parameters)
    kept = _kept(run.t.size, len(model.bodies) + len(model.forces), len(run.columns))
    t, q = run.t[kept], run.coordinates[kept]
    poses = find_poses(derive_poses(build_topology(model), held), t, q, parameter_values(model, others))
    of, elements = bodies_of(model), {o.column: o.element for o in scene.outputs}
    columns = tuple(
        PlotColumn(name=name, unit=run.units[name], bodies=of.get(elements.get(name, ""), ()), values=values[kept])
        for name, values in run.columns.items()
    )
    return Shown(model=model, scene=held, parameters=parameters, t=t, poses=poses, columns=columns)


def show_start(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Shown:
    """The pose in which a scene starts; one as designed takes no simulator.

    Raises:
        RunError: the scene has no start, or a parameter cannot be set.
        SimulatorError, ToolchainError: as for a run.
    """
    if _is_as_designed(model, scene):
        poses = {body.name: BodyPose(rotation=np.eye(3)[np.newaxis], shift=np.zeros((1, 3))) for body in model.bodies}
    else:
        starts, _ = find_start(build_topology(model), scene, parameters)
        poses = {name: BodyPose(rotation=s.rotation[np.newaxis], shift=s.shift[np.newaxis]) for name, s in starts.items()}
    return Shown(model=model, scene=scene, parameters=parameters, t=np.zeros(1), poses=poses)


def _is_as_designed(model: Model, scene: Scene) -> bool:
    """Whether a scene starts where the file places the bodies: nothing else is given and no guide moves them."""
    return scene.pose == "design" and not scene.positions and all(joint.guide is None for joint in model.joints)


def write_view(path: Path, shown: Shown) -> Path:
    """Write what is shown as a page, or as a .glb file.

    Raises:
        OutputError: the file cannot be written, or its ending names no kind.
    """
    require_view(path, "")
    numbers = Numbers.of(shown.model, shown.scene, shown.parameters)
    sizes = find_sizes(shown.model, shown.scene, numbers)
    drawing = draw(shown.model, shown.scene, numbers, sizes, shown.t, shown.poses)
    glb = write_gltf(drawing)
    if path.suffix == GLTF:
        return write_whole(path, glb)
    page = make_page(
        title=shown.model.name, scene=shown.scene.name, bodies=[b.name for b in shown.model.bodies], glb=glb, t=shown.t,
        columns=shown.columns, outlook=find_outlook(shown.model, numbers, sizes, drawing, shown.poses),
    )  # fmt: skip
    return write_whole(path, page)


def _kept(rows: int, nodes: int, columns: int) -> Array:
    """The numbers of the rows that are shown: all, or as many as there is place for, evenly."""
    place = max(200, _BYTES // (40 * nodes + 4 * columns))
    most = min(rows, _ROWS, place)
    return np.unique(np.rint(np.linspace(0, rows - 1, most)).astype(int))
