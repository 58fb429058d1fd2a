"""Motions that are no runs: small ones about a state, closed loops and all, as a page plays them again and again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cutjoint.analysis.body_poses import BodyPose, find_poses
from cutjoint.analysis.closing import close_loops, retract
from cutjoint.analysis.modes import Complex
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.recursive.kinematics import derive_poses
from cutjoint.model.records import GROUND, Model, Scene
from cutjoint.run.inputs import with_constant_inputs
from cutjoint.run.run_file import Evaluator, parameter_values
from cutjoint.topology.build import build_topology
from cutjoint.view.records import Array
from cutjoint.view.sizes import attached_points, find_sizes, point_of


def quaternions_of(rotations: Array) -> Array:
    """Quaternions (n, 4) of rotation matrices (n, 3, 3), each on the side of the one before (Shepperd, J. Guidance and Control 1, 1978)."""
    R = np.asarray(rotations)
    x, y, z = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    squares = np.stack([1 + x - y - z, 1 - x + y - z, 1 - x - y + z, 1 + x + y + z], axis=1)  # four times x2, y2, z2, w2
    products = np.empty((len(R), 4, 4))
    for i in range(4):
        products[:, i, i] = squares[:, i]
    for i, j, value in (
        (0, 1, R[:, 0, 1] + R[:, 1, 0]), (0, 2, R[:, 0, 2] + R[:, 2, 0]), (1, 2, R[:, 1, 2] + R[:, 2, 1]),
        (0, 3, R[:, 2, 1] - R[:, 1, 2]), (1, 3, R[:, 0, 2] - R[:, 2, 0]), (2, 3, R[:, 1, 0] - R[:, 0, 1]),
    ):  # fmt: skip
        products[:, i, j] = products[:, j, i] = value
    largest = products[np.arange(len(R)), squares.argmax(axis=1)]
    return continuous(largest / np.linalg.norm(largest, axis=1, keepdims=True))


def continuous(q: Array) -> Array:
    """Each quaternion or its negative, which is the same rotation, so that neighbours are close."""
    flips = np.sum(q[1:] * q[:-1], axis=1) < 0
    signs = np.concatenate([[1.0], np.where(flips, -1.0, 1.0)]).cumprod()
    return np.asarray(q * signs[:, np.newaxis])


def shortest(start: Array, end: Array) -> Array:
    """The quaternion (4,) of the smallest rotation between two directions (3,)."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    w = 1 + a @ b
    if w < 1e-9:  # opposite: a rotation by 180 degrees about any normal direction
        axis = np.cross(a, np.eye(3)[np.abs(a).argmin()])
        return np.append(axis / np.linalg.norm(axis), 0.0)
    q = np.append(np.cross(a, b), w)
    return np.asarray(q / np.linalg.norm(q))


def product(p: Array, q: Array) -> Array:
    """The rotation q, then p; (..., 4)."""
    u, v = p[..., :3], q[..., :3]
    vector = p[..., 3:] * v + q[..., 3:] * u + np.cross(u, v)
    return np.concatenate([vector, p[..., 3:] * q[..., 3:] - np.sum(u * v, axis=-1, keepdims=True)], axis=-1)


def rotated(q: Array, vectors: Array) -> Array:
    """Vectors (n, 3) after the rotations q (n, 4): v + 2 u x (u x v + w v)."""
    u, w = q[:, :3], q[:, 3:]
    return np.asarray(vectors + 2 * np.cross(u, np.cross(u, vectors) + w * vectors))


def along(directions: Array) -> Array:
    """Quaternions (n, 4) that rotate z to each of the directions (n, 3), without rotation about the directions from one to the next."""
    result = np.empty((len(directions), 4))
    q, before = np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])
    for i, direction in enumerate(directions):
        q = product(shortest(before, direction), q)
        result[i], before = q / np.linalg.norm(q), direction
    return result


def rotation_to(direction: Array) -> Array:
    """The matrix (3, 3) of the smallest rotation that takes z to a direction."""
    x, y, z, w = shortest(np.array([0.0, 0.0, 1.0]), direction)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + 2 * w * skew + 2 * skew @ skew)


#: A motion takes so many seconds on screen, and has so many frames.
PERIOD, FRAMES = 2.0, 33
#: The largest motion of a point, as a share of the mechanism's extent, and of a coordinate, rad or m.
_REACH, _LARGEST = 0.08, 0.5
#: The step, rad and m, of the differences that show how far points move.
_STEP = 1e-4


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A motion by a name that no other has: ``facts`` to read beside it, and the ``poses`` of all bodies over `motion_times`."""

    name: str
    facts: Sequence[tuple[str, str]]
    poses: Mapping[str, BodyPose]


def motion_times() -> Array:
    """The times of a motion's frames, s."""
    return np.linspace(0.0, PERIOD, FRAMES)


@dataclass(frozen=True, kw_only=True)
class Mover:
    """Moves a model in a scene with ``parameters`` (SI units) changed, at a ``time`` (s) of its guides."""

    model: Model
    scene: Scene
    parameters: Mapping[str, float]
    time: float = 0.0

    @cached_property
    def equations(self) -> RecursiveEquations:
        """The recursive equations with the values of the parameters as their defaults."""
        scene, inputs = self.with_constants
        equations, values = formulate_recursive(build_topology(self.model), scene, ()), parameter_values(self.model, inputs)
        return replace(equations, parameters=tuple(replace(p, value=values[p.name]) for p in equations.parameters))

    @cached_property
    def with_constants(self) -> tuple[Scene, dict[str, float]]:
        """The scene with inputs that are given as constants, and the parameters."""
        return with_constant_inputs(self.model, self.scene, self.parameters)

    def poses(self, q: Array) -> Mapping[str, BodyPose]:
        """The poses of all bodies at coordinates (rows, coordinates)."""
        scene, parameters = self.with_constants
        equations = derive_poses(self.equations.topology, scene)
        return find_poses(equations, np.full(len(q), self.time), q, parameter_values(self.model, parameters))

    def swing(self, q: Array, shape: Complex) -> Mapping[str, BodyPose]:
        """The poses over a period of a small motion about coordinates ``q``: ``shape`` (speeds,) has amplitudes and phases."""
        phases = np.exp(2j * np.pi * motion_times() / PERIOD)
        steps = self._amplitude(q, shape) * np.real(np.outer(phases, shape))
        return self.poses(np.array([self.closed(retract(self.equations, q, step), step) for step in steps]))

    def closed(self, q: Array, across: Array) -> Array:
        """Coordinates near q that close the loops, normal to a direction (speeds,) if given; q itself if there are none nearby."""
        size = float(np.abs(across).max(initial=0.0))
        found = close_loops(self.equations, q, across=across / size if size > _STEP else None, t=self.time)
        return q if found is None or np.abs(found[0] - q).max(initial=0.0) > _LARGEST else found[0]

    def _amplitude(self, q: Array, shape: Complex) -> float:
        """An amplitude at which the motion is visible and still nearly linear."""
        largest = float(np.abs(shape).max())
        step = _STEP / largest
        rows = [q, *(retract(self.equations, q, step * part) for part in (shape.real, shape.imag))]
        poses = self.poses(np.array(rows))
        numbers = Evaluator(self.model, parameter_values(self.model, self.parameters))
        points = [*attached_points(self.model, self.scene), *((b.name, b.centre_of_mass) for b in self.model.bodies)]
        ways = [poses[body].place(point_of(numbers, point)) for body, point in points if body != GROUND]
        moved = max((float(np.hypot(*np.linalg.norm(way[1:] - way[0], axis=1))) for way in ways), default=0.0)
        extent = find_sizes(self.model, self.scene, numbers).extent
        return min(_LARGEST / largest, _REACH * extent * step / moved if moved > 0 else np.inf)
