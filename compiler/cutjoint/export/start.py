"""Where a scene starts: the pose and the velocities of every body, found by the generic simulator."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cutjoint.methods import PLAIN_CLOSURE, Implementation
from cutjoint.model.records import COORDINATES, Marker, Model, Output, Scene
from cutjoint.run.errors import RunError
from cutjoint.run.failures import describe_failure, places_of
from cutjoint.run.options import PLAIN_STEPS
from cutjoint.run.results import read_table
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import with_closure
from cutjoint.run.simulator import call_simulator, failure_of
from cutjoint.toolchain.build import build_generic
from cutjoint.toolchain.temporary import temporary_folder
from cutjoint.topology.records import Topology
from cutjoint.twin.mechanism import describe_generic

Array = NDArray[np.float64]

#: A rotation (rad) or a shift (m) below this is rounding of differences of coordinates, and counts as zero.
ROUNDING = 1e-14


@dataclass(frozen=True, kw_only=True)
class Start:
    """A body at the start: a point p of the design position is at rotation (3, 3) p + shift (3,), m; velocity (3,) of its own centre
    of mass, m/s; spin (3,), rad/s.
    """

    rotation: Array
    shift: Array
    velocity: Array
    spin: Array


def find_start(
    topology: Topology, scene: Scene, parameters: Mapping[str, float]
) -> tuple[Mapping[str, Start], Mapping[str, tuple[float, ...]]]:
    """Every body at the start of a scene, and the coordinates of every tree joint.

    Raises:
        RunError: the scene has no start.
        SimulatorError, ToolchainError: as for a run.
    """
    model = topology.model
    markers = tuple(m for body in model.bodies for m in markers_of(model, body.name))
    marked = replace(topology, model=replace(model, markers=(*model.markers, *markers)))
    _, columns = run_generic(marked, replace(scene, end=0.0), parameters, tuple(_outputs(topology, markers)))
    values = {name: float(rows[0]) for name, rows in columns.items()}
    designs = {body.name: markers_of(model, body.name) for body in model.bodies}
    starts = {name: _start(name, values, len(markers)) for name, markers in designs.items()}
    coordinates = {t.joint.name: tuple(values[f"{t.joint.name}.{c}"] for c in COORDINATES[t.joint.kind]) for t in topology.tree}
    return starts, coordinates


def run_generic(
    topology: Topology, scene: Scene, parameters: Mapping[str, float], outputs: tuple[Output, ...]
) -> tuple[Array, Mapping[str, Array]]:
    """Time and columns of a scene in the generic simulator, which compiles nothing for a model.

    Raises:
        RunError: the scene has no start, or a step fails.
        SimulatorError, ToolchainError: as for a run.
    """
    with temporary_folder() as folder:
        (folder / "model.json").write_text(json.dumps(describe_generic(topology, scene, outputs)), encoding="utf-8")
        run_file = make_run_file(
            topology.model, with_closure(scene, PLAIN_CLOSURE), parameters, task="simulate", out=str(folder / "table.csv"),
            implementation=Implementation.GENERIC, options=PLAIN_STEPS,
        )  # fmt: skip
        summary = call_simulator(build_generic().path, {**run_file, "model": str(folder / "model.json")})
        if (failure := failure_of(summary)) is not None:
            where = places_of(topology, scene)
            raise RunError(describe_failure(failure, scene.name, where, Path(topology.model.span.file), parameters))
        return read_table(folder / "table.csv")


def markers_of(model: Model, body: str) -> tuple[Marker, ...]:
    """Four points of a body: the global origin and those a metre from it along x, y and z; no name of a file has an "@"."""
    span = next(b.span for b in model.bodies if b.name == body)
    points = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    return tuple(Marker(name=f"{body}@{i}", body=body, point=point, span=span) for i, point in enumerate(points))


def _outputs(topology: Topology, markers: tuple[Marker, ...]) -> Iterator[Output]:
    for marker in markers:
        yield from (Output(element=marker.name, quantity=q, span=marker.span) for q in "xyz")
    for body in topology.model.bodies:
        yield from (Output(element=body.name, quantity=q, span=body.span) for q in ("vx", "vy", "vz", "wx", "wy", "wz"))
    for joint in (t.joint for t in topology.tree):
        yield from (Output(element=joint.name, quantity=q, span=joint.span) for q in COORDINATES[joint.kind])


def _start(body: str, values: Mapping[str, float], points: int) -> Start:
    def column(element: str, names: str) -> Array:
        return np.array([values[f"{element}.{name}"] for name in names.split()])

    origin, *tips = (column(f"{body}@{i}", "x y z") for i in range(points))
    left, _, right = np.linalg.svd(np.column_stack([tip - origin for tip in tips]))
    rotation: Array = left @ right
    return Start(
        rotation=np.eye(3) if np.abs(rotation - np.eye(3)).max() < ROUNDING else rotation,
        shift=np.zeros(3) if np.abs(origin).max() < ROUNDING else origin,
        velocity=column(body, "vx vy vz"), spin=column(body, "wx wy wz"),
    )  # fmt: skip
