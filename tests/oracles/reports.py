"""The reported quantities by the dense oracle's means, by element and quantity."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import sympy
from scipy.spatial.transform import Rotation

from cutjoint.model.records import AxialForce, BodyLoad, Bushing, JointForce, PointSpring, Reaction
from tests.oracles.dense import TINY, Array, DenseMechanism, Instant, Motion
from tests.oracles.joints import skew
from tests.oracles.reactions import wrench_on_follower

#: Step of the differences that give a law's tangents.
STEP = 1e-4


def reported(dense: DenseMechanism, at: Instant, vdot: Array, multipliers: Array) -> dict[tuple[str, str], float]:
    """All quantities of bodies, markers, tree joints, reactions, and forces but tyres; one that is off has a length and no force."""
    motion = dense.motion(at)
    values: dict[tuple[str, str], float] = {}
    for body in dense.model.bodies:
        values |= _point(motion, body.name, body.name, dense.vector(body.centre_of_mass), vdot)
        yaw, pitch, roll = Rotation.from_matrix(motion.R[body.name]).as_euler("ZYX")
        spin = zip(("wx", "wy", "wz"), motion.spin(body.name)[1], strict=True)
        values |= {(body.name, q): float(x) for q, x in (("yaw", yaw), ("pitch", pitch), ("roll", roll), *spin)}
    for marker in dense.model.markers:
        values |= _point(motion, marker.name, marker.body, dense.vector(marker.point), vdot)
    for reaction in dense.model.reactions:
        values |= _reaction(dense, at, motion, reaction, vdot, multipliers)
    for force in dense.model.forces:
        if isinstance(force, PointSpring | AxialForce | JointForce):
            zeros = () if force.active else ("force", "stiffness", "damping")
            values |= {(force.name, q): 0.0 if q in zeros else x for q, x in _law(dense, at, force)}
        elif isinstance(force, Bushing):
            values |= {(force.name, q): x for q, x in _bushing(dense, at, force)}
        elif isinstance(force, BodyLoad):
            values |= {(force.name, q): x for q, x in _load(dense, at, motion, force)}
    return values


def _point(motion: Motion, name: str, body: str, X: Array, vdot: Array) -> dict[tuple[str, str], float]:
    x, J, v, drift = motion.point(body, X)
    values = {"": x, "v": v, "a": J @ vdot + drift}
    return {(name, f"{kind}{axis}"): float(value[i]) for kind, value in values.items() for i, axis in enumerate("xyz")}


def _law(dense: DenseMechanism, at: Instant, force: PointSpring | AxialForce | JointForce) -> Iterator[tuple[str, float]]:
    """The law's value, its arguments, and its tangents by differences."""
    if isinstance(force, JointForce):
        x, i = dense.layout[force.joint], dense.coordinate(force)
        names, arguments = "position rate", (float(at.q[x.q + i]), float(at.v[x.v + i]))
    else:
        names = "length rate" if isinstance(force, PointSpring) else "travel rate"
        along = dense.length if isinstance(force, PointSpring) else dense.travel
        q, t = dense.along_path(at)
        here = along(force, dense.poses(q[0], t[0]))
        arguments = (float(here.real), float(here.imag / TINY))
        yield from zip(names.split(), arguments, strict=True)
    yield "force", dense.law(force.law, names, arguments, at.t)
    for tangent, i in (("stiffness", 0), ("damping", 1)):
        after, before = ([a + s * STEP * (j == i) for j, a in enumerate(arguments)] for s in (1, -1))
        slope = dense.law(force.law, names, tuple(after), at.t) - dense.law(force.law, names, tuple(before), at.t)
        yield tangent, slope / (2 * STEP)


def _bushing(dense: DenseMechanism, at: Instant, force: Bushing) -> Iterator[tuple[str, float]]:
    """Displacements, rotations and forces; a torque is the virtual power of a turn of the follower about an axis of the base."""
    poses, laws = dense.poses(at.q, at.t), dense.bushing_laws(force, at)
    for name, value in zip(("dx", "dy", "dz", "rx", "ry", "rz"), dense.bushing_place(force, poses), strict=True):
        yield name, float(value)
    for i, axis in enumerate("xyz"):
        yield f"F{axis}", laws[i]
        direction = poses[force.base][0] @ dense.vector(force.axes[i])
        turned = dense.bushing_place(force, poses, np.eye(3) + 1j * TINY * skew(direction)).imag / TINY
        yield f"M{axis}", float(laws[3:] @ turned[3:])


def _load(dense: DenseMechanism, at: Instant, motion: Motion, force: BodyLoad) -> Iterator[tuple[str, float]]:
    x, _, v, _ = motion.point(force.body, dense.vector(force.point or (sympy.Integer(0),) * 3))
    w = motion.spin(force.body)[1]
    v, w = (motion.R[force.body].T @ u if force.axes == "body" else u for u in (v, w))
    for axis, component in zip("xyz", force.components, strict=True):
        acts = at.motion if force.moving_only else 1.0
        yield f"{'M' if force.point is None else 'F'}{axis}", acts * dense.law(component, "x y z vx vy vz wx wy wz", (*x, *v, *w), at.t)


def _reaction(
    dense: DenseMechanism, at: Instant, motion: Motion, reaction: Reaction, vdot: Array, multipliers: Array
) -> dict[tuple[str, str], float]:  # fmt: skip
    """Components of the wrench on the follower."""
    joint = next(j for j in dense.model.joints if j.name == reaction.joint)
    wrench, R = wrench_on_follower(dense, at, motion, joint, vdot, multipliers), motion.R[reaction.body]
    if reaction.direction is None:
        components = zip(("Fx", "Fy", "Fz", "Mx", "My", "Mz"), np.kron(np.eye(2), R.T) @ wrench, strict=True)
        return {(reaction.name, q): float(x) for q, x in components}
    direction = R @ dense.vector(reaction.direction)
    return {(reaction.name, "force"): float(wrench[:3] @ direction), (reaction.name, "moment"): float(wrench[3:] @ direction)}
