"""Every rigid body's mass matrix over its basis."""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from cutjoint.formulate.natural.layout import Group
from cutjoint.formulate.natural.mass import mass_matrix
from cutjoint.model.records import Body
from cutjoint.report.explain.bodies import inertia_cells
from cutjoint.report.explain.groups import Counterparts, group
from cutjoint.report.explain.latex import column, equations, parameter_symbols, place, text, variants
from cutjoint.report.explain.natural.derivation import Derivation
from cutjoint.report.explain.natural.forms import clean
from cutjoint.report.explain.views import Chapter, Entry, code, make_table, with_others

_LAW = (
    r"M = \mu \otimes \mathbf{1}, \quad \mu = B^+ J B^{+T}, \quad J = \begin{bmatrix} J_2 & m c \cr m c^T & m \end{bmatrix}, \quad"
    r" J_2 = \frac{1}{2} \text{tr} J_0 \cdot \mathbf{1} - J_0 + m c c^T",
    r"B = \begin{bmatrix} e_0 & e_1 & \dots \cr \epsilon_0 & \epsilon_1 & \dots \end{bmatrix}, \quad"
    r" \epsilon_k = 1 \text{ of a point, } 0 \text{ of a direction}, \quad B^+ B = \mathbf{1}",
)

_NOTES = (
    r"$J_0$ is a body's inertia about its centre of mass $c$, $B$ has its basis, both in the design position. A point that is at $s$ there "
    r"is the combination $B^+ (s, 1)$ of the basis for good, so $M$ is constant and inertia brings no forces that depend on velocities. "
    r"Rows and columns of $\mu$ are those of the basis. The weight $m g$ acts on the combination that is the centre of mass.",
)

_HEADINGS = ("body", "line", "mass $m$", "centre of mass, design", "Ixx, Iyy, Izz", "Ixy, Ixz, Iyz")


def explain_masses(d: Derivation, counterparts: Sequence[Counterparts]) -> Chapter:
    """The rigid bodies with mass by their numbers, the massless ones together."""
    groups = {g.name: g for g in d.full.layout.groups.values()}
    heavy = {name: [b for b in d.bodies(g) if not b.is_massless] for name, g in groups.items()}
    kinds = {name: tuple(n.kind for n in g.basis) for name, g in groups.items()}
    formulas = {name: _formula(d, g) for name, g in groups.items() if heavy[name]}
    alike = group(list(formulas), counterparts, kinds.__getitem__, formulas.__getitem__)
    entries = [_entry(d, names, [formulas[n] for n in names], [b for n in names for b in heavy[n]]) for names in alike]
    light = [b for b in d.model.bodies if b.is_massless]
    if light:
        table = make_table(_HEADINGS[:2], ((code(b.name), b.span.place) for b in light))
        entries.append(Entry(title=with_others([b.name for b in light]), notes=("Massless.",), formulas=(r"\mu = 0",), table=table))
    gravity = f"g = {column(d.model.gravity, parameter_symbols(d.model))}"
    return Chapter(title="Mass matrices", notes=_NOTES, formulas=(*_LAW, gravity), entries=tuple(entries))


def _formula(d: Derivation, g: Group) -> tuple[str, ...]:
    elements = mass_matrix(g, d.bodies(g))
    mu = sympy.Matrix([[clean(elements.get((a, b), 0), 0.0) for b in g.basis] for a in g.basis])
    return equations([(r"\mu", mu)], parameter_symbols(d.model))


def _entry(d: Derivation, names: Sequence[str], formulas: Sequence[tuple[str, ...]], bodies: Sequence[Body]) -> Entry:
    rows = (
        (code(b.name), b.span.place, text(b.mass, d.model), place(b.centre_of_mass, d.model), *inertia_cells(b, d.model)) for b in bodies
    )
    return Entry(title=with_others(names), notes=(), formulas=variants(names, formulas), table=make_table(_HEADINGS, rows))
