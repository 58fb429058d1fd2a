"""Reactions of joints: the wrench of a joint on its follower.

A cut joint has its multipliers.  A tree joint carries the bodies of its subtree, whose Newton-Euler equations give its wrench on the
outer body; a cut joint within the subtree adds nothing to the sum, one that leaves it what it does to the end inside::

    cut joint:   W = -A^T lambda + what acts on its coordinates
    tree joint:  W_i = M Zdd - Q + sum of A^T lambda + sum of W_j        over the cut joints at body i and the bodies j that it carries

Forces on a tree joint's own coordinates and the teeth of its gears are parts of W: b^T W is their sum.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from cutjoint.formulate.recursive.kinematics import Kinematics, halves
from cutjoint.formulate.recursive.loops import LoopClosure, pulls
from cutjoint.model.quantities import reaction_component
from cutjoint.model.records import GROUND, Joint, Reaction
from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class Reactions:
    """Knows the reactions of all joints; ``M``, ``Q`` and ``Zdd`` by body, without what cut joints add to M and Q; ``acting`` are the
    wrenches on the followers of cut joints by forces on their coordinates."""

    kinematics: Kinematics
    loops: tuple[LoopClosure, ...]
    M: Mapping[str, Block]
    Q: Mapping[str, Block]
    Zdd: Mapping[str, Block]
    acting: Mapping[str, Block]

    def component(self, reaction: Reaction, quantity: str) -> Block:
        """The block of one quantity of a reaction."""
        is_moment, direction = reaction_component(reaction, quantity)
        force, moment = self._on_follower[reaction.joint]
        return self.kinematics.builder.dot(self.kinematics.direction(reaction.body, direction), moment if is_moment else force)

    @cached_property
    def _on_follower(self) -> dict[str, tuple[Block, Block]]:
        """Force and moment about the follower's point by joint, (3, 1) each."""
        b, found = self.kinematics.builder, {}
        for loop, wrenches in zip(self.loops, self._pulls, strict=True):
            name, wrench = loop.joint.name, wrenches[loop.joint.follower]
            wrench = b.add(wrench, self.acting[name]) if name in self.acting else wrench
            found[name] = self._at_point(loop.joint, loop.joint.follower, wrench)
        for body, motion in self.kinematics.motions.items():
            joint, wrench = motion.tree_joint.joint, self.carried[body]
            found[joint.name] = self._at_point(joint, body, wrench if body == joint.follower else b.neg(wrench))
        return found

    def _at_point(self, joint: Joint, body: str, wrench: Block) -> tuple[Block, Block]:
        """Force and moment about the follower's point from a wrench at the pole of a body."""
        b, k = self.kinematics.builder, self.kinematics
        with b.section("reaction", joint.name, "f, n - p x f", joint.span.place):
            force, moment = halves(b, wrench)
            point = b.add(k.point(joint.follower, joint.at if joint.to is None else joint.to), k.pole_step(body, joint.follower))
            return b.name(force, "reaction_force", joint.name), b.name(b.sub(moment, b.cross(point, force)), "reaction_moment", joint.name)

    @cached_property
    def _pulls(self) -> list[dict[str, Block]]:
        """The wrenches of each cut joint on its bodies."""
        b, found = self.kinematics.builder, []
        for loop in self.loops:
            with b.section("reaction", loop.joint.name, "W = -A^T lambda", loop.joint.span.place):
                found.append(pulls(self.kinematics, loop, loop.multipliers))
        return found

    @cached_property
    def carried(self) -> dict[str, Block]:
        """The wrench of each body's joint on it, at its pole."""
        b, carried = self.kinematics.builder, dict[str, Block]()
        for body, motion in reversed(self.kinematics.motions.items()):
            joint = motion.tree_joint.joint
            with b.section("reaction", joint.name, "W = M Zdd - Q + sum of A^T lambda + sum of W", joint.span.place):
                inertial = b.sub(b.mul(self.M[body], self.Zdd[body]), self.Q[body])
                outer = [carried[child] for child in carried if self.kinematics.motions[child].tree_joint.parent == body]
                pulled = [wrenches[body] for wrenches in self._pulls if body in wrenches and body != GROUND]
                carried[body] = b.name(b.sub(b.total([inertial, *outer]), b.total([b.zero(6), *pulled])), "W", body)
        return carried
