"""Accelerations of a URDF file by Pinocchio, which reads it itself: bodies' poses and velocities in, accelerations of their centres out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin


class PinocchioRobot:
    """A URDF file with hinges, and loops as pairs of frames: link, its pose there (4 by 4), of two links each, with 3 or 6 equations.

    The state is that of the links: by their names a rotation (3 by 3), and an angular velocity (3), both global.
    """

    def __init__(self, path: Path, loops: list[tuple[str, Any, str, Any, int]], couplings: Mapping[str, tuple[str, float]]) -> None:
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self._loops = [self._loop(*loop) for loop in loops]
        self._couplings = couplings

    def _frame(self, link: str) -> Any:
        return self.model.frames[self.model.getBodyId(link)]

    def _loop(self, first: str, at: Any, second: str, there: Any, size: int) -> Any:
        ends = ((self._frame(first), at), (self._frame(second), there))
        return [(frame.parentJoint, np.asarray((frame.placement * pin.SE3(place)).translation)) for frame, place in ends], size

    def _differences(self, loop: Any) -> tuple[Any, Any]:
        """The Jacobian of the relative velocity of a loop's ends, global, and what of its acceleration follows from the speeds."""
        ends, size = loop
        rows, drifts = [], []
        for j, place in ends:
            rotation, velocity, spatial = self.data.oMi[j].rotation, self.data.v[j], self.data.a[j]
            J = pin.getJointJacobian(self.model, self.data, j, pin.LOCAL)
            linear, angular = rotation @ (J[:3] - pin.skew(place) @ J[3:]), rotation @ J[3:]
            point = velocity.linear + np.cross(velocity.angular, place)
            own = spatial.linear + np.cross(spatial.angular, place) + np.cross(velocity.angular, point)
            rows.append(np.vstack([linear, angular])[:size])
            drifts.append(np.concatenate([rotation @ own, rotation @ spatial.angular])[:size])
        return rows[0] - rows[1], drifts[0] - drifts[1]

    def coordinates(self, rotations: Mapping[str, Any], velocities: Mapping[str, Any]) -> tuple[Any, Any]:
        """The angles and rates of all hinges."""
        q, v = np.zeros(self.model.nq), np.zeros(self.model.nv)
        pin.forwardKinematics(self.model, self.data, pin.neutral(self.model))
        zero = {name: self.data.oMi[j].rotation.copy() for j, name in enumerate(self.model.names)}
        links = {f.parentJoint: f.name for f in self.model.frames if f.type == pin.FrameType.BODY and f.name in rotations}
        for j in range(1, self.model.njoints):
            joint, parent = self.model.joints[j], self.model.parents[j]
            here = rotations[links[j]] @ zero[self.model.names[j]]
            base = rotations[links[parent]] @ zero[self.model.names[parent]] if parent else np.eye(3)
            turned = self.model.jointPlacements[j].rotation.T @ base.T @ here
            angle = pin.log3(turned)
            axis = self._axis(j)
            at, speed = joint.idx_q, joint.idx_v
            theta = float(axis @ angle)
            if joint.nq == 2:
                q[at : at + 2] = np.cos(theta), np.sin(theta)
            else:
                q[at] = theta
            relative = velocities[links[j]] - (velocities[links[parent]] if parent else 0)
            v[speed] = float(axis @ (here.T @ relative))
        return q, v

    def _axis(self, j: int) -> Any:
        data = self.model.joints[j].createData()
        q = pin.neutral(self.model)[self.model.joints[j].idx_q : self.model.joints[j].idx_q + self.model.joints[j].nq]
        self.model.joints[j].calc(data, q)
        return np.ravel(data.S)[3:]

    def accelerations(self, q: Any, v: Any, tau: Any) -> dict[str, Any]:
        """The accelerations of the links' centres of mass, by the Gauss principle on mass matrix and Jacobians of the loops."""
        model, data = self.model, self.data
        pin.crba(model, data, q)
        M = np.triu(data.M) + np.triu(data.M, 1).T
        bias = pin.nonLinearEffects(model, data, q, v)
        pin.computeJointJacobians(model, data, q)
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        rows, drifts = [], []
        for loop in self._loops:
            row, drift = self._differences(loop)
            rows.append(row)
            drifts.append(drift)
        for follower, (leader, ratio) in self._couplings.items():
            row = np.zeros((1, model.nv))
            row[0, model.joints[model.getJointId(follower)].idx_v] = 1
            row[0, model.joints[model.getJointId(leader)].idx_v] = -ratio
            rows.append(row)
            drifts.append(np.zeros(1))
        J, drift = np.vstack(rows), np.concatenate(drifts)
        free = np.linalg.solve(M, tau - bias)
        S = J @ np.linalg.solve(M, J.T)
        multipliers = np.linalg.lstsq(S, -(drift + J @ free), rcond=1e-10)[0]
        a = free + np.linalg.solve(M, J.T @ multipliers)
        assert np.abs(J @ v).max() < 1e-6 * max(1.0, np.abs(v).max())
        pin.forwardKinematics(model, data, q, v, a)
        found = {}
        for frame in model.frames:
            if frame.type == pin.FrameType.BODY and frame.parentJoint:
                j = frame.parentJoint
                centre = model.inertias[j].lever
                spatial, velocity = data.a[j], data.v[j]
                point = velocity.linear + np.cross(velocity.angular, centre)
                own = spatial.linear + np.cross(spatial.angular, centre) + np.cross(velocity.angular, point)
                found[frame.name] = data.oMi[j].rotation @ own
        return found
