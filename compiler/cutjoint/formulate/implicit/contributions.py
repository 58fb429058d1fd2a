"""Contributions of masses, force elements, cut joints and first-order states to the force residual and its tangent.

An element acts on one body or on two. A motion that displaces both bodies together leaves their relative motion unchanged. Only motions on
the path between the two bodies contribute: the wrench W and the motion columns s change with them. (If the law reads quantities of other
bodies, all motions contribute.)

    D_k (s_j^T W) = s_j^T D_k W + (xi_k x s_j)^T W          second term: only if k carries j

Masses contribute by composite bodies (superscript c: a body and all outer bodies). With F_i = M_i A_i - Q_i of the masses alone, motion k
changes the residual of motion j by

    s_j^T (M^c_j c_k + B^c_j DV_k)                    where k carries j along
    s_j^T (M^c_k c_k + B^c_k DV_k + xi_k x* F^c_k)    elsewhere

B_i DV = M_i (DV x V_i) + DV x* M_i V_i + V_i x* M_i DV does not depend on the linear part of DV: with w the angular velocity, v_G that of
the centre of mass c, and J about c, its columns by the angular part are [-2 m v_G~; -2 m c~ v_G~ + w~ (2 J - tr J 1)].
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from cutjoint.formulate.implicit.motions import Motion, Motions, times
from cutjoint.formulate.layout import StateLayout
from cutjoint.formulate.recursive.kinematics import Kinematics, halves, motion_cross
from cutjoint.formulate.recursive.loops import LoopClosure, constraint_wrenches, transport
from cutjoint.formulate.recursive.recursion import BodySystem
from cutjoint.formulate.states import Entry, by_state, state_rates
from cutjoint.model.records import GROUND, Body, Model
from cutjoint.program.blocks import BindingTime, Block, Builder, is_zero
from cutjoint.program.differentiate import Variation


@dataclass(frozen=True, kw_only=True)
class Closed:
    """A cut joint: residual Phi, ``augmented_loop`` = penalty Phi + lambda, and its wrenches -A^T (penalty Phi + lambda)."""

    loop: LoopClosure
    augmented_loop: LoopClosure
    wrenches: Mapping[str, Block]

    @property
    def name(self) -> str:
        """The joint's."""
        return self.loop.joint.name


def close(k: Kinematics, loop: LoopClosure, penalty: Block) -> Closed:
    """The blocks of a cut joint for its multipliers and the penalty of its residual."""
    b, joint = k.builder, loop.joint
    with b.section("closure", joint.name, "W = -A^T (penalty Phi + lambda)", joint.span.place):
        augmented = b.name(b.add(b.scale(penalty, loop.residual), loop.multipliers), "push", joint.name, rows=loop.names)
        return Closed(loop=loop, augmented_loop=replace(loop, multipliers=augmented), wrenches=constraint_wrenches(k, loop, augmented))


def jacobian(motions: Motions, loop: LoopClosure) -> list[tuple[Motion, Block, Block]]:
    """The motions that a cut joint depends on, with A s by their speeds and by their unknowns, (m, 1)."""
    k, b = motions.k, motions.k.builder
    step = transport(b, k.pole_step(loop.joint.base, loop.joint.follower))
    found = []
    for body, _, path in paths(motions, dict.fromkeys((loop.joint.follower, loop.joint.base), b.zero(6))):
        for m in path:
            if body == loop.joint.follower:
                found.append((m, b.mul(loop.A, m.s), b.mul(loop.A, m.shift)))
            else:
                found.append((m, b.neg(b.mul(loop.A, b.mul(step, m.s))), b.neg(b.mul(loop.A, b.mul(step, m.shift)))))
    return found


def penalty_tangent(motions: Motions, loop: LoopClosure) -> Iterator[tuple[Motion, Motion, Block]]:
    """constraint J^T J: row, column, value."""
    b, columns = motions.k.builder, jacobian(motions, loop)
    for j, by_speed, _ in columns:
        for k, _, by_unknown in columns:
            yield j, k, b.mul(motions.weights.constraint, b.dot(by_speed, by_unknown))


def weights(k: Kinematics, loop: LoopClosure) -> Block:
    """An input w for a cut joint's equations."""
    return k.builder.symbol(f"w:{loop.joint.name}", len(loop.names), BindingTime.ITERATION)


@dataclass(kw_only=True)
class SharedForces(BodySystem):
    """A body system that records the wrench of each element on each of its bodies."""

    wrenches: dict[str, dict[str, Block]] = field(default_factory=dict)

    def copy(self) -> "SharedForces":
        """A copy of a body system, with the forces so far, to which others may be added."""
        return replace(
            self, Q=dict(self.Q), joint_forces=dict(self.joint_forces), cut_joint_wrenches=dict(self.cut_joint_wrenches),
            wrenches={element: dict(wrenches) for element, wrenches in self.wrenches.items()},
        )  # fmt: skip

    def add_force(self, i: str, block: Block) -> None:
        """Q_i += block."""
        wrenches = self.wrenches.setdefault(self.source, {})
        wrenches[i] = self.builder.add(wrenches[i], block) if i in wrenches else block
        super().add_force(i, block)


def paths(motions: Motions, wrenches: Mapping[str, Block]) -> Iterator[tuple[str, Block, list[Motion]]]:
    """Each body and its wrench, with the motions on the path from that body to the common carrier of the element's bodies."""
    chains = [motions.chains.get(body, ()) for body in wrenches]
    common = set(chains[0]).intersection(*chains[1:]) if len(chains) > 1 else set()
    for body, wrench in wrenches.items():
        if body != GROUND:
            yield body, wrench, [m for carrier in motions.chains[body] if carrier not in common for m in motions.of_body[carrier]]


def wrench_tangent(
    motions: Motions, variations: Mapping[tuple[int, int], Variation], wrenches: Mapping[str, Block], *, sees: bool = False
) -> Iterator[tuple[Motion, Motion, Block]]:
    """The entries of the change of one element's wrenches, to be subtracted from the tangent: row, column, value.
    If its law ``sees`` other bodies, all motions contribute."""
    b, is_embedded = motions.k.builder, motions.columns()
    parts = list(paths(motions, wrenches))
    keys = dict.fromkeys(is_embedded) if sees else dict.fromkeys(k.key for _, _, path in parts for k in path)
    for _, wrench, rows in parts:
        for key in keys:
            change, k = variations[key].of(wrench), is_embedded[key][0]
            for j in rows:
                value = b.dot(j.s, change)
                xi = b.total([b.zero(6), *(m.xi for m in is_embedded[key] if motions.carries(m, j))])
                if not is_zero(xi):
                    value = b.add(value, b.dot(motion_cross(b, xi, j.s), wrench))
                if not is_zero(value):
                    yield j, k, value


@dataclass(frozen=True, kw_only=True)
class Composite:
    """A composite body, i.e. a body with all outer bodies: M (6, 6), the columns B (6, 3) by an angular velocity change, F (6, 1)."""

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
    momentum = b.scale(b.add(mass, mass), k.velocity(body.name, c))
    across = b.neg(b.skew(momentum))
    return b.stack([[across], [b.add(b.mul(b.skew(c), across), b.mul(b.skew(w), J))]])


def force_cross(b: Builder, motion: Block, force: Block) -> Block:
    """The spatial cross product v x* f of a velocity and a force: [w x f; v x f + w x n]. Featherstone 2008, eq. 2.32."""
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
        inertial = b.add(b.mul(whole.M, k.c), b.mul(whole.B, turn))
        fixed = b.add(inertial, force_cross(b, k.xi, whole.F))
        for body in motions.chains[k.body]:
            for j in motions.of_body[body]:
                if not motions.carries(k, j):
                    yield j, k, b.dot(j.s, fixed)
    for j in motions.all():
        whole = of[j.body]
        if is_zero(whole.M):
            continue
        row, turning = b.mul(whole.M, j.s), b.mul(b.transpose(whole.B), j.s)
        for body in motions.chains[j.body]:
            for k in motions.of_body[body]:
                if motions.carries(k, j):
                    yield j, k, b.add(b.dot(row, k.c), b.dot(turning, b.take(k.DV, (3, 6))))


def coupled_tangent(motions: Motions, layout: StateLayout, model: Model, system: SharedForces) -> Iterator[Entry]:
    """The tangent's coupling of joints and first-order states: states' equations by motions of joints, and joints' equations by states."""
    b, rates = motions.k.builder, state_rates(motions.k.builder, motions.k.translator, model)
    variations = motions.variations() if model.states else {}
    for place, state in enumerate(model.states, start=layout.speeds):
        change = by_state(b, state.name, motions.weights.damping)
        with b.section("tangent", state.name, "what f changes by motions, and forces by x", state.span.place):
            columns = motions.columns().items()
            yield from ((place, is_embedded[0].row, b.neg(variations[key].of(rates[state.name]))) for key, is_embedded in columns)
            yield from ((row, place, b.neg(entry)) for row, entry in _force_changes(motions, change, system))


def _force_changes(motions: Motions, change: Variation, system: SharedForces) -> Iterator[tuple[int, Block]]:
    """The change of the generalised forces: row, value."""
    b = motions.k.builder
    for wrenches in system.wrenches.values():
        for _, wrench, path in paths(motions, wrenches):
            yield from ((m.row, b.dot(m.s, change.of(wrench))) for m in path)
    for body, force in system.joint_forces.items():
        once = {m.index: m for m in motions.of_body[body]}.values()
        yield from ((m.row, times(b, m.derivative, b.element(change.of(force), m.index))) for m in once)
