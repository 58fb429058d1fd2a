"""Coordinates of joints for forces and outputs: unknowns of a tree joint, measured coordinates of a cut joint.

A displacement s of a cut joint along the direction e of its base, an angle a about its axis e, with the vector d from the base's point to
the follower's and the angular velocities w::

    s = e . d            s' = e . (v_f - v_b)           both velocities at the follower's point
    a = sum of +- q      a' = sum of +- q'              over the rotations around a loop whose axes are parallel
    a = e . d/pitch      a' = e . (w_f - w_b)           of a screw; the rate alone in other loops
"""

from collections.abc import Iterable
from dataclasses import dataclass

from cutjoint.elements.joint import Direction
from cutjoint.formulate.recursive.kinematics import JointMotion, Kinematics, halves
from cutjoint.kernels.joints import direction_of, slide_axis
from cutjoint.model.records import COORDINATES, Joint, Vector
from cutjoint.program.blocks import Block, Builder
from cutjoint.topology.measured import angles_around
from cutjoint.topology.spanning_tree import joints_around


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A coordinate: its value, None where only the rate is known, and its rate."""

    position: Block | None
    rate: Block


def tree_motion(k: Kinematics, joint: str) -> JointMotion | None:
    """The motion of a tree joint; None of a cut joint."""
    return next((m for m in k.motions.values() if m.tree_joint.joint.name == joint), None)


def measure(k: Kinematics, joint: str, coordinate: str) -> Measured:
    """A coordinate of any joint."""
    motion = tree_motion(k, joint)
    if motion is not None:
        index = COORDINATES[motion.tree_joint.joint.kind].index(coordinate)
        return Measured(position=motion.position[index], rate=motion.rate[index])
    cut = next(c for c in (*k.topology.cuts, *k.topology.embedded) if c.name == joint)
    return _angle(k, cut) if coordinate in cut.element.angles else _displacement(k, cut, slide_axis(cut, coordinate))


def travel(k: Kinematics, ends: tuple[str, str], points: tuple[Vector, Vector], axis: Vector) -> tuple[Block, Block, Measured]:
    """Axis, follower's point, and the displacement of the follower's point along the base's axis.
    ``ends`` and ``points`` are base's, follower's."""
    b, (base, follower), (origin, outer) = k.builder, ends, points
    direction, point = k.direction(base, axis), k.point(follower, outer)
    displacement = k.between(follower, point, base, k.point(base, origin))
    position = b.dot(direction, displacement)
    on_base = b.add(point, k.pole_step(base, follower))
    rate = b.dot(direction, b.sub(k.velocity(follower, point), k.velocity(base, on_base)))
    return direction, point, Measured(position=position, rate=rate)


def angle_of_pose(k: Kinematics, cut: Joint) -> Block:
    """The angle about a cut joint's axis within half a turn of the design position."""
    b = k.builder
    first, second = (k.direction(cut.base, direction_of(cut, d)) for d in (Direction.ACROSS_1, Direction.ACROSS_2))
    pointer = k.direction(cut.follower, direction_of(cut, Direction.ACROSS_1))
    return b.call("atan2", b.dot(second, pointer), b.dot(first, pointer))


def _displacement(k: Kinematics, cut: Joint, axis: Vector) -> Measured:
    return travel(k, (cut.base, cut.follower), (cut.at, cut.at), axis)[2]


def _angle(k: Kinematics, cut: Joint) -> Measured:
    around = angles_around(cut, joints_around(k.topology.tree, cut))
    if around is not None and not cut.element.is_screw:
        measured = [(measure(k, angle.joint.name, angle.coordinate), angle.sign) for angle in around]
        positions = _signed_sum(k.builder, [(angle.position, sign) for angle, sign in measured if angle.position is not None])
        return Measured(position=positions, rate=_signed_sum(k.builder, [(angle.rate, sign) for angle, sign in measured]))
    return Measured(position=_advance(k, cut), rate=_rotation_rate(k, cut))


def _signed_sum(b: Builder, parts: Iterable[tuple[Block, int]]) -> Block:
    return b.total([b.zero(1), *(part if sign > 0 else b.neg(part) for part, sign in parts)])


def _advance(k: Kinematics, cut: Joint) -> Block | None:
    """The angle of a screw."""
    displacement = _displacement(k, cut, direction_of(cut, Direction.AXIS)).position
    return None if cut.pitch is None or displacement is None else k.builder.call("div", displacement, k.translator.scalar(cut.pitch))


def _rotation_rate(k: Kinematics, cut: Joint) -> Block:
    b = k.builder
    spins = [halves(b, k.frames[body].Z)[1] for body in (cut.follower, cut.base)]
    return b.dot(k.direction(cut.base, direction_of(cut, Direction.AXIS)), b.sub(*spins))
