"""Every rigid body's mass matrix over its basis, and the way from four nodes of each body to the remaining ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import sympy

from cutjoint.formulate.natural.assembly import mass_matrix
from cutjoint.formulate.natural.layout import Group, Layout
from cutjoint.model.records import GROUND, Body
from cutjoint.report.explain.bodies import inertia_cells
from cutjoint.report.explain.latex import column, equations, parameter_symbols, place, text, variants
from cutjoint.report.explain.natural.derivation import Derivation, clean
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, Table, code, group, line_of, make_table, plural, with_others

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
        table = make_table(_HEADINGS[:2], ((code(b.name), line_of(b)) for b in light))
        entries.append(Entry(title=with_others([b.name for b in light]), notes=("Massless.",), formulas=(r"\mu = 0",), table=table))
    gravity = f"g = {column(d.model.gravity, parameter_symbols(d.model))}"
    return Chapter(title="Mass matrices", notes=_NOTES, formulas=(*_LAW, gravity), entries=tuple(entries))


def _formula(d: Derivation, g: Group) -> tuple[str, ...]:
    elements = mass_matrix(g, d.bodies(g))
    mu = sympy.Matrix([[clean(elements.get((a, b), 0), 0.0) for b in g.basis] for a in g.basis])
    return equations([(r"\mu", mu)], parameter_symbols(d.model))


def _entry(d: Derivation, names: Sequence[str], formulas: Sequence[tuple[str, ...]], bodies: Sequence[Body]) -> Entry:
    rows = (
        (code(b.name), line_of(b), text(b.mass, d.model), place(b.centre_of_mass, d.model), *inertia_cells(b, d.model)) for b in bodies
    )
    return Entry(title=with_others(names), notes=(), formulas=variants(names, formulas), table=make_table(_HEADINGS, rows))


@dataclass(frozen=True, kw_only=True)
class Sharing:
    """Coordinates from four nodes of each body to the final ones: each field but the first is a saving."""

    unshared: int
    rigid: int
    unasked: int
    shared: int
    ground: int
    combined: int

    @property
    def left(self) -> int:
        """Points and vectors that are coordinates."""
        return self.unshared - self.rigid - self.unasked - self.shared - self.ground - self.combined


def count_sharing(layout: Layout, bodies: int) -> Sharing:
    """The counts of coordinates that sharing, the ground and combinations save."""
    groups = list(layout.groups.values())
    places = [node for g in groups for node in g.basis]
    nodes = list(dict.fromkeys(places))
    return Sharing(
        unshared=4 * bodies, rigid=4 * (bodies - len(groups)), unasked=sum(4 - len(g.basis) for g in groups),
        shared=len(places) - len(nodes), ground=sum(n.body == GROUND for n in nodes), combined=sum(n.parts is not None for n in nodes),
    )  # fmt: skip


def sharing_table(layout: Layout, bodies: int) -> Table:
    """The count as a sum."""
    s = count_sharing(layout, bodies)
    saved = (
        ("bodies fixed to others or to the ground", s.rigid), ("directions that nothing asks a body for", s.unasked),
        ("shared with a body laid out before", s.shared), ("constants of the ground", s.ground),
        ("combinations of another body's basis", s.combined),
    )  # fmt: skip
    rows = [("a point and three directions of each body", str(s.unshared)), *((name, f"-{n}") for name, n in saved if n)]
    return make_table(("points and vectors", "count"), [*rows, ("**coordinates**", f"**{s.left}**")])


def saving(d: Derivation) -> str:
    """The saving by shared points and vectors, in a sentence."""
    n, nodes = len(d.model.bodies), [node for node in d.full.layout.coordinates if node.size == 3]
    angles = len(d.full.layout.coordinates) - len(nodes)
    left = f"{plural(len(nodes), 'point or vector', 'points and vectors')} with {3 * len(nodes)} coordinates are left"
    return (
        f"Were nothing shared, each of the {plural(n, 'body', 'bodies')} would have a point and three directions of its own, "
        f"{4 * n} points and vectors with {12 * n} coordinates; {left}" + (f", besides {plural(angles, 'angle')}." if angles else ".")
    )
