"""A tree model in Pinocchio: joints, inertias, gravity, joint forces and wrenches; its articulated-body algorithm's accelerations.

Pinocchio has a spherical joint's and a free flyer's velocity in the outer body's axes (ours: the inner body's), a quaternion with
the scalar last (ours: first), and a planar joint in the plane z = 0 of its frame, whose velocity is in the outer body's axes too.
Joints that it lacks are composites of those that it has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cutjoint.model.records import GROUND, JointKind
from cutjoint.topology.records import TreeJoint
from tests.oracles.dense import Array, DenseMechanism, Instant
from tests.oracles.joints import rotation_of, tangents

K = JointKind
STILL = pin.SE3.Identity()


@dataclass(frozen=True)
class Part:
    """An elementary joint of a chain: ``model``, ``placement``, how coordinates and speeds map, and where they stand in ours."""

    model: object
    placement: object
    kind: str
    at: int = 0


class PinocchioTree:
    """The tree of a mechanism without cut joints and guides; ``dense`` gives the numbers of the model and the layout of q and v."""

    def __init__(self, dense: DenseMechanism) -> None:
        self._dense = dense
        self.model = pin.Model()
        self.model.gravity.linear = dense.vector(dense.model.gravity)
        self._frames = {GROUND: STILL}
        self._joints = {GROUND: 0}
        self._parts: dict[str, list[Part]] = {}
        bodies = {b.name: b for b in dense.model.bodies}
        for tree_joint in dense.topology.tree:
            self._add(tree_joint)
            mass, centre, inertia = dense.inertia_of(bodies[tree_joint.child])
            frame = self._frames[tree_joint.child]
            R = frame.rotation.T
            body = pin.Inertia(mass, R @ (centre - frame.translation), R @ inertia @ R.T)
            self.model.appendBodyToJoint(self._joints[tree_joint.child], body, STILL)
        self.data = self.model.createData()

    def _add(self, tree_joint: TreeJoint) -> None:
        joint, parent = tree_joint.joint, tree_joint.parent
        if joint.kind is K.FIXED:
            self._frames[tree_joint.child], self._joints[tree_joint.child] = self._frames[parent], self._joints[parent]
            return
        number, to = self._dense.number, joint.to or joint.at
        inner, outer = self._dense.vector(joint.at), self._dense.vector(to)
        if tree_joint.reversed:
            inner, outer = outer, inner
        sign = -1 if tree_joint.reversed else 1
        axes = [sign * self._dense.vector(a) for a in joint.axes]
        turn, parts = chain(joint.kind, tree_joint.reversed, axes, outer - inner, number(joint.pitch or 0))
        placement = self._frames[parent].inverse() * pin.SE3(turn, inner)
        if len(parts) == 1:
            model = parts[0].model
        else:
            model = pin.JointModelComposite()
            for part in parts:
                model.addJoint(part.model, part.placement)
        self._frames[tree_joint.child] = pin.SE3(turn, outer)
        self._joints[tree_joint.child] = self.model.addJoint(self._joints[parent], model, placement, joint.name)
        self._parts[joint.name] = parts

    def coordinates(self, at: Instant) -> tuple[Array, Array]:
        """Pinocchio's q and v."""
        q, v = [], []
        for name, parts in self._parts.items():
            x = self._dense.layout[name]
            ours_q, ours_v = at.q[x.q_slice], at.v[x.v_slice]
            for part in parts:
                values = to_pinocchio(part, ours_q, ours_v)
                q.append(values[0])
                v.append(values[1])
        return np.concatenate(q), np.concatenate(v)

    def accelerations(self, at: Instant, joint_forces: Array, wrenches: dict[str, tuple[Array, Array, Array]]) -> Array:
        """Our vdot.

        ``joint_forces`` are generalised forces on our speeds; a wrench is a point, a force at it and a torque, in axes that the body
        carries.
        """
        q, v = self.coordinates(at)
        pin.forwardKinematics(self.model, self.data, q)
        external = pin.StdVec_Force()
        external.extend([pin.Force.Zero() for _ in self.model.joints])
        for body, (point, force, torque) in wrenches.items():
            frame = self._frames[body]
            R, arm = frame.rotation.T, point - frame.translation
            wrench = pin.Force(R @ force, R @ (torque + np.cross(arm, force)))
            external[self._joints[body]] = external[self._joints[body]] + wrench
        tau = np.concatenate([
            to_pinocchio(part, at.q[x.q_slice], joint_forces[x.v_slice])[1]  # forces turn as speeds do
            for name, parts in self._parts.items() for x in [self._dense.layout[name]] for part in parts
        ])  # fmt: skip
        return self._ours(at, v, pin.aba(self.model, self.data, q, v, tau, external))

    def _ours(self, at: Instant, v: Array, a: Array) -> Array:
        vdot, first = np.full(self._dense.nv, np.nan), 0
        for name, parts in self._parts.items():
            x = self._dense.layout[name]
            for part in parts:
                last = first + part.model.nv
                own = slice(-3, None) if part.kind == "ball" else slice(part.at, part.at + part.model.nv)
                vdot[x.v_slice][own] = from_pinocchio(part, at.q[x.q_slice], v[first:last], a[first:last])
                first = last
        return vdot


def chain(kind: str, is_reversed: bool, axes: list[Array], rod: Array, pitch: float) -> tuple[Array, list[Part]]:
    """The attitude of a joint's frame in the design position, and the elementary joints."""
    upright = np.eye(3)
    match kind:
        case K.REVOLUTE:
            return upright, [_turn(axes[0], 0)]
        case K.PRISMATIC:
            return upright, [_slide(axes[0], 0)]
        case K.SCREW:
            return upright, [Part(pin.JointModelHelicalUnaligned(axes[0], pitch), STILL, "scalar")]
        case K.CYLINDRICAL:
            return upright, [_slide(axes[0], 0), _turn(axes[0], 1)]
        case K.UNIVERSAL:
            if is_reversed:
                return upright, [_turn(axes[1], 1), _turn(axes[0], 0)]
            return upright, [Part(pin.JointModelUniversal(*axes), STILL, "universal")]
        case K.PLANAR if is_reversed:
            first, second = tangents(-axes[0])
            return upright, [_turn(axes[0], 2), _slide(-first, 0), _slide(-second, 1)]
        case K.PLANAR:
            return np.column_stack([*tangents(axes[0]), axes[0]]), [Part(pin.JointModelPlanar(), STILL, "planar")]
        case K.SPHERICAL:
            return upright, [_ball()]
        case K.FREE:
            return upright, [Part(pin.JointModelFreeFlyer(), STILL, "free")]
        case K.POINT_ON_LINE:
            return upright, [_ball(), _slide(axes[0], 0)] if is_reversed else [_slide(axes[0], 0), _ball()]
        case "point_on_plane":
            slides = _slides(axes[0], is_reversed)
            return upright, [_ball(), *slides[::-1]] if is_reversed else [*slides, _ball()]
        case "parallel_axes":
            parts = [*_slides(axes[0], is_reversed), _slide(axes[0], 2), _turn(axes[0], 3)]
            return upright, parts[::-1] if is_reversed else parts
        case K.DISTANCE:
            return upright, [_ball(), Part(pin.JointModelUniversal(*tangents(rod)), pin.SE3(upright, rod), "universal")]
    raise AssertionError(kind)


def _slides(axis: Array, is_reversed: bool) -> list[Part]:
    """The two slides across an axis, which is the opposite of the joint's where that is reversed."""
    sign = -1 if is_reversed else 1
    return [_slide(sign * direction, i) for i, direction in enumerate(tangents(sign * axis))]


def _slide(axis: Array, at: int) -> Part:
    return Part(pin.JointModelPrismaticUnaligned(axis), STILL, "scalar", at)


def _turn(axis: Array, at: int) -> Part:
    return Part(pin.JointModelRevoluteUnaligned(axis), STILL, "scalar", at)


def _ball() -> Part:
    return Part(pin.JointModelSpherical(), STILL, "ball")


def to_pinocchio(part: Part, q: Array, v: Array) -> tuple[Array, Array]:
    """Coordinates and speeds of one elementary joint."""
    if part.kind in ("scalar", "universal"):
        own = slice(part.at, part.at + part.model.nv)
        return q[own], v[own]
    if part.kind == "planar":
        c, s = np.cos(q[2]), np.sin(q[2])
        return np.array([q[0], q[1], c, s]), np.array([c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]])
    R, quaternion = rotation_of(q[-4:]), np.roll(q[-4:], -1)
    if part.kind == "ball":
        return quaternion, R.T @ v[-3:]
    return np.concatenate([q[:3], quaternion]), np.concatenate([R.T @ v[:3], R.T @ v[3:]])


def from_pinocchio(part: Part, q: Array, v: Array, a: Array) -> Array:
    """Our accelerations of one elementary joint, from Pinocchio's speeds and accelerations."""
    if part.kind in ("scalar", "universal"):
        return a
    if part.kind == "planar":
        c, s = np.cos(q[2]), np.sin(q[2])
        carried = a[:2] + v[2] * np.array([-v[1], v[0]])
        return np.array([c * carried[0] - s * carried[1], s * carried[0] + c * carried[1], a[2]])
    R = rotation_of(q[-4:])
    if part.kind == "ball":
        return R @ a
    return np.concatenate([R @ (a[:3] + np.cross(v[3:], v[:3])), R @ a[3:]])
