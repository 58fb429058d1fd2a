"""Runs by the recursive method that passes evaluate, and relative motions of bodies in them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import DEFAULT_METHOD, METHODS
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.quantities import POSE
from cutjoint.model.records import GROUND, Model, Output, Scene, Vector
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.toolchain.compiler import must_interpret

#: For `compiling_seconds` (s): a constant, the time per operation, and the factor of a system with a factorisation.
_COMPILING, _COMPILING_AN_OPERATION, _WITH_FACTORISATION = 1.0, 1.5e-4, 2

#: Seconds that an interpreted operation takes, in all evaluations of a step, and of steps that are halved twice.
_INTERPRETING = 0.4e-9 * 5 * (1 + 2 + 4)


def run_scene(model: Model, scene: Scene, outputs: Sequence[Output] | None = None) -> Trajectory:
    """A scene's run, which may have failed, with ``outputs`` instead of the scene's; interpreted where that takes less than compiling.
    Raises ModelError, EquationsError, RunError, SimulatorError: the scene cannot be run; ToolchainError: the C++ side failed."""
    artifact = compile_interpreted(model, scene, outputs=outputs)
    operations = artifact.compilation.operations
    steps = scene.end / scene.numerics.of_method(DEFAULT_METHOD).step
    if _INTERPRETING * steps * operations > compiling_seconds(operations, DEFAULT_METHOD):
        artifact = compile_scene(model, scene, CompileOptions(outputs=outputs))
    return simulate(artifact, check=False)


def compiling_seconds(operations: int, method: str) -> float:
    """Estimated time (s) to compile a model with so many operations per evaluation; infinite without a compiler."""
    if must_interpret():
        return inf
    return _COMPILING + _COMPILING_AN_OPERATION * operations * (_WITH_FACTORISATION if METHODS[method].has_system else 1)


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Poses of a body at the samples of a run: rotations ``R`` (n, 3, 3), positions ``r`` (n, 3) of its origin, global axes."""

    R: NDArray[np.float64]
    r: NDArray[np.float64]

    def seen_from(self, other: "Poses") -> "Poses":
        """The poses relative to another body."""
        back = other.R.transpose(0, 2, 1)
        return Poses(R=back @ self.R, r=np.einsum("nij,nj->ni", back, self.r - other.r))

    def change(self, point: NDArray[np.float64]) -> float:
        """The largest change of a pose from the first: the rotation angle in rad, or the displacement of a point of the body in m."""
        turned = self.R @ self.R[0].T
        sines = np.stack([turned[:, i, j] - turned[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1) / 2
        cosine = (np.trace(turned, axis1=1, axis2=2) - 1) / 2
        angle = np.arctan2(np.linalg.norm(sines, axis=1), cosine)
        way = (self.r + self.R @ point) - (self.r[0] + self.R[0] @ point)
        return float(max(np.abs(angle).max(), np.linalg.norm(way, axis=1).max()))


def numbers(vector: Vector | Iterable[object], model: Model) -> NDArray[np.float64]:
    """A vector at the parameters' values."""
    values = {p.symbol: p.value for p in model.parameters}
    return np.array([evaluate(component, values) for component in vector])


def find_poses(model: Model, scene: Scene) -> Mapping[str, Poses] | None:
    """The poses of all bodies and the ground in the scene; None where its run does not come to the end.
    Raises ModelError, TopologyError, RunError, SimulatorError: the scene cannot be run."""
    asked = [Output(element=body.name, quantity=name, span=body.span) for body in model.bodies for name in POSE]
    run = run_scene(model, scene, asked)
    if run.failure is not None:
        return None
    rows = len(run.t)
    ground = Poses(R=np.tile(np.eye(3), (rows, 1, 1)), r=np.zeros((rows, 3)))
    return {GROUND: ground, **{b.name: _poses(run, b.name, numbers(b.centre_of_mass, model)) for b in model.bodies}}


def _poses(run: Trajectory, body: str, centre: NDArray[np.float64]) -> Poses:
    place = np.stack([run[f"{body}.{name}"] for name in "xyz"], axis=1)
    x, y, z = (_rotation_matrix(run[f"{body}.{name}"], axis) for axis, name in enumerate(("roll", "pitch", "yaw")))
    R = z @ y @ x
    return Poses(R=R, r=place - R @ centre)


def _rotation_matrix(angle: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Rotations about a global axis, (n, 3, 3)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.tile(np.eye(3), (len(angle), 1, 1))
    R[:, i, i] = R[:, j, j] = np.cos(angle)
    R[:, j, i], R[:, i, j] = np.sin(angle), -np.sin(angle)
    return R
