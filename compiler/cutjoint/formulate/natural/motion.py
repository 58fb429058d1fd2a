"""The motion of nodes: positions, velocities and accelerations of nodes and their combinations as blocks."""

from dataclasses import dataclass, field

from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, record
from cutjoint.formulate.translate import Translator
from cutjoint.model.records import GROUND, Scalar, Vector
from cutjoint.program.blocks import BindingTime, Block, Builder


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A form's value and its first two time derivatives, (3, 1) or (1, 1)."""

    x: Block
    v: Block
    a: Block


@dataclass(kw_only=True)
class NodeMotions:
    """The motion of every node, from the coordinates outwards, and the symbols of first-order ``states``."""

    builder: Builder
    translator: Translator
    layout: Layout
    states: frozenset[Block] = frozenset()
    _known: dict[Node, Motion] = field(default_factory=dict, repr=False)

    def of(self, form: Form) -> Motion:
        """The motion of a combination of nodes."""
        if not form:
            return Motion(x=self.builder.zero(3), v=self.builder.zero(3), a=self.builder.zero(3))
        motions = [(coefficient, self.node(node)) for node, coefficient in form.items()]
        return Motion(**{of: self.builder.total([self.times(c, getattr(m, of)) for c, m in motions]) for of in ("x", "v", "a")})

    def times(self, coefficient: Scalar, block: Block) -> Block:
        """A coefficient times a block."""
        b = self.builder
        if coefficient == 1:
            return block
        if coefficient == -1:
            return b.neg(block)
        number = b.number(coefficient) if isinstance(coefficient, float) else self.translator.scalar(coefficient)
        return b.scale(number, block)

    def node(self, node: Node) -> Motion:
        """The motion of a node."""
        if node not in self._known:
            motion = self._known[node] = self._derived(node)
            for block in (motion.x, motion.v, motion.a):
                record(self.builder, block, "node", node.title)
        return self._known[node]

    def _derived(self, node: Node) -> Motion:
        b, name = self.builder, node.name.replace(".", "_")
        if node.body == GROUND:
            return Motion(x=self.vector(node.place), v=b.zero(3), a=b.zero(3))
        if node.parts is not None:
            motion = self.of(node.parts)
            symbol = "p" if node.kind is NodeKind.POINT else "u"
            return Motion(x=b.label(motion.x, f"{symbol}_{name}"), v=b.label(motion.v, f"{symbol}d_{name}"), a=motion.a)
        kinds = {"x": "node", "v": "node_rate", "a": "node_acceleration"}
        return Motion(**{key: b.symbol(f"{kind}:{node.name}", node.size, BindingTime.ITERATION) for key, kind in kinds.items()})

    def vector(self, vector: Vector) -> Block:
        """A design vector as a column."""
        return self.builder.column([self.translator.scalar(x) for x in vector])

    def point(self, body: str, place: Vector) -> Motion:
        """The motion of a body's point."""
        return self.of(self.layout.point(body, place))

    def direction(self, body: str, place: Vector) -> Motion:
        """The motion of a body's direction."""
        return self.of(self.layout.direction(body, place))

    def spin(self, body: str, axes: tuple[Form, Form, Form]) -> Block:
        """The angular velocity of a body from three perpendicular unit directions: half the sum of e x e'."""
        b = self.builder
        if body == GROUND:
            return b.zero(3)
        motions = [self.of(axis) for axis in axes]
        return b.scale(b.number(0.5), b.total([b.cross(m.x, m.v) for m in motions]))
