"""Gears in relative coordinates: they act on their joints' coordinates alone, and their Jacobian changes with these by laws."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from cutjoint.formulate.implicit.motions import Motion, Motions
from cutjoint.formulate.recursive.gears import GearClosure
from cutjoint.formulate.recursive.kinematics import Kinematics
from cutjoint.program.blocks import BindingTime, Block


def push_joints(k: Kinematics, gears: Sequence[GearClosure], pushes: Sequence[Block]) -> dict[str, Block]:
    """The sum of J^T push over gears by the body of each joint, of all its speeds."""
    b = k.builder
    forces: dict[str, Block] = {}
    for gear, push in zip(gears, pushes, strict=True):
        for body in gear.row:
            motion = k.motions[body]
            share = b.mul(b.transpose(gear.columns(b, body, len(motion.speed_names))), push)
            forces[body] = b.add(forces[body], share) if body in forces else share
    return forces


def weighted_push(k: Kinematics, gear: GearClosure, penalty: Block) -> Block:
    """penalty Phi + lambda."""
    b, name = k.builder, gear.element.name
    with b.section("closure", name, "penalty Phi + lambda", gear.element.span.place):
        return b.name(b.add(b.scale(penalty, gear.residual), gear.multipliers), "push", name, rows=gear.names)


def change(k: Kinematics, gear: GearClosure, x: Mapping[str, Block]) -> Block:
    """J x of columns (speeds, 1) by joint."""
    b = k.builder
    parts = [(k.motions[body].tree_joint.joint.name, place, factor) for body, (place, factor) in gear.row.items()]
    return b.total([b.mul(factor, b.element(x[joint], place)) for joint, place, factor in parts])


def speed_inputs(k: Kinematics) -> dict[str, Block]:
    """The accelerations, or what stands in their place, by joint."""
    b, charts = k.builder, [motion.chart for motion in k.motions.values() if motion.chart is not None]
    return {c.joint: b.symbol(f"vdot:{c.joint}", len(c.speed_names), BindingTime.ITERATION) for c in charts}


def gear_tangent(motions: Motions, gear: GearClosure, push: Block) -> Iterator[tuple[Motion, Motion, Block]]:
    """constraint J^T J, and stiffness times the change of J^T ``push``: row, column, value; of motions that share a coordinate one stands
    for all."""
    b = motions.k.builder
    ends, bends = (
        [(next(m for m in motions.of_body[body] if m.index == place), factor) for body, (place, factor) in of.items()]
        for of in (gear.row, gear.bend)
    )
    for j, first in ends:
        for k, second in ends:
            yield j, k, b.mul(motions.weights.constraint, b.mul(first, second))
    for j, bent in bends:
        yield j, j, b.mul(motions.weights.stiffness, b.mul(bent, push))


def weights(k: Kinematics, gear: GearClosure) -> Block:
    """An input w for a gear's equation."""
    return k.builder.symbol(f"w:{gear.element.name}", len(gear.names), BindingTime.ITERATION)
