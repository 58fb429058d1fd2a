"""Every body's mass matrix and inertia force, with its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cutjoint.formulate.inputs import reference_point
from cutjoint.model.records import Body, Model, Scalar, Vector
from cutjoint.report.explain.latex import Symbols, column, latex, matrix, parameter_symbols, place, text
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, line_of, make_table, with_others
from cutjoint.topology.records import Topology

_LAW = (
    r"M = \begin{bmatrix} m \mathbf{1} & -m \tilde c \cr m \tilde c & J - m \tilde c \tilde c \end{bmatrix}, \quad"
    r" Q = \begin{bmatrix} m (g - \omega \times v_G) \cr c \times m (g - \omega \times v_G) - \omega \times J \omega \end{bmatrix}",
    r"c = r + R s, \quad J = R J_0 R^T, \quad v_G = v_0 + \omega \times c",
)

_HEADINGS = ("body", "line", "mass $m$", "centre of mass, design", "$s$", "Ixx, Iyy, Izz", "Ixy, Ixz, Iyz")


def explain_bodies(topology: Topology, counterparts: Sequence[Counterparts]) -> Chapter:
    """The bodies: those with mass by their numbers, the massless ones together."""
    model = topology.model
    bodies = {b.name: b for b in model.bodies}
    arms = {name: _arm(topology, bodies[name]) for name in topology.order}
    groups = group(
        topology.order, counterparts, lambda name: bodies[name].is_massless, lambda name: _formulas(bodies[name], arms[name], model)
    )
    return Chapter(
        title="Bodies", formulas=(*_LAW, f"g = {column(model.gravity, parameter_symbols(model))}"),
        notes=("$s$ leads from the body's origin, its joint's point, to the centre of mass, in body axes; $c$ is that centre seen from "
               "the pole; $J_0$ is the inertia about it in the design position (eqs. 24, 25).",),
        entries=tuple(_entry([bodies[name] for name in names], arms, model) for names in groups),
    )  # fmt: skip


def _arm(topology: Topology, body: Body) -> Vector:
    t = topology.joint_of[body.name]
    origin = reference_point(t.joint, t.reversed)
    x, y, z = (c - o for c, o in zip(body.centre_of_mass, origin, strict=True))
    return x, y, z


def _entry(bodies: Sequence[Body], arms: Mapping[str, Vector], model: Model) -> Entry:
    first, title = bodies[0], with_others([b.name for b in bodies])
    if first.is_massless:
        rows = ((code(b.name), line_of(b)) for b in bodies)
        return Entry(title=title, notes=("Massless.",), formulas=(r"M = 0, \quad Q = 0",), table=make_table(_HEADINGS[:2], rows))
    notes = (f"With the numbers of {code(first.name)}:",) if len(bodies) > 1 else ()
    return Entry(
        title=title, notes=notes, formulas=_formulas(first, arms[first.name], model),
        table=make_table(_HEADINGS, (_row(b, arms[b.name], model) for b in bodies)),
    )  # fmt: skip


def _row(body: Body, arm: Vector, model: Model) -> tuple[str, ...]:
    return (
        code(body.name), line_of(body), text(body.mass, model), place(body.centre_of_mass, model), place(arm, model),
        *inertia_cells(body, model),
    )  # fmt: skip


def inertia_cells(body: Body, model: Model) -> tuple[str, str]:
    """Moments and products of inertia for a table."""
    principal, products = (", ".join(text(x, model) for x in part) for part in (body.inertia[:3], body.inertia[3:]))
    return principal, products


def _formulas(body: Body, arm: Vector, model: Model) -> tuple[str, ...]:
    """M and Q with the body's mass, and its s and J_0."""
    if body.is_massless:
        return ()
    symbols = parameter_symbols(model)
    m = _factor(body.mass, symbols)
    xx, yy, zz, xy, xz, yz = body.inertia
    J = [[latex(x, symbols) for x in row] for row in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))]
    M = matrix([[rf"{m}\mathbf{{1}}", rf"-{m}\tilde c"], [rf"{m}\tilde c", rf"J - {m}\tilde c \tilde c"]])
    pull = rf"{m}(g - \omega \times v_G)"
    Q = matrix([[pull], [rf"c \times {pull} - \omega \times J \omega"]])
    return rf"M = {M}, \quad Q = {Q}", rf"s = {column(arm, symbols)}, \quad J_0 = {matrix(J)}"


def _factor(mass: Scalar, symbols: Symbols) -> str:
    """A mass as a factor."""
    if mass == 1:
        return ""
    factor = latex(mass, symbols)
    return rf"\left({factor}\right) \cdot " if mass.is_Add else rf"{factor} \cdot "
