"""Force elements between rigid bodies as functions of their motions, in plain Python.

SI units, global axes.  Vectors are three numbers; a frame is three of them, where its axes point.  Arms are ways from a body's centre of
mass, arms and directions those of the start.  An element takes the motions of its bodies and the time, and returns a wrench for each.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from math import atan, atan2, cos, pi, remainder, sin, sqrt
from operator import attrgetter
from typing import NamedTuple

Vector = tuple[float, float, float]
Frame = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)
GLOBAL: Frame = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Motion(NamedTuple):
    """A body: the turn ``R`` since the start, its centre of mass ``p``, that point's velocity ``v``, its angular velocity ``w``."""

    R: Frame
    p: Vector
    v: Vector
    w: Vector


class Wrench(NamedTuple):
    """A force through the centre of mass and a torque."""

    force: Vector
    torque: Vector


#: The ground: arms on it are places.
STILL = Motion(GLOBAL, ZERO, ZERO, ZERO)

Law = Callable[[float, float, float], float]
Element = Callable[..., tuple[Wrench, ...]]


def add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def sub(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(s: float, a: Vector) -> Vector:
    return s * a[0], s * a[1], s * a[2]


def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def turn(R: Frame, a: Vector) -> Vector:
    """R a."""
    x, y, z = R
    return a[0] * x[0] + a[1] * y[0] + a[2] * z[0], a[0] * x[1] + a[1] * y[1] + a[2] * z[1], a[0] * x[2] + a[1] * y[2] + a[2] * z[2]


def along(R: Frame, a: Vector) -> Vector:
    """Components along the axes of a frame: R^T a."""
    return dot(R[0], a), dot(R[1], a), dot(R[2], a)


def carried(body: Motion, frame: Frame) -> Frame:
    """Axes that a body carries, as they point now."""
    return turn(body.R, frame[0]), turn(body.R, frame[1]), turn(body.R, frame[2])


def place(body: Motion, arm: Vector) -> tuple[Vector, Vector]:
    """Place and velocity of a point of a body."""
    here = turn(body.R, arm)
    return add(body.p, here), add(body.v, cross(body.w, here))


def push(body: Motion, at: Vector, force: Vector) -> Wrench:
    """A force at a place."""
    return Wrench(force, cross(sub(at, body.p), force))


def push_pair(base: Motion, follower: Motion, at: Vector, force: Vector) -> tuple[Wrench, Wrench]:
    """A force on the follower at a place and its reaction on the base there."""
    return push(base, at, scale(-1.0, force)), push(follower, at, force)


def twist_pair(torque: Vector) -> tuple[Wrench, Wrench]:
    """A torque on the follower and its reaction on the base."""
    return Wrench(ZERO, scale(-1.0, torque)), Wrench(ZERO, torque)


def sliding(origin: Vector, axis: Vector, point: Vector, law: Law, start: float = 0.0) -> Element:
    """A push law(travel, rate, t) on the follower's point along an axis of the base.

    The travel counts along the axis from the base's origin; it is ``start`` more.
    """

    def element(base: Motion, follower: Motion, t: float) -> tuple[Wrench, ...]:
        (foot, foot_rate), (tip, tip_rate) = place(base, origin), place(follower, point)
        e, way = turn(base.R, axis), sub(tip, foot)
        # the axis turns with the base: what of the way lies across it changes the travel too
        rate = dot(e, sub(tip_rate, foot_rate)) + dot(cross(base.w, e), way)
        return push_pair(base, follower, tip, scale(law(start + dot(e, way), rate, t), e))

    return element


def turning(axis: Vector, side: Vector, law: Law, start: float = 0.0, *, of_base: bool = True) -> Element:
    """A torque law(angle, rate, t) on the follower about an axis that the base carries, or the follower.

    The angle, ``start`` at first, is the turn of the follower's direction ``side`` across the axis from that of the base.  It goes on
    beyond a full turn.
    """
    last = 0.0

    def element(base: Motion, follower: Motion, t: float) -> tuple[Wrench, ...]:
        nonlocal last
        e = turn(base.R if of_base else follower.R, axis)
        last += remainder(_angle(e, turn(base.R, side), turn(follower.R, side)) - last, 2 * pi)
        return twist_pair(scale(law(start + last, dot(e, sub(follower.w, base.w)), t), e))

    return element


def _angle(axis: Vector, start: Vector, end: Vector) -> float:
    across = cross(axis, start)
    return atan2(dot(across, end), dot(cross(across, axis), end))


def bushing(on_base: Vector, base_axes: Frame, on_follower: Vector, follower_axes: Frame, laws: Sequence[Law]) -> Element:
    """Six springs along and about axes E of the base; G are the same axes as the follower carries them.

    The rotations are half the sum of e_k x g_k along E; the torque does the laws' work on them.
    """

    def element(base: Motion, follower: Motion, t: float) -> tuple[Wrench, ...]:
        (foot, foot_rate), (tip, tip_rate) = place(base, on_base), place(follower, on_follower)
        E, G, way, w = carried(base, base_axes), carried(follower, follower_axes), sub(tip, foot), sub(follower.w, base.w)
        turned = _half_sum(cross(e, g) for e, g in zip(E, G, strict=True))
        spinning = _half_sum(cross(e, cross(w, g)) for e, g in zip(E, G, strict=True))
        positions = (*along(E, way), *along(E, turned))
        rates = (*along(E, sub(sub(tip_rate, foot_rate), cross(base.w, way))), *along(E, spinning))
        values = [law(position, rate, t) for law, position, rate in zip(laws, positions, rates, strict=True)]
        m = turn(E, (values[3], values[4], values[5]))
        torque = _half_sum(cross(g, cross(m, e)) for e, g in zip(E, G, strict=True))
        pushes, twists = push_pair(base, follower, tip, turn(E, (values[0], values[1], values[2]))), twist_pair(torque)
        return tuple(Wrench(a.force, add(a.torque, b.torque)) for a, b in zip(pushes, twists, strict=True))

    return element


def _half_sum(vectors: Iterable[Vector]) -> Vector:
    x, y, z = (0.5 * sum(parts) for parts in zip(*vectors, strict=True))
    return x, y, z


def load(at: Vector, axes: Frame | None, law: Callable[..., Vector]) -> Element:
    """A force law(place, velocity, t) at a point, in global axes or in those that the body carries; the place is global."""

    def element(body: Motion, t: float) -> tuple[Wrench, ...]:
        here, velocity = place(body, at)
        if axes is None:
            return (push(body, here, law(*here, *velocity, t)),)
        E = carried(body, axes)
        return (push(body, here, turn(E, law(*here, *along(E, velocity), t))),)

    return element


def torque(axes: Frame | None, law: Callable[..., Vector]) -> Element:
    """A torque law(w, t) over the angular velocity, in global axes or in those that the body carries."""

    def element(body: Motion, t: float) -> tuple[Wrench, ...]:
        if axes is None:
            return (Wrench(ZERO, law(*body.w, t)),)
        E = carried(body, axes)
        return (Wrench(ZERO, turn(E, law(*along(E, body.w), t))),)

    return element


class Piece(NamedTuple):
    """A piece of a road from x = start on.
    "line" a + b (x - start); "arc" a + sqrt(b^2 - (x - c)^2); "cosine" a + b (1 - cos(c (x - start)))."""

    kind: str
    start: float
    a: float
    b: float
    c: float

    def at(self, x: float) -> tuple[float, float]:
        """Height and slope."""
        if self.kind == "arc":
            square = self.b * self.b - (x - self.c) ** 2
            return self.a + sqrt(max(square, 0.0)), (self.c - x) / sqrt(max(square, 1e-12))
        distance = x - self.start
        if self.kind == "cosine":
            return self.a + self.b * (1 - cos(self.c * distance)), self.b * self.c * sin(self.c * distance)
        return self.a + self.b * distance, self.b


class Road(NamedTuple):
    """Pieces over x, left (y > 0) and right.  A road for rigid discs holds their envelope, and its force is vertical."""

    left: Sequence[Piece]
    right: Sequence[Piece]
    disc: bool

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Height and the slope that the force sees."""
        pieces = self.left if y > 0 else self.right
        height, slope = pieces[max(bisect_right(pieces, x, key=attrgetter("start")) - 1, 0)].at(x)
        return height, 0.0 if self.disc else slope


class Tyre(NamedTuple):
    """Constants of a tyre: vertical spring, spin inertia, and those of the Calspan model by their names."""

    radius: float
    stiffness: float
    spin_inertia: float
    A0: float
    A1: float
    A2: float
    A3: float
    A4: float
    B1: float
    B3: float
    B4: float
    SN: float
    AF1: float
    AF2: float

    def sideways(self, load: float, slip: float, camber: float) -> tuple[float, float]:
        """Lateral force and aligning moment after Calspan (Frik, Leister, Schwartz, Vehicle System Dynamics 22, suppl., 1993)."""
        limit = (self.B1 * load + self.B3 + self.B4 * load * load) * self.SN * load
        if limit <= 0:
            return 0.0, 0.0
        low = min(load, self.A2)
        stiffness, thrust = self.A0 + self.A1 * low * (self.A2 - low) / self.A2, self.A3 * (self.A4 - low) * low / self.A4
        a = -(stiffness * slip + thrust * camber) / limit
        size = abs(a)
        side = limit * (a * (1 - size / 3 + a * a / 27) if size < 3 else (-1.0 if a < 0 else 1.0))
        return side, (self.AF1 * load + self.AF2 * abs(side)) * side


def wheel(centre: Vector, axis: Vector, tyre: Tyre, road: Road) -> Element:
    """A wheel that rolls on a road without a coordinate of its own.

    One that rolls at 0.1 m/s or less stands and is a spring along the road's normal n through its centre.
    """

    def element(body: Motion, t: float) -> tuple[Wrench, ...]:
        here, velocity = place(body, centre)
        e = turn(body.R, axis)
        height, slope = road.at(here[0], here[1])
        lean = 1 / sqrt(1 + slope * slope)
        n, clearance = (-slope * lean, 0.0, lean), here[2] - height
        weight = max(0.0, tyre.stiffness * (tyre.radius - clearance) * lean)
        ahead = cross(e, n)
        forward = scale(1 / sqrt(dot(ahead, ahead)), ahead)
        left, up, rolling = cross(n, forward), cross(forward, e), dot(forward, velocity)
        spin = scale(-tyre.spin_inertia * rolling / tyre.radius, cross(body.w, e))
        if rolling <= 0.1:
            force, moment = push(body, here, scale(weight, n))
            return (Wrench(force, add(moment, spin)),)
        side, aligning = tyre.sideways(weight, atan(dot(left, velocity) / rolling), atan(dot(n, e) / dot(n, up)))
        # the road's plane under the centre, met along the wheel's own plane
        foot = sub(here, scale(clearance * lean / dot(n, up), up))
        force, moment = push(body, foot, add(scale(weight, n), scale(side, left)))
        return (Wrench(force, add(moment, add(spin, scale(aligning, n)))),)

    return element
