"""Poses in natural coordinates: nodes that span each body, and where the coordinates stand for given joint coordinates."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from cutjoint.formulate.inputs import make_translator, tunable_parameters
from cutjoint.formulate.natural.layout import Layout, lay_out
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.formulate.recursive.coordinates import angle_of_pose, measure
from cutjoint.formulate.recursive.kinematics import Kinematics, halves
from cutjoint.model.records import GROUND, Joint, Parameter, Scene
from cutjoint.program.blocks import Block, Builder
from cutjoint.topology.records import Topology


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A point of a body, a displacement between two of its points, or a direction of it: (3, 1) in the ``design`` position and ``now``."""

    design: Block
    now: Block


@dataclass(frozen=True, kw_only=True)
class Span:
    """The span of a body: a point of it, and displacements from that one or directions as its ``arms``."""

    point: Mark
    arms: tuple[Mark, ...]


@dataclass(frozen=True, kw_only=True)
class SpanEquations:
    """The ``spans`` of all bodies that move.
    Symbols are ``node:name`` by ``coordinates``, each with its name and size in the order of a run's coordinates, and ``parameters``."""

    coordinates: tuple[tuple[str, int], ...]
    parameters: tuple[Parameter, ...]
    spans: Mapping[str, Span]


def derive_spans(topology: Topology, scene: Scene) -> SpanEquations:
    """The spans of the bodies of a model in a scene, as the methods with natural coordinates lay them out for its outputs."""
    model, b = topology.model, Builder()
    layout = lay_out(topology, scene, scene.outputs)
    motions = NodeMotions(builder=b, translator=make_translator(b, model), layout=layout)
    groups = {body: layout.groups[group] for body, group in layout.group_of.items() if group != GROUND}
    return SpanEquations(
        coordinates=tuple((f"node:{n.name}", n.size) for n in layout.coordinates), parameters=tunable_parameters(model),
        spans={body: _span(motions, group.basis) for body, group in groups.items()},
    )  # fmt: skip


def _span(motions: NodeMotions, basis: tuple[Node, ...]) -> Span:
    b = motions.builder
    point, *others = (Mark(design=motions.vector(node.place), now=motions.node(node).x) for node in basis)
    arms = (
        Mark(design=b.sub(mark.design, point.design), now=b.sub(mark.now, point.now)) if node.kind is NodeKind.POINT else mark
        for node, mark in zip(basis[1:], others, strict=True)
    )
    return Span(point=point, arms=tuple(arms))


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
    """The joint's own coordinate; of a screw an angle from the displacement.
    Of a cut joint whose turns cannot be counted, within half a turn."""
    joint = next(j for j in topology.model.joints if j.name == name)
    if joint.element.is_screw:
        return _advanced_angle(k, joint)
    measured = measure(k, name, coordinate)
    if measured.position is not None:
        return measured.position, measured.rate
    return angle_of_pose(k, next(cut for cut in topology.cuts if cut.name == name)), measured.rate


def _advanced_angle(k: Kinematics, joint: Joint) -> tuple[Block, Block]:
    b, axis = k.builder, k.direction(joint.base, joint.axes[0])
    end, start = k.point(joint.follower, joint.at), k.point(joint.base, joint.at)
    displacement, pitch = k.between(joint.follower, end, joint.base, start), k.translator.scalar(joint.pitch)
    speed = b.sub(k.velocity(joint.follower, end), k.velocity(joint.base, start))
    return b.call("div", b.dot(axis, displacement), pitch), b.call("div", b.dot(axis, speed), pitch)
