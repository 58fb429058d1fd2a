"""Reported quantities: those of motion and of forces, and those that depend on accelerations.

Kinetic energy and power in relative coordinates, over the bodies' motions Z at their poles::

    T = sum of 1/2 Z^T M Z
    P = sum of Z . Q + sum of tau . rate + sum of W . (Z - Z_p) over guided joints

M and Q exclude the terms of cut joints.  W is the wrench of a guided joint on its outer body: it has the guide's share and that of gears,
whose other share has power at the free joints that they turn.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from cutjoint.formulate.quantities import reading, reported_symbol, rod_force
from cutjoint.formulate.records import energy_results
from cutjoint.formulate.recursive.gears import GearClosure
from cutjoint.formulate.recursive.kinematics import JointMotion, Kinematics, halves
from cutjoint.formulate.recursive.loops import LoopClosure, constraint_wrenches
from cutjoint.formulate.recursive.quantities import Quantities
from cutjoint.model.expressions.quantities import reaction_component
from cutjoint.model.records import GROUND, Joint, Output, Reaction, RodForce
from cutjoint.program.blocks import BindingTime, Block


@dataclass(frozen=True, kw_only=True)
class Reactions:
    """The reactions of all joints, from ``M``, ``Q`` and ``Zdd`` by body, M and Q without the terms of cut joints.
    ``acting`` are the wrenches on the followers of cut joints by forces on their coordinates."""

    kinematics: Kinematics
    loops: tuple[LoopClosure, ...]
    M: Mapping[str, Block]
    Q: Mapping[str, Block]
    Zdd: Mapping[str, Block]
    acting: Mapping[str, Block]

    def component(self, reaction: Reaction, quantity: str) -> Block:
        """The block of one quantity of a reaction."""
        is_moment, direction = reaction_component(reaction, quantity)
        force, moment = self.on_follower[reaction.joint]
        return self.kinematics.builder.dot(self.kinematics.direction(reaction.body, direction), moment if is_moment else force)

    @cached_property
    def on_follower(self) -> dict[str, tuple[Block, Block]]:
        """The force of each joint on its follower and the moment about the follower's point, (3, 1) each."""
        b, found = self.kinematics.builder, {}
        for loop, wrenches in zip(self.loops, self._constraint_wrenches, strict=True):
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
    def _constraint_wrenches(self) -> list[dict[str, Block]]:
        b, found = self.kinematics.builder, []
        for loop in self.loops:
            with b.section("reaction", loop.joint.name, "W = -A^T lambda", loop.joint.span.place):
                found.append(constraint_wrenches(self.kinematics, loop, loop.multipliers))
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
                constraint = [wrenches[body] for wrenches in self._constraint_wrenches if body in wrenches and body != GROUND]
                carried[body] = b.name(b.sub(b.total([inertial, *outer]), b.total([b.zero(6), *constraint])), "W", body)
        return carried


@dataclass(frozen=True, kw_only=True)
class Reporter(Quantities):
    """Knows every quantity of one formulation; ``Zdd`` are the bodies' accelerations from given joint accelerations."""

    loops: tuple[LoopClosure, ...]
    gears: tuple[GearClosure, ...]
    Zdd: Mapping[str, Block]
    reactions: Reactions

    def quantity(self, output: Output) -> Block:
        b, translator = self.kinematics.builder, self.kinematics.translator
        reaction = next((r for r in self.model.reactions if r.name == output.element), None)
        if isinstance(reaction, RodForce):
            of = {loop.joint.name: loop.multipliers for loop in self.loops}
            return rod_force(b, translator, reaction, of.__getitem__)
        if reaction is not None:
            return self.reactions.component(reaction, output.quantity)
        for gear in self.gears:
            if gear.element.name == output.element:
                return b.neg(gear.multipliers)
        if (symbol := reported_symbol(self.model, output.element)) is not None:
            return reading(b, translator, self.model, self.quantity).scalar(symbol)
        return super().quantity(output)

    def acceleration(self, body: str, at: Block) -> Block:
        k, b = self.kinematics, self.kinematics.builder
        (a0, wd), (_, w) = halves(b, self.Zdd[body]), halves(b, k.frames[body].Z)
        return b.add(a0, b.add(b.cross(wd, at), b.cross(w, k.velocity(body, at))))


def prescribed_accelerations(k: Kinematics) -> dict[str, Block]:
    """Zdd of every body when the joints' accelerations are inputs."""
    speeds = {motion.chart.joint: len(motion.chart.speed_names) for motion in k.motions.values() if motion.chart is not None}
    return accelerations_of(k, lambda joint: k.builder.symbol(f"vdot:{joint}", speeds[joint], BindingTime.ITERATION))


def accelerations_of(k: Kinematics, vdot: Callable[[str], Block]) -> dict[str, Block]:
    """Zdd of every body from the accelerations of each joint that has any."""
    b = k.builder
    Zdd = {"ground": b.zero(6)}
    for body, motion in k.motions.items():
        above = b.add(Zdd[motion.tree_joint.parent], motion.d)
        if motion.b is not None and motion.chart is not None:
            above = b.add(above, b.mul(motion.b, k.for_subspace(body, vdot(motion.chart.joint))))
        if motion.follows is not None:
            independent = k.topology.model.dependent_joints[motion.tree_joint.joint.name].independent
            above = b.add(above, b.scale(vdot(independent), motion.follows))
        Zdd[body] = above
    return Zdd


def derive_energy(k: Kinematics, reactions: Reactions, joint_forces: Mapping[str, Block], gears: Sequence[GearClosure]) -> dict[str, Block]:
    """The results of the function ``energy``; ``joint_forces`` act on the coordinates of tree joints, by the bodies that these carry."""
    b = k.builder
    with b.section("energy", "", "T = 1/2 sum of Z^T M Z,  P = sum of Z . Q + tau . rate + W . (Z - Z_p) of guided joints", ""):
        twice = b.total([b.zero(1), *(b.dot(k.frames[body].Z, b.mul(reactions.M[body], k.frames[body].Z)) for body in k.motions)])
        rotors = [(armature, k.motions[body]) for body in k.motions if (armature := k.armature(body)) is not None]
        twice = b.total([twice, *(b.mul(armature, b.mul(motion.rate[0], motion.rate[0])) for armature, motion in rotors)])
        kinetic = b.mul(b.number(0.5), twice)
        powers = [b.dot(k.frames[body].Z, reactions.Q[body]) for body in k.motions]
        driven = [b.dot(b.column(k.motions[body].rate), force) for body, force in joint_forces.items()]
        wound = [b.mul(armature, b.mul(m.rate[0], m.acceleration[0])) for armature, m in rotors if m.acceleration]
        power = b.total([b.zero(1), *powers, *driven, *wound, *_guides(k, reactions), *_teeth(k, gears)])
    return energy_results(b, kinetic, power)


def _is_guided(motion: JointMotion) -> bool:
    return motion.tree_joint.joint.guide is not None


def _guides(k: Kinematics, reactions: Reactions) -> Iterator[Block]:
    """W . (Z - Z_p) of guided joints, except those that are fixed while the functions of embedded loops are valid."""
    ranges = {a.drive: a.functions.drive_range for a in k.topology.model.embedded_loops}
    still = {drive for drive, found in ranges.items() if found is not None and found.half == 0}
    for body, motion in k.motions.items():
        if _is_guided(motion) and motion.tree_joint.joint.name not in still:
            twist = k.builder.sub(k.frames[body].Z, k.frames[motion.tree_joint.parent].Z)
            yield k.builder.dot(twist, reactions.carried[body])


def _teeth(k: Kinematics, gears: Sequence[GearClosure]) -> Iterator[Block]:
    """The power at free joints of gears that have guided coordinates too; the teeth of others have none in all."""
    b, guided = k.builder, {m.tree_joint.joint.name for m in k.motions.values() if _is_guided(m)}
    for gear in gears:
        if any(coordinate.joint in guided for coordinate, _ in gear.gear.terms):
            speed = b.total([b.zero(1), *(b.mul(factor, k.motions[body].rate[place]) for body, (place, factor) in gear.row.items())])
            yield b.neg(b.mul(gear.multipliers, speed))
