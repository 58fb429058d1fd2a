"""The constant mass matrix of a rigid group over its basis (Garcia de Jalon, Bayo 1994, section 4.2).

A material point s of a group stands at sum_k c_k(s) e_k with c(s) = B^+ [s; 1], B the homogeneous places of the basis.  With the second
moments of all mass in these, J = integral [s; 1] [s; 1]^T dm, the group's mass matrix is B^+ J B^+T times the unit matrix of order 3.
"""

from __future__ import annotations

from collections.abc import Iterable

import sympy

from cutjoint.formulate.natural.layout import Group
from cutjoint.formulate.natural.nodes import Node
from cutjoint.model.records import Body, Scalar

#: An element this much smaller than the largest is rounding.
_ROUNDING = 1e-14


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
