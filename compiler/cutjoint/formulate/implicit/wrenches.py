"""Contributions of force elements and cut joints to the balance and to its tangent.

An element acts on one body or on two.  Two bodies that both move along with a motion feel no change from it, seen from them; so only
motions on the way between the element's bodies count, on which its wrench W and the columns s of the motions change:

    D_k (s_j^T W) = s_j^T D_k W + (xi_k x s_j)^T W          the last where k carries j along
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from cutjoint.formulate.implicit.motions import Motion, Motions
from cutjoint.formulate.recursive.kinematics import Kinematics, motion_cross
from cutjoint.formulate.recursive.loops import LoopClosure, pulls, transport
from cutjoint.formulate.recursive.recursion import BodySystem
from cutjoint.model.records import GROUND
from cutjoint.program.blocks import BindingTime, Block, is_zero
from cutjoint.program.vary import Variation


@dataclass(frozen=True, kw_only=True)
class Closed:
    """A cut joint with residual Phi, and its wrenches -A^T (penalty Phi + lambda) on the bodies."""

    loop: LoopClosure
    wrenches: Mapping[str, Block]

    @property
    def name(self) -> str:
        """The joint's."""
        return self.loop.joint.name


def close(k: Kinematics, loop: LoopClosure, penalty: Block) -> Closed:
    """A cut joint under its multipliers and the penalty of its residual."""
    b, joint = k.builder, loop.joint
    with b.section("closure", joint.name, "W = -A^T (penalty Phi + lambda)", joint.span.place):
        push = b.name(b.add(b.scale(penalty, loop.residual), loop.multipliers), "push", joint.name, rows=loop.names)
        return Closed(loop=loop, wrenches=pulls(k, loop, push))


def jacobian(motions: Motions, loop: LoopClosure) -> list[tuple[Motion, Block, Block]]:
    """The motions that a cut joint depends on, with A s by their speeds and by their unknowns, (m, 1)."""
    k, b = motions.k, motions.k.builder
    step = transport(b, k.pole_step(loop.joint.base, loop.joint.follower))
    found = []
    for body, _, way in ways(motions, dict.fromkeys((loop.joint.follower, loop.joint.base), b.zero(6))):
        for m in way:
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
    """A body system that remembers each element's part in the forces: by element, its wrench on each of its bodies."""

    wrenches: dict[str, dict[str, Block]] = field(default_factory=dict)

    def add_force(self, i: str, block: Block) -> None:
        """Q_i += block."""
        wrenches = self.wrenches.setdefault(self.source, {})
        wrenches[i] = self.builder.add(wrenches[i], block) if i in wrenches else block
        super().add_force(i, block)


def ways(motions: Motions, wrenches: Mapping[str, Block]) -> Iterator[tuple[str, Block, list[Motion]]]:
    """Body, wrench, and the motions on the way from it to what the element's bodies are carried by in common."""
    chains = [motions.chains.get(body, ()) for body in wrenches]
    common = set(chains[0]).intersection(*chains[1:]) if len(chains) > 1 else set()
    for body, wrench in wrenches.items():
        if body != GROUND:
            yield body, wrench, [m for carrier in motions.chains[body] if carrier not in common for m in motions.of_body[carrier]]


def wrench_tangent(
    motions: Motions, variations: Mapping[tuple[int, int], Variation], wrenches: Mapping[str, Block]
) -> Iterator[tuple[Motion, Motion, Block]]:
    """The entries that the change of one element's wrenches makes, to be taken from the tangent: row, column, value."""
    b = motions.k.builder
    parts = list(ways(motions, wrenches))
    columns = {k.key: k for _, _, way in parts for k in way}
    for _, wrench, rows in parts:
        for k in columns.values():
            change = variations[k.key].of(wrench)
            for j in rows:
                value = b.dot(j.s, change)
                if motions.turns(k, j) and not is_zero(k.xi):
                    value = b.add(value, b.dot(motion_cross(b, k.xi, j.s), wrench))
                if not is_zero(value):
                    yield j, k, value
