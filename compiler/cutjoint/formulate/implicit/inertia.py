"""The masses' part of the balance and of its tangent, by composite bodies.

With F_i = M_i A_i - Q_i of the masses alone and composites over a body and all that it carries, motion k changes the balance of motion j by

    s_j^T (M^c_j c_k + B^c_j DV_k)                    where k carries j along
    s_j^T (M^c_k c_k + B^c_k DV_k + xi_k x* F^c_k)    elsewhere

B_i DV = M_i (DV x V_i) + DV x* M_i V_i + V_i x* M_i DV does not depend on the linear part of DV: with w the angular velocity, v_G that of
the centre of mass c, and J about c, its columns by the angular part are [-2 m v_G~; -2 m c~ v_G~ + w~ (2 J - tr J 1)].
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from cutjoint.formulate.implicit.motions import Motion, Motions
from cutjoint.formulate.recursive.kinematics import Kinematics, halves
from cutjoint.model.records import Body
from cutjoint.program.blocks import Block, Builder, is_zero


@dataclass(frozen=True, kw_only=True)
class Composite:
    """A body and all that it carries: M (6, 6), the columns B (6, 3) by an angular change, F (6, 1)."""

    M: Block
    B: Block
    F: Block


def composites(
    k: Kinematics, bodies: Mapping[str, Body], M: Mapping[str, Block], Q: Mapping[str, Block], Zdd: Mapping[str, Block]
) -> dict[str, Composite]:
    """The composite of every body; ``M``, ``Q`` and ``Zdd`` of the masses with their weights."""
    b = k.builder
    found: dict[str, Composite] = {}
    for body, motion in reversed(k.motions.items()):
        carried = [c for c in found if k.motions[c].tree_joint.parent == body]
        with b.section(
            "tangent", body, "M^c = M + sum M^c, B^c = B + sum B^c, F^c = M A - Q + sum F^c", motion.tree_joint.joint.span.place
        ):
            F = b.sub(b.mul(M[body], Zdd[body]), Q[body])
            found[body] = Composite(
                M=b.name(b.total([M[body], *(found[c].M for c in carried)]), "Mc", body),
                B=b.name(b.total([_turning(k, bodies[body]), *(found[c].B for c in carried)]), "Bc", body),
                F=b.name(b.total([F, *(found[c].F for c in carried)]), "Fc", body),
            )
    return found


def _turning(k: Kinematics, body: Body) -> Block:
    """B of one body."""
    b = k.builder
    if body.is_massless:
        return b.zero(6, 3)
    mass = k.translator.scalar(body.mass)
    c = k.point(body.name, body.centre_of_mass)
    xx, yy, zz, xy, xz, yz = (k.translator.scalar(x) for x in body.inertia)
    trace = b.add(b.add(xx, yy), zz)
    twice = [[b.sub(b.add(x, x), trace) if i == j else b.add(x, x) for j, x in enumerate(row)] for i, row in enumerate(
        ([xx, xy, xz], [xy, yy, yz], [xz, yz, zz])
    )]  # fmt: skip
    J = b.sandwich(k.frames[body.name].R, b.mirror(b.stack(twice)))
    _, w = halves(b, k.frames[body.name].Z)
    push = b.scale(b.add(mass, mass), k.velocity(body.name, c))
    across = b.neg(b.skew(push))
    return b.stack([[across], [b.add(b.mul(b.skew(c), across), b.mul(b.skew(w), J))]])


def force_cross(b: Builder, motion: Block, force: Block) -> Block:
    """The rate of a force carried by a twist: [w x f; v x f + w x n] (Featherstone 2008, eq. 2.32)."""
    (v, w), (f, n) = halves(b, motion), halves(b, force)
    return b.stack([[b.cross(w, f)], [b.add(b.cross(v, f), b.cross(w, n))]])


def inertial_tangent(motions: Motions, of: Mapping[str, Composite]) -> Iterator[tuple[Motion, Motion, Block]]:
    """The masses' entries: row, column, value."""
    b = motions.k.builder
    for k in motions.all():
        whole = of[k.body]
        if is_zero(whole.M) and is_zero(whole.F):
            continue
        turn = b.take(k.DV, (3, 6))
        pushed = b.add(b.mul(whole.M, k.c), b.mul(whole.B, turn))
        fixed = b.add(pushed, force_cross(b, k.xi, whole.F))
        for body in motions.chains[k.body]:
            for j in motions.of_body[body]:
                if not motions.turns(k, j):
                    yield j, k, b.dot(j.s, fixed)
    for j in motions.all():
        whole = of[j.body]
        if is_zero(whole.M):
            continue
        row, turning = b.mul(whole.M, j.s), b.mul(b.transpose(whole.B), j.s)
        for body in motions.chains[j.body]:
            for k in motions.of_body[body]:
                if motions.turns(k, j):
                    yield j, k, b.add(b.dot(row, k.c), b.dot(turning, b.take(k.DV, (3, 6))))
