"""Cut joints in relative coordinates: the Jacobian by the motions, the wrench of the multipliers, and what the penalty adds to the
tangent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from cutjoint.formulate.implicit.motions import Motion, Motions
from cutjoint.formulate.implicit.wrenches import ways
from cutjoint.formulate.recursive.kinematics import Kinematics
from cutjoint.formulate.recursive.loops import LoopClosure, pulls, transport
from cutjoint.program.blocks import BindingTime, Block


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
