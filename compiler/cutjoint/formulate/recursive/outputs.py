"""Reported quantities: motion of bodies and markers, joint coordinates, forces, reactions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.elements.joint import rate_name
from cutjoint.formulate.attitude import ATTITUDE, attitude
from cutjoint.formulate.recursive.coordinates import measure, tree_motion
from cutjoint.formulate.recursive.forces import Forces
from cutjoint.formulate.recursive.gears import GearClosure
from cutjoint.formulate.recursive.kinematics import Kinematics, halves
from cutjoint.formulate.recursive.loops import LoopClosure
from cutjoint.formulate.recursive.reactions import Reactions
from cutjoint.model.records import SPEEDS, Model, Output, RodForce, Vector
from cutjoint.program.blocks import BindingTime, Block


@dataclass(frozen=True, kw_only=True)
class Reporter:
    """Knows every quantity of one formulation; ``Zdd`` are the bodies' accelerations from given joint accelerations."""

    model: Model
    kinematics: Kinematics
    forces: Forces
    loops: tuple[LoopClosure, ...]
    gears: tuple[GearClosure, ...]
    Zdd: Mapping[str, Block]
    reactions: Reactions

    def quantity(self, output: Output) -> Block:
        """The block of one output; zero for a force that the scene has switched off or that a guard stands for."""
        element = output.element
        for body in self.model.bodies:
            if body.name == element:
                return self._motion(element, body.centre_of_mass, output.quantity)
        for marker in self.model.markers:
            if marker.name == element:
                return self._motion(marker.body, marker.point, output.quantity)
        for reaction in self.model.reactions:
            if reaction.name == element:
                return self._rods(reaction) if isinstance(reaction, RodForce) else self.reactions.component(reaction, output.quantity)
        if any(force.name == element for force in self.model.force_elements):
            return self.forces.quantities.get(element, {}).get(output.quantity, self.kinematics.builder.zero(1))
        for gear in self.gears:
            if gear.element.name == element:
                return self.kinematics.builder.neg(gear.multipliers)
        return self._joint(output)

    def _motion(self, body: str, point: Vector, quantity: str) -> Block:
        k, b = self.kinematics, self.kinematics.builder
        at = k.point(body, point)
        if quantity in ATTITUDE:
            return attitude(b, k.frames[body].R, quantity)
        axis = "xyz".index(quantity[-1])
        match quantity[:-1]:
            case "":
                return b.element(k.absolute(body, at), axis)
            case "v":
                return b.element(k.velocity(body, at), axis)
            case "w":
                return b.element(k.frames[body].Z, 3 + axis)
            case "a":
                (a0, wd), (_, w) = halves(b, self.Zdd[body]), halves(b, k.frames[body].Z)
                carried = b.add(b.cross(wd, at), b.cross(w, k.velocity(body, at)))
                return b.element(b.add(a0, carried), axis)
        raise ValueError(f"a body has no quantity {quantity}")

    def _rods(self, sensor: RodForce) -> Block:
        """The residual of a distance is in m: its multiplier pulls."""
        k, b = self.kinematics, self.kinematics.builder
        loops = {loop.joint.name: loop for loop in self.loops}
        return b.neg(b.total([b.scale(k.translator.scalar(weight), loops[rod].multipliers) for rod, weight in sensor.pushes]))

    def _joint(self, output: Output) -> Block:
        motion = tree_motion(self.kinematics, output.element)
        if motion is not None and output.quantity in (speeds := SPEEDS[motion.tree_joint.joint.kind]):
            return motion.rate[speeds.index(output.quantity)]
        joint = next(joint for joint in self.model.joints if joint.name == output.element)
        rates = {rate_name(coordinate): coordinate for coordinate in joint.element.coordinates}
        measured = measure(self.kinematics, joint.name, rates.get(output.quantity, output.quantity))
        block = measured.rate if output.quantity in rates else measured.position
        if block is None:
            raise ValueError(f"joint '{output.element}' has no quantity '{output.quantity}'")
        return block


def given_accelerations(k: Kinematics) -> dict[str, Block]:
    """Zdd of every body when the joints' accelerations are inputs."""
    b = k.builder
    Zdd = {"ground": b.zero(6)}
    for body, motion in k.motions.items():
        above = b.add(Zdd[motion.tree_joint.parent], motion.d)
        if motion.b is not None and motion.chart is not None:
            vdot = b.symbol(f"vdot:{motion.chart.joint}", len(motion.chart.speed_names), BindingTime.ITERATION)
            above = b.add(above, b.mul(motion.b, vdot))
        Zdd[body] = above
    return Zdd
