"""Forces and matrices over nodes, and their projection onto the coordinates.

Elements add their terms at their own points and directions. Terms of a node that is a linear combination of others go to these nodes.

The constant mass matrix of a rigid group over its basis (Garcia de Jalon, Bayo 1994, section 4.2).

A material point s of a group stands at sum_k c_k(s) e_k with c(s) = B^+ [s; 1], B the homogeneous places of the basis.  With the second
moments of all mass in these, J = integral [s; 1] [s; 1]^T dm, the group's mass matrix is B^+ J B^+T times the unit matrix of order 3.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import sympy

from cutjoint.formulate.natural.layout import Group
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Form, Node, NodeName, record
from cutjoint.model.records import GROUND, Body, Scalar
from cutjoint.program.blocks import Block

_ROUNDING = 1e-14  #: an element this much smaller than the largest is rounding


@dataclass(kw_only=True)
class NodalForce:
    """A generalised force: a column (size, 1) for each node."""

    motions: NodeMotions
    parts: dict[Node, Block] = field(default_factory=dict)

    def add(self, source: NodeName | str, form: Form, force: Block) -> None:
        """A force of an element that works on the displacement of a form."""
        for node, coefficient in form.items():
            self._add(source, node, self.motions.times(coefficient, force))

    def _add(self, source: NodeName | str, node: Node, force: Block) -> None:
        if node.body != GROUND:
            record(self.motions.builder, force, "force", source, node.title)
            known = self.parts.get(node)
            self.parts[node] = force if known is None else self.motions.builder.add(known, force)

    def by_coordinate(self) -> dict[Node, Block]:
        """The force on each coordinate; forces on dependent nodes are distributed, those of the node laid out last first."""
        for node in reversed(self.motions.layout.nodes):
            if node.parts is not None and node in self.parts:
                self.add(node.title, node.parts, self.parts.pop(node))
        b = self.motions.builder
        forces = {n: self.parts.get(n, b.zero(n.size)) for n in self.motions.layout.coordinates}
        for node, force in forces.items():
            record(b, force, "total force", node.title)
        return forces


@dataclass(kw_only=True)
class NodalMatrix:
    """A matrix of blocks (size, size) over pairs of nodes; zero blocks are absent."""

    motions: NodeMotions
    parts: dict[tuple[Node, Node], Block] = field(default_factory=dict)

    def add(self, source: NodeName | str, rows: Form, columns: Form, block: Block) -> None:
        """A block of an element between two forms."""
        for i, c in rows.items():
            for j, d in columns.items():
                self._add(source, i, j, self.motions.times(c * d, block))

    def _add(self, source: NodeName | str, i: Node, j: Node, block: Block) -> None:
        if GROUND not in (i.body, j.body):
            record(self.motions.builder, block, "tangent", source, i.title, j.title)
            known = self.parts.get((i, j))
            self.parts[i, j] = block if known is None else self.motions.builder.add(known, block)

    def by_coordinate(self) -> dict[tuple[Node, Node], Block]:
        """The blocks between coordinates, in the order of these."""
        for node in reversed(self.motions.layout.nodes):
            if node.parts is not None:
                self._hand_on(node)
        order = {node: i for i, node in enumerate(self.motions.layout.coordinates)}
        return dict(sorted(self.parts.items(), key=lambda item: (order[item[0][0]], order[item[0][1]])))

    def _hand_on(self, node: Node) -> None:
        """Replace a node by the combination that it is, first as a row, then as a column."""
        assert node.parts is not None
        one = {node: 1}
        for i, j in [pair for pair in self.parts if pair[0] is node]:
            self.add(node.title, node.parts, {j: 1} if j is not node else one, self.parts.pop((i, j)))
        for i, j in [pair for pair in self.parts if pair[1] is node]:
            self.add(node.title, {i: 1}, node.parts, self.parts.pop((i, j)))


def mass_matrix(group: Group, bodies: Iterable[Body]) -> dict[tuple[Node, Node], Scalar]:
    """The elements of a group's mass matrix by pairs of basis nodes, kg (kg m2 between directions)."""
    moments = sum((_moments(body) for body in bodies if not body.is_massless), sympy.zeros(4, 4))
    if moments.is_zero_matrix:
        return {}
    M = group.inverse * moments * group.inverse.T
    sizes = [abs(float(x)) for x in M if x.is_number]
    least = _ROUNDING * max(sizes, default=0.0)
    pairs = ((i, j) for i in range(M.rows) for j in range(M.cols))
    return {
        (group.basis[i], group.basis[j]): _number(M[min(i, j), max(i, j)]) for i, j in pairs
        if not (M[i, j].is_number and abs(float(M[i, j])) <= least)
    }  # fmt: skip


def _number(x: Scalar) -> Scalar:
    return float(x) if x.is_number else x


def _moments(body: Body) -> sympy.Matrix:
    """The zeroth to second moments of a body's mass about the design origin, (4, 4)."""
    xx, yy, zz, xy, xz, yz = body.inertia
    J = sympy.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    c = sympy.Matrix(body.centre_of_mass)
    second = J.trace() / 2 * sympy.eye(3) - J + body.mass * c * c.T
    first = body.mass * c
    return sympy.Matrix.vstack(sympy.Matrix.hstack(second, first), sympy.Matrix([[*first, body.mass]]))
