"""Every body's mass matrix and inertia force, with its numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import sympy

from cutjoint.formulate.inputs import reference_point
from cutjoint.formulate.recursive.forces import of_body
from cutjoint.model.records import Body, Model, Vector
from cutjoint.report.explain.blocks import LetterBodies, Letters, print_blocks
from cutjoint.report.explain.latex import column, parameter_symbols, place, text
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, line_of, make_table, with_others
from cutjoint.topology.records import Topology

_INERTIA = "xx yy zz xy xz yz"
_HEADINGS = ("body", "line", "mass $m$", "centre of mass, design", "$s$", "Ixx, Iyy, Izz", "Ixy, Ixz, Iyz")


def mass_and_force(body: Body) -> tuple[str, ...]:
    """The mass matrix and the inertia force of a body with mass, as the recursion computes them."""
    b = Letters()
    k: Any = LetterBodies(b)
    centre: Any = "G"
    inertia: Any = tuple(sympy.Symbol(f"I_{{{x}}}") for x in _INERTIA.split())
    i = replace(body, name="i", mass=sympy.Symbol("m"), centre_of_mass=centre, inertia=inertia)
    M, Q = of_body(k, i, b.free("g", 3), turns=False)
    return print_blocks(b, [], [("M =", M), ("Q =", Q)])


def explain_bodies(topology: Topology, counterparts: Sequence[Counterparts]) -> Chapter:
    """The bodies: those with mass by their numbers, the massless ones together."""
    model = topology.model
    bodies = {b.name: b for b in model.bodies}
    arms = {name: _arm(topology, bodies[name]) for name in topology.order}
    groups = group(
        topology.order, counterparts, lambda name: bodies[name].is_massless, lambda name: (bodies[name].mass, bodies[name].inertia)
    )
    heavy = [body for body in model.bodies if not body.is_massless]
    return Chapter(
        title="Bodies", formulas=(*(mass_and_force(heavy[0]) if heavy else ()), f"g = {column(model.gravity, parameter_symbols(model))}"),
        notes=(r"$p_{G}$ is the centre of mass seen from the pole, $R$ the rotation from the design position, where the inertia $I$ is "
               "given (eqs. 24, 25); $s$ leads from the body's origin, its joint's point, to that centre, in body axes.",),
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
        return Entry(title=title, notes=("Massless.",), formulas=(), table=make_table(_HEADINGS[:2], rows))
    return Entry(
        title=title, notes=(), formulas=(),
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
