"""The wrenches of joints by virtual power: of the multipliers of a cut joint, and of a tree joint that is released.

A released joint is a free one in its place.  The force on its own coordinates for the given motion, less the forces that act, is the
joint's reaction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import sympy
from scipy.spatial.transform import Rotation

from cutjoint.model.records import Joint, JointForce, JointKind
from cutjoint.topology.records import TreeJoint
from tests.oracles.dense import TINY, Array, DenseMechanism, Instant, Motion
from tests.oracles.joints import residual, skew


def wrench_on_follower(dense: DenseMechanism, at: Instant, motion: Motion, joint: Joint, vdot: Array, multipliers: Array) -> Array:
    """Force and moment of a joint on its follower, about the follower's point, in global axes, (6,)."""
    point = joint.at if joint.to is None else joint.to
    for tree in dense.topology.tree:
        if tree.joint.name == joint.name:
            centre = joint.at if tree.reversed else point
            force, moment = _released(dense, at, motion, tree, centre, vdot, multipliers)
            if tree.reversed:
                way = _place(dense, motion, joint.base, centre) - _place(dense, motion, joint.follower, point)
                force, moment = -force, -moment - np.cross(way, force)
            return np.concatenate([force, moment])
    rows = dense.equations[joint.name]
    pull = -multipliers[rows] @ dense.base_turn(at)[rows, rows]
    shifts = [(row[:3], row[3:]) for row in 1j * TINY * np.eye(6)]
    return np.array([pull @ moved_residual(dense, motion, joint, *shift).imag / TINY for shift in shifts])


def _place(dense: DenseMechanism, motion: Motion, body: str, point: tuple[object, ...]) -> Array:
    return motion.p[body] + motion.R[body] @ dense.vector(point)


def _released(
    dense: DenseMechanism, at: Instant, motion: Motion, tree: TreeJoint, centre: tuple[object, ...], vdot: Array, multipliers: Array
) -> tuple[Array, Array]:  # fmt: skip
    """Force and moment about ``centre`` on the outer body of a joint that a free one stands for."""
    free = replace(
        tree.joint, kind=JointKind.FREE, base=tree.parent, follower=tree.child, at=centre, to=None, axes=(), pitch=None, guide=None
    )
    swap = {tree.joint.name: replace(tree, joint=free, reversed=False)}
    model = replace(
        dense.model, joints=tuple(free if j.name == free.name else j for j in dense.model.joints),
        forces=tuple(f for f in dense.model.forces if not isinstance(f, JointForce) or f.joint != free.name),
        gears=tuple(g for g in dense.model.gears if free.name not in g.joints),
    )  # fmt: skip
    topology = replace(dense.topology, model=model, tree=tuple(swap.get(t.joint.name, t) for t in dense.topology.tree))
    values = {p.name: dense.number(p.symbol) for p in model.parameters if not sympy.sympify(dense._values[p.symbol]).free_symbols}
    other = DenseMechanism(topology, dense.scene, values, dense.roads)
    q, v, accelerations = np.zeros(other.nq), np.zeros(other.nv), np.zeros(other.nv)
    for name, x in other.layout.items():
        if name == free.name:
            q[x.q_slice], v[x.v_slice], accelerations[x.v_slice] = _relative(dense, motion, tree, centre, vdot)
        else:
            old = dense.layout[name]
            q[x.q_slice], v[x.v_slice], accelerations[x.v_slice] = at.q[old.q_slice], at.v[old.v_slice], vdot[old.v_slice]
    there = Instant(q=q, v=v, t=at.t, motion=at.motion)
    moved = other.motion(there)
    M, bias = other.inertia(moved)
    rows = [i for name, s in dense.equations.items() if name in other.equations for i in range(s.start, s.stop)]
    needed = M @ accelerations + bias - other.applied(there, moved) + other.closures(there).jacobian.T @ multipliers[rows]
    own = motion.R[tree.parent] @ needed[other.layout[free.name].v_slice].reshape(2, 3).T
    return own[:, 0], own[:, 1]


def _relative(
    dense: DenseMechanism, motion: Motion, tree: TreeJoint, centre: tuple[object, ...], vdot: Array
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Coordinates, speeds and accelerations of the outer body's point seen from the inner body, as a free joint has them."""
    X = dense.vector(centre)
    (x, x_v, v, a), (p, p_v, p_t, p_tt) = (motion.point(body, X) for body in (tree.child, tree.parent))
    a, p_tt = a + x_v @ vdot, p_tt + p_v @ vdot
    (W, w, wd), (U, u, ud) = (motion.spin(body) for body in (tree.child, tree.parent))
    wd, ud = wd + W @ vdot, ud + U @ vdot
    R, way = motion.R[tree.parent], x - p
    speed = v - p_t - np.cross(u, way)
    bent = a - p_tt - np.cross(ud, way) - np.cross(u, v - p_t) - np.cross(u, speed)
    turn = np.roll(Rotation.from_matrix(R.T @ motion.R[tree.child]).as_quat(), 1)
    spun = wd - ud - np.cross(u, w - u)
    back = (np.concatenate([R.T @ first, R.T @ second]) for first, second in ((speed, w - u), (bent, spun)))
    return np.concatenate([R.T @ way, turn]), *back


def moved_residual(dense: DenseMechanism, motion: Motion, cut: Joint, shift: Array, turn: Array) -> Array:
    """The residual, in the base's axes, with the follower shifted, and turned about its point, in global axes."""
    at, axes, to, pitch = dense.geometry[cut.name]
    R_b, p_b, R_f, p_f = (m[b] for b in (cut.base, cut.follower) for m in (motion.R, motion.p))
    gap = R_b.T @ (p_f + shift + R_f @ (at if to is None else to) - p_b) - at
    return residual(cut.kind, axes, None if to is None else to - at, pitch, gap, R_b.T @ (np.eye(3) + skew(turn)) @ R_f)
