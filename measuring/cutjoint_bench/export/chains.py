"""Joints as chains of elementary motions, for peers that know hinges, slides, screws and balls."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from cutjoint.elements.joint import AXIAL_FRAME, Ball, Direction, Offset, Rotation, Translation
from cutjoint.model.errors import Problem
from cutjoint.model.records import GROUND, Force
from cutjoint_bench.export.laws import Array, Triple
from cutjoint_bench.export.records import Mechanism, PeerJoint

#: The directions of a frame's axes.
Frame: TypeAlias = tuple[Triple, Triple, Triple]

_GLOBAL: Sequence[Triple] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class Part:
    """An elementary motion at the start, in global axes: what moves is carried by the part before it in a chain.

    ``axis`` is that of a hinge, a slide or a screw, None for a ball and a free motion; ``coordinate`` is the number of the model's
    coordinate that the part's own adds to, None where there is none.  ``pitch`` is a screw's advance in metres a radian.
    """

    type: Literal["hinge", "slide", "screw", "ball", "free"]
    point: Triple
    axis: Triple | None = None
    coordinate: int | None = None
    pitch: float = 0.0


def chain(joint: PeerJoint) -> tuple[Part, ...]:
    """The motions that move a joint's child beside its parent, from the parent on.

    A free joint's coordinates and a distance joint's angles belong to no part.
    """
    inner, outer = (joint.follower_point, joint.base_point) if joint.reversed else (joint.base_point, joint.follower_point)
    if joint.element.is_free:
        return (Part(type="free", point=outer),)
    if any(isinstance(m, Offset) for m in joint.element.chain):
        # two turns of the rod, then the outer ball: MuJoCo has none after a ball
        across = frame(np.array(outer) - np.array(inner))[:2]
        return (*(Part(type="hinge", point=inner, axis=axis) for axis in across), Part(type="ball", point=outer))
    parts = tuple(_part(joint, motion) for motion in joint.element.chain if not isinstance(motion, Offset))
    return tuple(map(_opposite, parts[::-1])) if joint.reversed else parts


def _part(joint: PeerJoint, motion: Translation | Rotation | Ball) -> Part:
    """A motion of the follower beside the base."""
    if isinstance(motion, Ball):
        return Part(type="ball", point=joint.follower_point)
    kind: Literal["hinge", "slide", "screw"] = "slide"
    if isinstance(motion, Rotation):
        kind = "screw" if motion.is_screw else "hinge"
    coordinate, pitch = joint.element.coordinates.index(motion.coordinate), joint.pitch if kind == "screw" else 0.0
    return Part(type=kind, point=joint.follower_point, axis=_axis(joint, motion.direction), coordinate=coordinate, pitch=pitch)


def _axis(joint: PeerJoint, direction: Direction) -> Triple:
    """A direction as the body carries it that the motions before lead to."""
    if direction is Direction.AXIS_2:
        return joint.follower_axes[1]
    return joint.base_axes[AXIAL_FRAME.index(direction)]


def _opposite(part: Part) -> Part:
    """A motion of the base beside the follower.  In the opposite order such motions undo the follower's, so that a coordinate keeps its
    sign; what slides after a turn is carried by the base, as the joint's axes are.
    """
    return part if part.axis is None else replace(part, axis=(-part.axis[0], -part.axis[1], -part.axis[2]))


def frame(axis: Array) -> Frame:
    """Axes of a right-handed frame whose third one has a direction."""
    z = axis / np.linalg.norm(axis)
    across = np.cross(np.eye(3)[(int(np.abs(z).argmax()) + 2) % 3], z)
    x = across / np.linalg.norm(across)
    return triple(x), triple(np.cross(z, x)), triple(z)


def triple(vector: Array) -> Triple:
    """Three numbers, none of them a negative zero."""
    x, y, z = (float(c) + 0.0 for c in vector)
    return x, y, z


def chain_problems(mechanism: Mechanism, joints: Sequence[PeerJoint]) -> list[Problem]:
    """Joints of which several motions share a coordinate, and forces on coordinates that belong to no part."""
    return [*(_shared(joint) for joint in joints if joint.element.shares_coordinates), *joint_force_problems(mechanism)]


def _shared(joint: PeerJoint) -> Problem:
    message, hint = f"a joint of kind {joint.kind} is not exported to this simulator", "write a universal joint"
    return Problem(span=joint.span, element=f"joint '{joint.name}'", message=message, hint=hint)


def joint_force_problems(mechanism: Mechanism) -> list[Problem]:
    """Forces on coordinates that belong to no part of a chain."""
    kinds, cuts = {j.name: j.kind for j in mechanism.tree if j.element.from_inner}, {cut.name for cut in mechanism.cuts}
    no_parts = [_no_part(force, kinds[force.joint_of]) for force in mechanism.forces if force.joint_of in kinds]
    return [*no_parts, *(_of_cut(force) for force in mechanism.forces if force.joint_of in cuts)]


def _of_cut(force: Force) -> Problem:
    message = f"a force on a coordinate of the cut joint '{force.joint_of}' is not exported"
    return Problem(span=force.span, element=f"force '{force.name}'", message=message, hint="write cut: true at another joint of its loop")


def _no_part(force: Force, kind: str) -> Problem:
    message = f"a force on a coordinate of a joint of kind {kind} is not exported"
    return Problem(span=force.span, element=f"force '{force.name}'", message=message, hint="write a load or a point_spring instead")


def gear_problems(mechanism: Mechanism, reason: str) -> list[Problem]:
    """The gears, for a peer that has none for a ``reason``."""
    message, hint = f"is not exported to {reason}", "leave it out, or couple the bodies there by hand"
    return [Problem(span=gear.span, element=f"gear '{gear.name}'", message=message, hint=hint) for gear in mechanism.gears]


def speeds(mechanism: Mechanism, joint: PeerJoint, parts: Sequence[Part]) -> tuple[float, ...]:
    """The speeds of the parts of a chain that move the child beside the parent as they do at the start.

    A ball has its angular velocity in global axes, a free motion the velocity of its point before that.
    """
    bodies = {body.name: body for body in mechanism.bodies}
    child = bodies[joint.child]
    centre = np.array(child.centre)
    velocity, spin = np.array(child.velocity), np.array(child.spin)
    if joint.parent != GROUND:
        parent = bodies[joint.parent]
        velocity = velocity - np.array(parent.velocity) - np.cross(parent.spin, centre - np.array(parent.centre))
        spin = spin - np.array(parent.spin)
    columns = np.column_stack([column for part in parts for column in twists(part, centre)])
    return tuple(float(x) + 0.0 for x in np.linalg.lstsq(columns, np.concatenate([velocity, spin]), rcond=None)[0])


def twists(part: Part, centre: Array) -> Iterator[Array]:
    """Twists of the unit speeds of a part: the velocity of a point (3,) and the angular velocity (3,), joined."""
    if part.type in ("slide", "free"):
        for axis in _GLOBAL if part.axis is None else [part.axis]:
            yield np.concatenate([axis, np.zeros(3)])
    if part.type != "slide":
        for axis in _GLOBAL if part.axis is None else [part.axis]:
            yield np.concatenate([np.cross(axis, centre - np.array(part.point)) + part.pitch * np.array(axis), axis])
