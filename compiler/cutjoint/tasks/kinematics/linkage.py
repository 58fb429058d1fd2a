"""The linkage of an axle as numbers: poses at given heights of the wheels and a given place of the steering joint, and motions there."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cutjoint.analysis.closing import Array, design_coordinates, retract
from cutjoint.formulate.inputs import make_charts, make_numbers, make_translator
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.recursive.gears import derive_gears
from cutjoint.formulate.recursive.kinematics import Kinematics, derive_kinematics, halves
from cutjoint.formulate.recursive.loops import derive_loops
from cutjoint.methods import PLAIN_CLOSURE, join_and
from cutjoint.model.records import AxialForce, Force, PointSpring
from cutjoint.package.errors import RunError
from cutjoint.program.blocks import Block, Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.tasks.kinematics.axles import SIDES, Axle, Wheel
from cutjoint.topology.build import build_topology
from cutjoint.topology.geometry import TOLERANCE
from cutjoint.topology.records import Topology

#: Below these loop violations and errors of prescribed coordinates (m, rad), iterations stop when they no longer improve.
_CLOSED = 1e-12
_ITERATIONS = 25
#: A smaller motion (m or rad per unit of a prescribed coordinate) counts as zero.
_NOTHING = 1e-7
#: A step that moves a coordinate further (m, rad) would lead to another assembly mode.
_FARTHEST = 0.7


@dataclass(frozen=True, kw_only=True)
class WheelState:
    """A wheel in a pose: centre (m) and outward axis, (3,), and their derivatives, (3, prescribed), with that of the carrier's rotation."""

    centre: Array
    outward: Array
    velocity: Array
    rotation_rate: Array


@dataclass(frozen=True, kw_only=True)
class Pose:
    """The axle where the wheels' centres have risen by ``prescribed[:2]`` (m) and the steering joint, if any, is at ``prescribed[2]``.

    ``lengths`` (m) of springs and their changes by what is prescribed are by the springs' names.
    """

    prescribed: Array
    q: Array
    motions: Array
    wheels: tuple[WheelState, WheelState]
    lengths: Mapping[str, float]
    changes: Mapping[str, Array]


class Linkage:
    """The bodies of an axle, moved by what is prescribed: the heights of both wheels and the steering joint."""

    def __init__(self, axle: Axle) -> None:
        self.axle = axle

    @cached_property
    def topology(self) -> Topology:
        """The tree and the cut joints."""
        return build_topology(self.axle.part)

    @cached_property
    def charts(self) -> tuple[Chart, ...]:
        """The charts of the tree."""
        return make_charts(self.topology)

    @property
    def coordinates(self) -> int:
        """The number of coordinates."""
        return sum(len(chart.coordinate_names) for chart in self.charts)

    @cached_property
    def _speeds(self) -> int:
        return sum(len(chart.speed_names) for chart in self.charts)

    @cached_property
    def _kinematics(self) -> Kinematics:
        b = Builder()
        return derive_kinematics(b, make_translator(b, self.topology.model), self.topology, {c.joint: c for c in self.charts})

    @cached_property
    def _closing(self) -> tuple[list[Block], list[Block]]:
        """The residuals of cut joints and gears, and their rates."""
        k, topology = self._kinematics, self.topology
        numbers = make_numbers(k.builder, topology.closing, PLAIN_CLOSURE)
        closing = (*derive_loops(k, topology.cuts, numbers), *derive_gears(k, topology.model.gears, numbers))
        return [c.residual for c in closing], [c.rate for c in closing]

    @cached_property
    def _of_wheels(self) -> tuple[tuple[Block, ...], ...]:
        """Of each wheel centre, outward axis, the centre's velocity and the angular velocity."""
        return tuple(wheel_blocks(self._kinematics, wheel) for wheel in self.axle.wheels)

    @cached_property
    def _of_springs(self) -> dict[str, tuple[Block, Block]]:
        """Of each spring its length, or the travel of its point, with the rate."""
        return {spring.name: _spring_blocks(self._kinematics, spring) for spring in self.axle.springs}

    def _values(self, q: Array) -> dict[Block, Array]:
        """All blocks at coordinates, those of rates at all unit speeds."""
        inputs = {"t": np.zeros(1), "motion": np.zeros(1), "numerics": np.ones(3), "parameters": np.zeros(0)}
        unit = np.eye(self._speeds)
        for chart in self.charts:
            inputs[f"q:{chart.joint}"] = q[chart.q : chart.q + len(chart.coordinate_names)]
            inputs[f"v:{chart.joint}"] = unit[:, chart.v : chart.v + len(chart.speed_names)]
        roots = [b for blocks in (*self._closing, *self._of_wheels, *self._of_springs.values()) for b in blocks]
        return interpret_blocks(roots, inputs, {})

    def _by_speeds(self, values: Mapping[Block, Array], block: Block) -> Array:
        """The Jacobian (rows, speeds) of a column that is linear in the speeds."""
        return np.broadcast_to(values[block][..., 0], (self._speeds, block.shape[0])).T

    def _equations(self, q: Array, prescribed: Array) -> tuple[Array, Array, dict[Block, Array]]:
        """Residuals and Jacobian of the loops, then of what is prescribed."""
        values = self._values(q)
        residuals, rates = self._closing
        residual = [values[block][:, 0] for block in residuals]
        jacobian = [self._by_speeds(values, block) for block in rates]
        for wheel, (centre, _, velocity, _), height in zip(self.axle.wheels, self._of_wheels, prescribed[:2], strict=True):
            residual.append(values[centre][2] - wheel.centre[2] - height)
            jacobian.append(self._by_speeds(values, velocity)[2:])
        if self.axle.steering is not None:
            chart = next(c for c in self.charts if c.joint == self.axle.steering.name)
            residual.append(q[chart.q : chart.q + 1] - prescribed[2:])
            jacobian.append(np.eye(self._speeds)[chart.v : chart.v + 1])
        return np.concatenate(residual), np.concatenate(jacobian), values

    @property
    def prescribed(self) -> int:
        """The number of prescribed coordinates: two heights, and the steering joint's coordinate if any."""
        return 2 + (self.axle.steering is not None)

    def design(self) -> Pose:
        """The pose of the design position, its loops closed.
        Raises RunError: the axle is not moved by its wheels and its steering alone."""
        pose = self.close(design_coordinates(self), np.zeros(self.prescribed))
        if pose is None:
            raise RunError(f"{self.axle.part.span}: axle '{self.axle.name}': its loops do not close near the design position")
        _, jacobian, values = self._equations(pose.q, pose.prescribed)
        moved = jacobian @ pose.motions - np.eye(len(jacobian))[:, len(jacobian) - self.prescribed :]
        if np.abs(moved).max() > _NOTHING:
            parts = ("the left wheel", "the right wheel", "the steering joint")
            stuck = [part for part, gap in zip(parts, np.abs(moved).max(axis=0), strict=False) if gap > _NOTHING]
            raise RunError(f"{self.axle.part.span}: axle '{self.axle.name}': its joints do not let {join_and(stuck)} move by themselves")
        self._require_determined(jacobian, values)
        return pose

    def _require_determined(self, jacobian: Array, values: Mapping[Block, Array]) -> None:
        """Refuse an axle whose wheels move although their heights and the steering joint are prescribed; a wheel may spin."""
        _, sizes, rows = np.linalg.svd(jacobian)
        free = rows[int(np.sum(sizes > TOLERANCE * sizes.max())) :].T
        for _, outward, velocity, rotation_rate in self._of_wheels:
            tilt = np.cross((self._by_speeds(values, rotation_rate) @ free).T, values[outward][:, 0])
            if max(np.abs(self._by_speeds(values, velocity) @ free).max(initial=0.0), np.abs(tilt).max(initial=0.0)) > _NOTHING:
                joints = [c.joint for c in self.charts if np.abs(free[c.v : c.v + len(c.speed_names)]).max() > 0.1]
                words = f"its wheels move although their heights are prescribed, with the joints {', '.join(joints)}"
                raise RunError(f"{self.axle.part.span}: axle '{self.axle.name}': {words}; --steer names the joint that steers")

    def close(self, q: Array, prescribed: Array) -> Pose | None:
        """The pose near coordinates with what is prescribed there; None where the loops do not close."""
        best = np.inf
        for left in reversed(range(_ITERATIONS)):
            residual, jacobian, values = self._equations(q, prescribed)
            error = float(np.abs(residual).max())
            if not np.isfinite(error):
                return None
            if error < _CLOSED and (error >= best / 2 or not left):
                return self._pose(q, prescribed, jacobian, values)
            best = min(best, error)
            step = -np.linalg.pinv(jacobian, rcond=TOLERANCE) @ residual
            if np.abs(step).max() > _FARTHEST:
                return None
            q = retract(self, q, step)
        return None

    def _pose(self, q: Array, prescribed: Array, jacobian: Array, values: Mapping[Block, Array]) -> Pose:
        motions: Array = np.linalg.pinv(jacobian, rcond=TOLERANCE)[:, len(jacobian) - self.prescribed :].astype(np.float64)
        wheels = tuple(
            WheelState(
                centre=values[centre][:, 0], outward=values[outward][:, 0], velocity=self._by_speeds(values, velocity) @ motions,
                rotation_rate=self._by_speeds(values, rotation_rate) @ motions,
            )
            for centre, outward, velocity, rotation_rate in self._of_wheels
        )  # fmt: skip
        return Pose(
            prescribed=prescribed, q=q, motions=motions, wheels=(wheels[0], wheels[1]),
            lengths={name: float(values[length][0, 0]) for name, (length, _) in self._of_springs.items()},
            changes={name: (self._by_speeds(values, rate) @ motions)[0] for name, (_, rate) in self._of_springs.items()},
        )  # fmt: skip

    def follow(self, start: Pose, end: Array, rows: int) -> list[Pose]:
        """The poses at equal steps of what is prescribed, as many as rows, up to one that cannot be reached."""
        found: list[Pose] = []
        for prescribed in np.linspace(start.prescribed, end, rows + 1)[1:]:
            last = found[-1] if found else start
            pose = self.close(retract(self, last.q, last.motions @ (prescribed - last.prescribed)), prescribed)
            if pose is None:
                break
            found.append(pose)
        return found


def side_of(axle: Axle, wheel: Wheel) -> str:
    """The name of a wheel's side."""
    return SIDES[axle.wheels.index(wheel)]


def wheel_blocks(k: Kinematics, wheel: Wheel) -> tuple[Block, ...]:
    """The place of a wheel's centre, its outward axis, the centre's velocity and the carrier's angular velocity, (3, 1) each."""
    b = k.builder
    (x, y, z), (ex, ey, ez) = wheel.centre.tolist(), wheel.outward.tolist()
    point, outward = k.point(wheel.body, (x, y, z)), k.direction(wheel.body, (ex, ey, ez))
    return k.absolute(wheel.body, point), outward, k.velocity(wheel.body, point), halves(b, k.frames[wheel.body].Z)[1]


def _spring_blocks(k: Kinematics, spring: Force) -> tuple[Block, Block]:
    """The length of a line with its rate, or the travel along an axis of the base with its rate."""
    b = k.builder
    assert isinstance(spring, PointSpring | AxialForce)
    start, end = (spring.start, spring.end) if isinstance(spring, PointSpring) else (spring.origin, spring.point)
    base, follower = (body if body in k.frames else "ground" for body in (spring.base, spring.follower))
    p0, p = k.point(base, start), k.point(follower, end)
    way, speed = k.between(follower, p, base, p0), b.sub(k.velocity(follower, p), k.velocity(base, p0))
    if isinstance(spring, PointSpring):
        length = b.call("sqrt", b.dot(way, way))
        return length, b.call("div", b.dot(way, speed), length)
    axis = k.direction(base, spring.axis)
    turned = b.cross(halves(b, k.frames[base].Z)[1], axis)
    return b.dot(axis, way), b.add(b.dot(axis, speed), b.dot(turned, way))
