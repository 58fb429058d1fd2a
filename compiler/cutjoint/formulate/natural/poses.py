"""The nodes that span each body, as blocks of the natural coordinates: the poses of all bodies follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.formulate.inputs import make_translator, open_parameters
from cutjoint.formulate.natural.layout import lay_out
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.model.records import GROUND, Parameter, Scene
from cutjoint.program.blocks import Block, Builder
from cutjoint.topology.records import Topology


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A point of a body, a way between two of its points, or a direction of it: (3, 1) in the ``design`` position and ``now``."""

    design: Block
    now: Block


@dataclass(frozen=True, kw_only=True)
class Span:
    """The span of a body: a point of it, and ways from that one or directions as its ``arms``."""

    point: Mark
    arms: tuple[Mark, ...]


@dataclass(frozen=True, kw_only=True)
class SpanEquations:
    """The ``spans`` of all bodies that move.

    Symbols are ``node:name`` by ``coordinates``, each with its name and size in the order of a run's coordinates, and ``parameters``.
    """

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
        coordinates=tuple((f"node:{n.name}", n.size) for n in layout.coordinates), parameters=open_parameters(model),
        spans={body: _span(motions, group.basis) for body, group in groups.items()},
    )  # fmt: skip


def _span(motions: NodeMotions, basis: tuple[Node, ...]) -> Span:
    point, *others = (Mark(design=motions.vector(node.place), now=motions.node(node).x) for node in basis)
    return Span(
        point=point,
        arms=tuple(_way(motions.builder, point, m) if n.kind is NodeKind.POINT else m for n, m in zip(basis[1:], others, strict=True)),
    )  # fmt: skip


def _way(b: Builder, start: Mark, end: Mark) -> Mark:
    return Mark(design=b.sub(end.design, start.design), now=b.sub(end.now, start.now))
