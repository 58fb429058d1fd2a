"""Kinetic energy and power in relative coordinates, over the bodies' motions Z at their poles::

    T = sum of 1/2 Z^T M Z
    P = sum of Z . Q + sum of tau . rate + sum of W . (Z - Z_p) over guided joints

M and Q are without what cut joints add.  W is the wrench of a guided joint on its outer body: it has the guide's share and that of gears,
whose other share has power at the free joints that they turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from cutjoint.formulate.recursive.gears import GearClosure
from cutjoint.formulate.recursive.kinematics import JointMotion, Kinematics
from cutjoint.formulate.recursive.outputs import Reactions
from cutjoint.formulate.system import energy_results
from cutjoint.program.blocks import Block


def derive_energy(
    k: Kinematics, reactions: Reactions, joint_forces: Mapping[str, Block], gears: Sequence[GearClosure]
) -> dict[str, Block]:  # fmt: skip
    """The results of the function ``energy``; ``joint_forces`` act on the coordinates of tree joints, by the bodies that these carry."""
    b = k.builder
    with b.section("energy", "", "T = 1/2 sum of Z^T M Z,  P = sum of Z . Q + tau . rate + W . (Z - Z_p) of guided joints", ""):
        twice = b.total([b.zero(1), *(b.dot(k.frames[body].Z, b.mul(reactions.M[body], k.frames[body].Z)) for body in k.motions)])
        kinetic = b.mul(b.number(0.5), twice)
        pushed = [b.dot(k.frames[body].Z, reactions.Q[body]) for body in k.motions]
        driven = [b.dot(b.column(k.motions[body].rate), force) for body, force in joint_forces.items()]
        power = b.total([b.zero(1), *pushed, *driven, *_guides(k, reactions), *_teeth(k, gears)])
    return energy_results(b, kinetic, power)


def _is_guided(motion: JointMotion) -> bool:
    return motion.tree_joint.joint.guide is not None


def _guides(k: Kinematics, reactions: Reactions) -> Iterator[Block]:
    """W . (Z - Z_p) of guided joints."""
    for body, motion in k.motions.items():
        if _is_guided(motion):
            way = k.builder.sub(k.frames[body].Z, k.frames[motion.tree_joint.parent].Z)
            yield k.builder.dot(way, reactions.carried[body])


def _teeth(k: Kinematics, gears: Sequence[GearClosure]) -> Iterator[Block]:
    """The power at free joints of gears that have guided coordinates too; the teeth of others have none in all."""
    b, guided = k.builder, {m.tree_joint.joint.name for m in k.motions.values() if _is_guided(m)}
    for gear in gears:
        if any(coordinate.joint in guided for coordinate, _ in gear.gear.terms):
            speed = b.total([b.zero(1), *(b.mul(factor, k.motions[body].rate[place]) for body, (place, factor) in gear.row.items())])
            yield b.neg(b.mul(gear.multipliers, speed))
