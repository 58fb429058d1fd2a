"""Energy and momentum of mechanisms that keep them, over a run by each method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import METHODS
from cutjoint.model.records import GROUND, Body, Joint, JointKind, Model, Output
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Array
from cutjoint.run.run_file import Evaluator
from cutjoint.run.simulation import simulate
from cutjoint_bench.errors import energies
from cutjoint_bench.records import Case

#: Quantities of the attitude and the rotation of a body.
_ROTATION = ("roll", "pitch", "yaw", "wx", "wy", "wz")


def conserves_energy(model: Model) -> bool:
    """True if nothing but weight acts: no force, no guide."""
    return not model.forces and all(joint.guide is None for joint in model.joints)


def vertical_axis(model: Model) -> tuple[float, float, float] | None:
    """The axis, along gravity, of the only joint to the ground: about it the momentum is kept.  None where there is no such joint."""
    grounded = [j for j in model.joints if GROUND in (j.base, j.follower)]
    if len(grounded) != 1 or grounded[0].kind is not JointKind.REVOLUTE or any(_pushes_off_ground(model)):
        return None
    return _parallel(model, grounded[0])


def _pushes_off_ground(model: Model) -> list[str]:
    return [f.name for f in model.forces if GROUND in (getattr(f, "base", ""), getattr(f, "follower", "")) or hasattr(f, "body")]


def _parallel(model: Model, joint: Joint) -> tuple[float, float, float] | None:
    value = Evaluator(model, {})
    axis, gravity = (np.array([value(x) for x in v], dtype=float) for v in (joint.axes[0], model.gravity))
    if np.abs(np.cross(axis, gravity)).max() > 1e-12:
        return None
    x, y, z = axis / np.linalg.norm(axis)
    return float(x), float(y), float(z)


def compile_for_drift(case: Case) -> Mapping[str, Artifact]:
    """Simulators by method, with what the momentum needs; none of a mechanism that keeps neither energy nor momentum."""
    if not conserves_energy(case.model) and vertical_axis(case.model) is None:
        return {}
    spans = [Output(element=b.name, quantity=q, span=b.span) for b in case.model.bodies if not b.is_massless for q in _ROTATION]
    return {m: compile_scene(case.model, case.scene, CompileOptions(method=m, outputs=(*case.outputs, *spans))) for m in METHODS}


def measure_drift(case: Case, artifacts: Mapping[str, Artifact], dt: float) -> dict[str, Any]:
    """The change of energy (relative to the largest kinetic energy) and of momentum (relative to its start) by method, over ``t`` in s.

    Runs are by the trapezoidal rule whatever the scene says; ``artifacts`` are those of `compile_for_drift`.
    """
    axis = vertical_axis(case.model)
    lines = [{"method": method, **_changes(case, artifact, dt, axis)} for method, artifact in artifacts.items()]
    return {"name": case.name, "dt": dt, "energy": conserves_energy(case.model), "momentum": axis is not None, "lines": lines}


def _changes(case: Case, artifact: Artifact, dt: float, axis: tuple[float, float, float] | None) -> dict[str, Any]:
    scene = replace(case.scene, output_step=max(case.scene.output_step, dt))
    run = simulate(
        replace(artifact, scene=scene), dt=dt, parameters=case.parameters, integrator="trapezoidal", events="crossed", check=False
    )
    kinetic, weight = energies(case, run.columns)
    kinetic = kinetic + _spin_energy(case, run.columns)
    energy = kinetic + weight
    size = float(np.abs(kinetic).max())
    changes: dict[str, Any] = {"t": run.t.tolist(), "failure": str(run.failure or "")}
    if conserves_energy(case.model):
        changes["energy"] = ((energy - energy[0]) / size).tolist()
    if axis is not None:
        momentum = _momentum(case, run.columns, np.array(axis))
        changes["momentum"] = ((momentum - momentum[0]) / abs(momentum[0])).tolist()
    return changes


def _spin_energy(case: Case, columns: Mapping[str, Array]) -> Array:
    parts = [0.5 * np.einsum("ti,tij,tj->t", w, J, w) for w, J in (_spin(case, b, columns) for b in _heavy(case))]
    return np.asarray(sum(parts))


def _momentum(case: Case, columns: Mapping[str, Array], axis: Array) -> Array:
    """Of all bodies about the axis through the origin, kg m2/s."""
    value = Evaluator(case.model, case.parameters)
    total = np.zeros(len(next(iter(columns.values()))))
    for body in _heavy(case):
        w, J = _spin(case, body, columns)
        place, speed = (np.stack([columns[f"{body.name}.{x}"] for x in names], axis=-1) for names in (("x", "y", "z"), ("vx", "vy", "vz")))
        total = total + (value(body.mass) * np.cross(place, speed) + np.einsum("tij,tj->ti", J, w)) @ axis
    return total


def _heavy(case: Case) -> list[Body]:
    return [b for b in case.model.bodies if not b.is_massless]


def _spin(case: Case, body: Body, columns: Mapping[str, Array]) -> tuple[Array, Array]:
    """Angular velocity (rows, 3) and inertia (rows, 3, 3) in global axes; attitude is R_z(yaw) R_y(pitch) R_x(roll)."""
    value = Evaluator(case.model, case.parameters)
    xx, yy, zz, xy, xz, yz = (value(x) for x in body.inertia)
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    roll, pitch, yaw = (columns[f"{body.name}.{name}"] for name in _ROTATION[:3])
    R = _turn(yaw, 2) @ _turn(pitch, 1) @ _turn(roll, 0)
    w = np.stack([columns[f"{body.name}.{name}"] for name in _ROTATION[3:]], axis=-1)
    return w, R @ J @ R.swapaxes(-1, -2)


def _turn(angle: Array, axis: int) -> Array:
    """Rotation matrices (rows, 3, 3) about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.tile(np.eye(3), (len(angle), 1, 1))
    R[:, i, i] = R[:, j, j] = np.cos(angle)
    R[:, j, i] = np.sin(angle)
    R[:, i, j] = -np.sin(angle)
    return R
