"""The bodies of a model where a scene starts: poses and velocities, by four points of each body as outputs of an interpreted run."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import PLAIN_CLOSURE, Loops
from cutjoint.model.records import COORDINATES, Marker, Model, Output, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import make_simulator_run
from cutjoint.run.failures import describe_failure
from cutjoint.run.scenes import with_closure, with_loops
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.run.simulator_run import start
from cutjoint.topology.records import Topology
from cutjoint_bench.export.laws import Array

#: A rotation (rad) or a shift (m) below this is rounding of differences of coordinates, and counts as zero.
ROUNDING = 1e-14


@dataclass(frozen=True, kw_only=True)
class Start:
    """A body at the start: rotation (3, 3), shift (3,) m of its points, velocity (3,) m/s, spin (3,) rad/s.
    The velocity is that of the centre of mass."""

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
        NoInertiaError, GuideError: the model is wrong.
        SimulatorError, ToolchainError: as for a run.
    """
    model = topology.model
    markers = tuple(m for body in model.bodies for m in markers_of(model, body.name))
    marked = replace(model, markers=(*model.markers, *markers))
    still = with_loops(with_closure(replace(scene, end=0.0), PLAIN_CLOSURE), Loops.EXACT)  # functions know not all coordinates
    artifact = compile_interpreted(marked, still, outputs=tuple(_outputs(topology, markers)))
    run = start(make_simulator_run(artifact, PLAIN_STEPS, parameters))
    if run.failure is not None:
        raise RunError(describe_failure(run.failure, scene.name, artifact.places, artifact, parameters))
    values = {name: float(rows[0]) for name, rows in run.columns.items()}
    designs = {body.name: markers_of(model, body.name) for body in model.bodies}
    starts = {name: _start(name, values, len(markers)) for name, markers in designs.items()}
    coordinates = {t.joint.name: tuple(values[f"{t.joint.name}.{c}"] for c in COORDINATES[t.joint.kind]) for t in topology.tree}
    return starts, coordinates


def markers_of(model: Model, body: str) -> tuple[Marker, ...]:
    """Four points of a body: the global origin and those a metre from it along x, y and z; their names have an "@"."""
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
    rotation = left @ right
    return Start(
        rotation=np.eye(3) if np.abs(rotation - np.eye(3)).max() < ROUNDING else rotation,
        shift=np.zeros(3) if np.abs(origin).max() < ROUNDING else origin, velocity=column(body, "vx vy vz"), spin=column(body, "wx wy wz"),
    )  # fmt: skip
