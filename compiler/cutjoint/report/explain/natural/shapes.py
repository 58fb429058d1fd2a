"""The constraints that keep bodies rigid, and hold them to nodes that their bases do not have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy

from cutjoint.formulate.natural.constraints import Constraint
from cutjoint.formulate.natural.layout import Group, combination
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind
from cutjoint.model.records import Scalar
from cutjoint.report.explain.latex import text
from cutjoint.report.explain.natural.derivation import Derivation, clean, form_text
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, make_table, with_others

_LAW = (
    r"u_k = e_k - e_0 \text{ of a point}, \quad u_k = e_k \text{ of a direction}, \quad l_k = \lVert u_k \rVert \text{ and }"
    r" c_{jk} = u_j \cdot u_k \text{ in the design position}",
    r"l_{jk} = \max(l_j, l_k) \text{ of two ways between points}, \quad l_{jk} = 1 \text{ where one is a direction}",
    r"\Phi_{kk} = \frac{u_k \cdot u_k - l_k^2}{2 l_k}, \quad \Phi_{jk} = \frac{u_j \cdot u_k - c_{jk}}{l_{jk}}",
    r"\dot \Phi_{jk} = \frac{u_j \cdot \dot u_k + u_k \cdot \dot u_j}{l_{jk}}, \quad"
    r" \ddot \Phi_{jk} = \frac{u_j \cdot \ddot u_k + u_k \cdot \ddot u_j + 2 \dot u_j \cdot \dot u_k}{l_{jk}}",
)

_HELD = {
    NodeKind.POINT: (r"\Phi = e - \sum\nolimits_{k} c_k e_k",),
    NodeKind.VECTOR: (r"\Phi_i = e \cdot t_i, \quad t_1, t_2 \text{ across } e \text{ in the body}",),
}  # fmt: skip

_NOTES = (
    "A body keeps lengths and angles of the ways $u_k$ in its basis, but for those that another body keeps, or that lie in the ground. "
    "An equation is named after the ends of its two ways, or of the one whose length it keeps. A shared node that "
    "the basis does not have, since it is full, holds its own combination to the node.",
)


@dataclass(frozen=True, kw_only=True)
class _Kept:
    """An equation of a body: ways j and k of its basis, and their product in the design position."""

    name: str
    j: int
    k: int
    value: Scalar


@dataclass(frozen=True, kw_only=True)
class _Shape:
    """The equations of a rigid group."""

    group: Group
    kept: tuple[_Kept, ...]
    held: tuple[tuple[Node, Constraint], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the equations."""
        return (*(e.name for e in self.kept), *(name for _, c in self.held for name in c.names))

    @property
    def form(self) -> tuple[object, ...]:
        """The key of groups that are explained together."""
        kinds = tuple(node.kind for node in self.group.basis)
        return kinds, tuple((e.j, e.k) for e in self.kept), tuple((node.kind, len(c.names)) for node, c in self.held)


def explain_shapes(d: Derivation, counterparts: Sequence[Counterparts]) -> Chapter:
    """The bodies, those with bases of one form together."""
    shapes = {g.name: _shape(d, g) for g in d.full.layout.groups.values()}
    groups = group(list(shapes), counterparts, lambda name: shapes[name].form, lambda name: shapes[name].form)
    return Chapter(
        title="Constraints of bodies", notes=_NOTES, formulas=_LAW,
        entries=tuple(_entry(d, [shapes[name] for name in names]) for names in groups),
    )  # fmt: skip


def _shape(d: Derivation, g: Group) -> _Shape:
    """The constraints of a group: first by its pairs, then by its surplus nodes."""
    constraints = [c for c in d.full.constraints if c.element == g.name]
    kept = tuple(
        _Kept(name=c.names[0], j=_index(g, u), k=_index(g, w), value=_product(u, w))
        for (u, w), c in zip(g.pairs, constraints[: len(g.pairs)], strict=True)
    )
    return _Shape(group=g, kept=kept, held=tuple(zip(g.surplus, constraints[len(kept) :], strict=True)))


def _index(g: Group, way: Form) -> int:
    """A way by its end's place in the basis."""
    return g.basis.index(next(iter(way)))


def _product(u: Form, w: Form) -> Scalar:
    """The product of two ways in the design position."""
    p, q = (sympy.Matrix([sum((c * node.place[i] for node, c in way.items()), sympy.Integer(0)) for i in range(3)]) for way in (u, w))
    lengths = p.norm() * q.norm()
    return clean(p.dot(q), float(lengths) if lengths.is_number else 1.0)


def _entry(d: Derivation, shapes: Sequence[_Shape]) -> Entry:
    first = shapes[0]
    names = [shape.group.name for shape in shapes]
    basis = ", ".join(f"$e_{i}$ a {node.kind.value}" for i, node in enumerate(first.group.basis))
    notes = [f"Basis: {basis}."]
    notes += left_out_note(d, [f"{s.group.name}.{name}" for s in shapes for name in s.names])
    if not (first.kept or first.held):
        notes.append("No equation: other bodies or the ground keep all of it.")
    formulas = dict.fromkeys(f for node, c in first.held for f in _held_formulas(node, c))
    return Entry(
        title=with_others(names), notes=tuple(notes), formulas=tuple(formulas),
        table=make_table(("equation", "line", "keeps", "at"), (row for shape in shapes for row in _rows(d, shape))),
    )  # fmt: skip


def _held_formulas(node: Node, constraint: Constraint) -> tuple[str, ...]:
    return _HELD[NodeKind.VECTOR if len(constraint.names) == 2 else NodeKind.POINT]


def _rows(d: Derivation, shape: _Shape) -> list[tuple[str, str, str, str]]:
    model, line = d.model, d.bodies(shape.group)[0].span.place
    rows = [(code(f"{shape.group.name}.{e.name}"), line, _way_product(e), text(e.value, model)) for e in shape.kept]
    for node, c in shape.held:
        held = form_text(combination(shape.group, node.kind, node.place), model)
        rows += [(code(f"{shape.group.name}.{name}"), line, held, code(node.name)) for name in c.names]
    return rows


def left_out_note(d: Derivation, equations: Sequence[str]) -> tuple[str, ...]:
    """A note of the equations that the method leaves out; none if it leaves out none."""
    left_out = [name for name in equations if not d.is_held(name)]
    return (f"Left out, since others imply them: {code(left_out)}.",) if left_out else ()


def _way_product(e: _Kept) -> str:
    return rf"$u_{e.j} \cdot u_{e.k}$"
