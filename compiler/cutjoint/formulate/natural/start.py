"""The places of natural coordinates for given joint coordinates: a run starts from the tree's kinematics."""

from __future__ import annotations

from collections.abc import Iterator

from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.formulate.recursive.coordinates import angle_of_pose, measure
from cutjoint.formulate.recursive.kinematics import Kinematics, halves
from cutjoint.model.records import Joint
from cutjoint.program.blocks import Block
from cutjoint.topology.records import Topology


def place_nodes(k: Kinematics, topology: Topology, layout: Layout) -> Iterator[tuple[Node, Block, Block]]:
    """Each coordinate's position and rate."""
    joints = {coordinate: key for key, coordinate in layout.angles.items()}
    for node in layout.coordinates:
        if node.kind is NodeKind.ANGLE:
            yield node, *_angle(k, topology, *joints[node])
        else:
            yield node, *_place(k, node)


def _place(k: Kinematics, node: Node) -> tuple[Block, Block]:
    b = k.builder
    if node.kind is NodeKind.POINT:
        point = k.point(node.body, node.place)
        return k.absolute(node.body, point), k.velocity(node.body, point)
    direction = k.direction(node.body, node.place)
    _, w = halves(b, k.frames[node.body].Z)
    return direction, b.cross(w, direction)


def _angle(k: Kinematics, topology: Topology, name: str, coordinate: str) -> tuple[Block, Block]:
    """The joint's own coordinate; an angle that advances, by the way; of a cut joint whose turns cannot be counted, within half a turn."""
    joint = next(j for j in topology.model.joints if j.name == name)
    if joint.element.advances:
        return _advanced_angle(k, joint)
    measured = measure(k, name, coordinate)
    if measured.position is not None:
        return measured.position, measured.rate
    return angle_of_pose(k, next(cut for cut in topology.cuts if cut.name == name)), measured.rate


def _advanced_angle(k: Kinematics, joint: Joint) -> tuple[Block, Block]:
    b, axis = k.builder, k.direction(joint.base, joint.axes[0])
    end, start = k.point(joint.follower, joint.at), k.point(joint.base, joint.at)
    way, pitch = k.between(joint.follower, end, joint.base, start), k.translator.scalar(joint.pitch)
    speed = b.sub(k.velocity(joint.follower, end), k.velocity(joint.base, start))
    return b.call("div", b.dot(axis, way), pitch), b.call("div", b.dot(axis, speed), pitch)
