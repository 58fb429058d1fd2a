"""Where natural coordinates stand for given joint coordinates: a run starts from the tree's kinematics."""

from __future__ import annotations

from collections.abc import Iterator

from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.formulate.recursive.coordinates import angle_of_pose, measure
from cutjoint.formulate.recursive.kinematics import Kinematics, halves
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
    """The joint's own coordinate; of a cut joint whose turns cannot be counted, the angle within half a turn."""
    measured = measure(k, name, coordinate)
    if measured.position is not None:
        return measured.position, measured.rate
    return angle_of_pose(k, next(cut for cut in topology.cuts if cut.name == name)), measured.rate
