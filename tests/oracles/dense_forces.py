"""The forces of the dense reference, by the virtual power of the lengths and places that they work on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from cutjoint.model.records import COORDINATES, AxialForce, BallSpring, BodyLoad, Bushing, Contact, JointForce, PointSpring, Tyre, Wheel
from tests.oracles.joints import apply
from tests.oracles.tyre import Flat, road_normal, tyre_contact, wheel_distance

if TYPE_CHECKING:
    from tests.oracles.dense import Instant, Motion

#: Imaginary step of the complex-step derivative: its square is lost against one.
TINY = 1e-30

Array = np.ndarray
Poses = Mapping[str, tuple[Array, Array]]


class DenseForces:
    """The forces of a `DenseMechanism`, which has the numbers, poses and motions that they ask for."""

    def applied(self, at: Instant, motion: Motion) -> Array:
        """The generalised forces of all elements that the scene has switched on, (nv)."""
        Q = np.zeros(self.nv)
        for force in self.model.forces:
            if not self.scene.switches.get(force.name, force.active):
                continue
            if isinstance(force, PointSpring | AxialForce):
                Q += self._pair(force, at)
            elif isinstance(force, Bushing):
                Q += self._bushing(force, at)
            elif isinstance(force, BodyLoad):
                Q += self._load(force, at, motion)
            elif isinstance(force, JointForce):
                Q += self._joint_force(force, at)
            elif isinstance(force, BallSpring):
                Q += self._ball_spring(force, motion)
            elif isinstance(force, Contact):
                Q += self._contact(force, at, motion)
            elif isinstance(force, Wheel):
                Q += self._wheel(force, at, motion)
            else:
                Q += self._tyre(force, motion)
        return Q

    def _joint_force(self, force: JointForce, at: Instant) -> Array:
        """A force on one coordinate, which alone is its virtual displacement."""
        Q, i = np.zeros(self.nv), self.coordinate(force)
        if force.joint in self.layout:
            x = self.layout[force.joint]
            Q[x.v + i] = self.law(force.law, "position rate", (at.q[x.q + i], at.v[x.v + i]), at.t)
        return Q

    def coordinate(self, force: JointForce) -> int:
        """The place of a joint force's coordinate among those of its joint."""
        kind = next(j.kind for j in self.model.joints if j.name == force.joint)
        return COORDINATES[kind].index(force.coordinate)

    def _pair(self, force: PointSpring | AxialForce, at: Instant) -> Array:
        """A force between two bodies: its virtual power is that of its length (tension) or of its travel (push)."""
        along = self.length if isinstance(force, PointSpring) else self.travel
        here = along(force, self.poses(at.q, at.t))
        by_v = along(force, self.poses(*self.along_coordinates(at))).imag / TINY
        q, t = self.along_path(at)
        rate = along(force, self.poses(q[0], t[0])).imag / TINY
        if isinstance(force, PointSpring):
            return -self.law(force.law, "length rate", (float(here), float(rate)), at.t) * by_v
        return self.law(force.law, "travel rate", (float(here), float(rate)), at.t) * by_v

    def _bushing(self, force: Bushing, at: Instant) -> Array:
        """The virtual power of the six laws on their displacements and rotations."""
        columns = self.bushing_place(force, self.poses(*self.along_coordinates(at))).imag / TINY
        return self.bushing_laws(force, at) @ columns.T

    def bushing_laws(self, force: Bushing, at: Instant) -> Array:
        """The values of a bushing's six laws."""
        here, rate = self.bushing_place(force, self.poses(at.q, at.t)), self.bushing_rate(force, at)
        laws = zip(force.laws, here, rate, strict=True)
        return np.array([self.law(law, "position rate", (float(x), float(v)), at.t) for law, x, v in laws])

    def bushing_rate(self, force: Bushing, at: Instant) -> Array:
        """The rates of a bushing's displacements and rotations."""
        q, t = self.along_path(at)
        return self.bushing_place(force, self.poses(q[0], t[0])).imag / TINY

    def bushing_place(self, force: Bushing, poses: Poses, turn: Array | None = None) -> Array:
        """Displacement and sine-like rotation of a bushing in its axes, batched (..., 6); ``turn`` rotates the follower on."""
        axes = np.column_stack([self.vector(axis) for axis in force.axes])
        E, G = poses[force.base][0] @ axes, poses[force.follower][0] @ axes
        way = self._place(poses, force.follower, force.point) - self._place(poses, force.base, force.point)
        G = G if turn is None else turn @ G
        twist = sum(np.cross(E[..., :, k], G[..., :, k]) for k in range(3)) / 2
        back = np.swapaxes(E, -1, -2)
        return np.concatenate([apply(back, way), apply(back, twist)], axis=-1)

    def length(self, force: PointSpring, poses: Poses) -> Array:
        """The length of a spring, batched."""
        way = self._place(poses, force.follower, force.end) - self._place(poses, force.base, force.start)
        return np.sqrt((way * way).sum(axis=-1))

    def travel(self, force: AxialForce, poses: Poses) -> Array:
        """The travel of an axial force, batched."""
        way = self._place(poses, force.follower, force.point) - self._place(poses, force.base, force.origin)
        return (apply(poses[force.base][0], self.vector(force.axis)) * way).sum(axis=-1)

    def _place(self, poses: Poses, body: str, point: tuple[object, ...]) -> Array:
        R, p = poses[body]
        return p + apply(R, self.vector(point))

    def _load(self, force: BodyLoad, at: Instant, motion: Motion) -> Array:
        R = motion.R[force.body]
        x, J, v, _ = motion.point(force.body, self.vector(force.point or (0, 0, 0)))
        v = R.T @ v if force.axes == "body" else v
        w = R.T @ motion.spin(force.body)[1] if force.axes == "body" else motion.spin(force.body)[1]
        components = np.array([self.law(c, "x y z vx vy vz wx wy wz", (*x, *v, *w), at.t) for c in force.components])
        components *= at.motion if force.moving_only else 1
        vector = R @ components if force.axes == "body" else components
        return vector @ (J if force.point is not None else motion.spin(force.body)[0])

    def _ball_spring(self, spring: BallSpring, motion: Motion) -> Array:
        """The virtual power of a torque by the logarithm of the rotation from rest."""
        base, follower = motion.R[spring.base], motion.R[spring.follower]
        rest = np.column_stack([self.vector(axis) for axis in spring.axes])
        turned = Rotation.from_matrix(rest.T @ base.T @ follower).as_rotvec()
        (J, w), (J_base, w_base) = (motion.spin(body)[:2] for body in (spring.follower, spring.base))
        torque = -self.number(spring.stiffness) * (follower @ turned) - self.number(spring.damping) * (w - w_base)
        return torque @ (J - J_base)

    def _tyre(self, tyre: Tyre, motion: Motion) -> Array:
        """The virtual power of the road's force at the contact point, and of the aligning moment."""
        c = {name: self.number(value) for name, value in tyre.constants.items()}
        centre = self.vector(tyre.centre)
        place, _, velocity, _ = motion.point(tyre.body, centre)
        axis = motion.R[tyre.body] @ self.vector(tyre.axis)
        road = self.roads.get(tyre.name, Flat())
        contact, force, moment = tyre_contact(c, place, velocity, axis, road)
        R, p = motion.R[tyre.body], motion.p[tyre.body]
        _, J, _, _ = motion.point(tyre.body, R.T @ (contact - p))
        turning, omega = motion.spin(tyre.body)[:2]
        rolling = velocity @ np.cross(axis, road_normal(place, road)) / np.linalg.norm(np.cross(axis, road_normal(place, road)))
        gyroscopic = -np.cross(omega, c["spin_inertia"] * rolling / c["radius"] * axis)
        return force @ J + (moment + gyroscopic) @ turning

    def _contact(self, contact: Contact, at: Instant, motion: Motion) -> Array:
        """The virtual power of the force on the materials of both bodies at the contact; rates are those of material points there."""
        (c, _, _, _), (start, _, _, _) = (
            motion.point(body, self.vector(X)) for body, X in ((contact.follower, contact.centre), (contact.base, contact.start))
        )  # fmt: skip
        axis, way, radius = motion.R[contact.base] @ self.vector(contact.along), c - start, self.number(contact.ball)
        if contact.normal is None:
            across = np.cross(np.cross(axis, way), axis)
            sign = -1 if contact.inside else 1
            n = sign * across / np.linalg.norm(across)
            depth = radius - sign * (np.linalg.norm(across) - self.number(contact.cylinder))
        else:
            n = motion.R[contact.base] @ self.vector(contact.normal)
            depth = radius - n @ way
        place = c - (radius - depth) * n
        (J, v), (J_base, v_base) = (
            motion.point(body, motion.R[body].T @ (place - motion.p[body]))[1:3] for body in (contact.follower, contact.base)
        )
        left, slide = np.cross(n, axis), v - v_base
        spin = n @ (motion.spin(contact.follower)[1] - motion.spin(contact.base)[1])
        values = {"deflection": depth, "deflection_rate": -n @ slide, "vx": axis @ slide, "vy": left @ slide, "turn": spin}
        laws = (self.law(c, " ".join(values), tuple(map(float, values.values())), at.t) for c in contact.force)
        force: Array = sum(law * e for law, e in zip(laws, (axis, left, n), strict=True))
        return force @ (J - J_base) * (depth > 0)

    def _wheel(self, wheel: Wheel, at: Instant, motion: Motion) -> Array:
        """The virtual power of the road's force on the material point at the contact, and of its moment."""
        turning, omega = motion.spin(wheel.body)[:2]
        place, _, velocity, _ = motion.point(wheel.body, self.vector(wheel.centre))
        axis = motion.R[wheel.body] @ self.vector(wheel.axis)
        road = self.roads.get(wheel.name, Flat())
        n, radius = road_normal(place, road), self.number(wheel.free_radius)
        distance = wheel_distance(place, axis, road)
        step = 1e-6
        later = [wheel_distance(place + h * velocity, axis + h * np.cross(omega, axis), road) for h in (step, -step)]
        ahead = np.cross(axis, n) / np.linalg.norm(np.cross(axis, n))
        left, up = np.cross(n, ahead), np.cross(ahead, axis)
        contact = place - distance * up
        _, J, material, _ = motion.point(wheel.body, motion.R[wheel.body].T @ (contact - motion.p[wheel.body]))
        spin = omega @ axis
        values = {
            "deflection": radius - distance, "deflection_rate": (later[1] - later[0]) / (2 * step), "loaded_radius": distance,
            "vx": velocity @ ahead, "vy": material @ left, "spin": spin, "camber": np.arcsin(n @ axis), "turn": n @ (omega - spin * axis),
        }  # fmt: skip
        names = " ".join(values)
        force, moment = (
            sum(self.law(c, names, tuple(values.values()), at.t) * e for c, e in zip(parts, (ahead, left, n), strict=True))
            for parts in (wheel.force, wheel.moment)
        )
        return (force @ J + moment @ turning) * (values["deflection"] > 0)
