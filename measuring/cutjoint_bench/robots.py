"""A URDF file with loops by Pinocchio, which reads it itself: coordinates and rates of joints in; places, accelerations and energy out.

Loops and relations, which Pinocchio does not read, come from the file by the XML reader of Python: ``<loop>`` and ``<coupling>`` of URDF+,
``mimic``, and a YAML beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin  # type: ignore[import-untyped]
import yaml
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

#: Singular values of the constraints' Jacobian below this share of the largest are nothing.
_RANK = 1e-9


@dataclass(frozen=True)
class _End:
    """A frame of a loop: its joint, its place (3) and axes (3 by 3) in the frame of that."""

    joint: int
    place: Array
    axes: Array


@dataclass(frozen=True)
class _Loop:
    kind: str
    first: _End
    second: _End
    axis: Array


@dataclass(frozen=True)
class Solution:
    """Centres of mass (m) and their accelerations (m/s2) by links that have mass; the ``freedom`` of the motion.

    ``gap`` is the largest distance of a loop's points (m), ``slip`` the largest speed that breaks a constraint, ``energy`` the mechanical
    one and ``kinetic`` its part (J).  ``condition`` is the largest singular value of the constraints' Jacobian by the smallest that counts,
    ``light`` and ``heavy`` are the least and the largest eigenvalue of the free motions' mass matrix.
    """

    places: dict[str, Array]
    accelerations: dict[str, Array]
    freedom: int
    gap: float
    slip: float
    energy: float
    kinetic: float
    condition: float
    light: float
    heavy: float


class PinocchioRobot:
    """A URDF file of hinges and slides, with loops of kinds revolute, continuous, spherical and fixed."""

    def __init__(self, path: Path) -> None:
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        root = ElementTree.parse(path).getroot()
        self._carried = {joint.find("child").get("link"): joint for joint in root.findall("joint")}  # type: ignore[union-attr]
        inertials = {str(link.get("name")): link.find("inertial") for link in root.findall("link")}
        heavy = {link: node for link, node in inertials.items() if node is not None and float(node.find("mass").get("value", 0)) > 0}  # type: ignore[union-attr]
        self._centres = {link: _numbers(node.find("origin"), "xyz") for link, node in heavy.items()}
        self._loops = [self._loop(node) for node in root.findall("loop")]
        self._relations = [self._relation(node) for node in root.findall("coupling")]
        for joint in root.findall("joint"):
            mimic = joint.find("mimic")
            if mimic is not None and joint.get("type") != "fixed":
                ratio = float(mimic.get("multiplier", 1))
                self._relations.append({str(joint.get("name")): 1.0, str(mimic.get("joint")): -ratio})
        beside = path.with_suffix(".yaml")
        self._loops += list(self._beside(beside)) if beside.is_file() else []

    def _end(self, link: str, origin: ElementTree.Element | None) -> _End:
        frame = self.model.frames[self.model.getFrameId(link, pin.FrameType.BODY)]
        placed = frame.placement * pin.SE3(pin.rpy.rpyToMatrix(*_numbers(origin, "rpy")), _numbers(origin, "xyz"))
        return _End(frame.parentJoint, placed.translation.copy(), placed.rotation.copy())

    def _loop(self, node: ElementTree.Element) -> _Loop:
        ends = [node.find(end) for end in ("predecessor", "successor")]
        first, second = (self._end(str(end.get("link")), end.find("origin")) for end in ends if end is not None)
        axis = _numbers(node.find("axis"), "xyz", (1.0, 0.0, 0.0))
        return _Loop(node.get("type", "revolute").replace("continuous", "revolute"), first, second, axis / np.linalg.norm(axis))

    def _relation(self, node: ElementTree.Element) -> dict[str, float]:
        ends = [node.find(end) for end in ("predecessor", "successor")]
        first, second = (self._way(str(end.get("link"))) for end in ends if end is not None)
        ratio = float(node.find("ratio").get("value", 1))  # type: ignore[union-attr]
        return {**{j: ratio for j in first if j not in second}, **{j: -1.0 for j in second if j not in first}}

    def _way(self, link: str) -> list[str]:
        way = []
        while link in self._carried:
            joint = self._carried[link]
            way += [str(joint.get("name"))] if joint.get("type") != "fixed" else []
            link = str(joint.find("parent").get("link"))  # type: ignore[union-attr]
        return way

    def _beside(self, path: Path) -> list[_Loop]:
        data, children = yaml.safe_load(path.read_text()), {j.get("name"): link for link, j in self._carried.items()}
        kinds = data.get("type") or ["6d"] * len(data["closed_loop"])
        loops = []
        for kind, pair in zip(kinds, data["closed_loop"], strict=True):
            first, second = (self._end(str(children.get(name, name)), None) for name in pair)
            loops.append(_Loop("spherical" if kind.lower() == "3d" else "fixed", first, second, np.zeros(3)))
        return loops

    def state(self, coordinates: Mapping[str, tuple[float, float]]) -> tuple[Array, Array]:
        """The vectors q and v of Pinocchio's model from coordinates (rad, m) and rates by the file's joints."""
        q, v = pin.neutral(self.model), np.zeros(self.model.nv)
        for j, name in enumerate(self.model.names[1:], 1):
            joint, (x, rate) = self.model.joints[j], coordinates[name]
            q[joint.idx_q : joint.idx_q + joint.nq] = (np.cos(x), np.sin(x)) if joint.nq == 2 else x
            v[joint.idx_v] = rate
        return q, v

    def free_speeds(self, coordinates: Mapping[str, float]) -> Array:
        """The rates of joints that the constraints leave free at coordinates (rad, m), in the columns of a matrix, in Pinocchio's order."""
        q, v = self.state({name: (x, 0.0) for name, x in coordinates.items()})
        pin.computeJointJacobians(self.model, self.data, q)
        pin.forwardKinematics(self.model, self.data, q, v, v)
        _, s, w = np.linalg.svd(self._constraints()[0])
        return np.asarray(w[int((s > _RANK * s.max(initial=0.0)).sum()) :].T)

    def _constraints(self) -> tuple[Array, Array, float]:
        """The Jacobian of loops and relations, what their accelerations have without those of joints, and the largest gap."""
        rows, drifts, gap = [np.zeros((0, self.model.nv))], [np.zeros(0)], 0.0
        for loop in self._loops:
            (p1, J1, d1, w1, b1, R1), (p2, J2, d2, w2, b2, _) = map(self._motion, (loop.first, loop.second))
            gap = max(gap, float(np.linalg.norm(p1 - p2)))
            rows.append(J1[:3] - J2[:3])
            drifts.append(d1 - d2)
            if loop.kind in ("revolute", "fixed"):
                across = np.linalg.svd((R1 @ loop.axis)[np.newaxis])[2][1:] if loop.kind == "revolute" else np.eye(3)
                rows.append(across @ (J1[3:] - J2[3:]))
                turning = np.cross(w1, across) if loop.kind == "revolute" else np.zeros((3, 3))
                drifts.append(across @ (b1 - b2) + turning @ (w1 - w2))
        for relation in self._relations:
            row = np.zeros((1, self.model.nv))
            for name, factor in relation.items():
                row[0, self.model.joints[self.model.getJointId(name)].idx_v] += factor
            rows.append(row)
            drifts.append(np.zeros(1))
        return np.vstack(rows), np.concatenate(drifts), gap

    def _motion(self, end: _End) -> tuple[Array, ...]:
        """A frame's place, Jacobian (6 by nv), drift of its place, spin and drift of that, and axes, global."""
        data, j = self.data, end.joint
        R, velocity, spatial = data.oMi[j].rotation, data.v[j], data.a[j]
        J = pin.getJointJacobian(self.model, data, j, pin.LOCAL) if j else np.zeros((6, self.model.nv))
        point = velocity.linear + np.cross(velocity.angular, end.place)
        own = spatial.linear + np.cross(spatial.angular, end.place) + np.cross(velocity.angular, point)
        jacobian = np.vstack([R @ (J[:3] - pin.skew(end.place) @ J[3:]), R @ J[3:]])
        place = data.oMi[j].translation + R @ end.place
        return place, jacobian, R @ own, R @ velocity.angular, R @ spatial.angular, R @ end.axes

    def solve(self, q: Array, v: Array, tau: Array | float = 0.0) -> Solution:
        """The motion at a state that satisfies the constraints, with forces ``tau`` on the joints.

        The acceleration is a = a_p + N z: J a_p = -drift, J N = 0, and N^T (M a + bias - tau) = 0 gives z (the principle of Gauss).
        """
        model, data = self.model, self.data
        pin.crba(model, data, q)
        M = np.triu(data.M) + np.triu(data.M, 1).T
        bias = pin.nonLinearEffects(model, data, q, v)
        kinetic, potential = float(pin.computeKineticEnergy(model, data, q, v)), float(pin.computePotentialEnergy(model, data, q))
        pin.computeJointJacobians(model, data, q)
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        J, drift, gap = self._constraints()
        u, s, w = np.linalg.svd(J) if len(J) else (np.zeros((0, 0)), np.zeros(0), np.eye(model.nv))
        rank = int((s > _RANK * s.max(initial=0.0)).sum())
        particular = -w[:rank].T @ ((u[:, :rank].T @ drift) / s[:rank])
        N = w[rank:].T
        free = N.T @ M @ N
        a = particular + N @ np.linalg.solve(free, N.T @ (tau - bias - M @ particular))
        pin.forwardKinematics(model, data, q, v, a)
        places, accelerations = {}, {}
        for link, centre in self._centres.items():
            frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
            place, _, acceleration, *_ = self._motion(_End(frame.parentJoint, frame.placement.act(centre), np.eye(3)))
            places[link], accelerations[link] = place, acceleration
        slip, masses = float(np.abs(J @ v).max(initial=0.0)), np.linalg.eigvalsh(free)
        return Solution(
            places,
            accelerations,
            model.nv - rank,
            gap,
            slip,
            kinetic + potential,
            kinetic,
            s[0] / s[rank - 1] if rank else 1.0,
            float(masses[0]),
            float(masses[-1]),
        )


def _numbers(node: ElementTree.Element | None, name: str, default: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Array:
    text = node.get(name) if node is not None else None
    return np.array([float(word) for word in text.split()] if text else default)
