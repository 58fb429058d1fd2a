"""The quantities of motion and of forces: bodies and markers, joint coordinates, forces, states and signals."""

from __future__ import annotations

from dataclasses import dataclass, field

from cutjoint.elements.joint import rate_name
from cutjoint.formulate.quantities import named_quantity, reading
from cutjoint.formulate.recursive.coordinates import measure, tree_motion
from cutjoint.formulate.recursive.kinematics import ATTITUDE, Kinematics, attitude
from cutjoint.model.records import SPEEDS, Model, Output, Vector
from cutjoint.program.blocks import Block, Builder


@dataclass(kw_only=True)
class Forces:
    """Reported quantities by element and name."""

    quantities: dict[str, dict[str, Block]] = field(default_factory=dict)

    def add(self, b: Builder, element: str, quantities: dict[str, Block]) -> None:
        """The quantities of an element, each under its name."""
        self.quantities[element] = quantities
        for quantity, block in quantities.items():
            b.name(block, quantity, element)


@dataclass(frozen=True, kw_only=True)
class Quantities:
    """Knows the quantities that follow from coordinates, speeds and states; those of ``forces`` that have acted."""

    model: Model
    kinematics: Kinematics
    forces: Forces

    def quantity(self, output: Output) -> Block:
        """The block of one output; zero for a force that the scene has switched off or that a guard stands for."""
        element = output.element
        for body in self.model.bodies:
            if body.name == element:
                return self._motion(element, body.centre_of_mass, output.quantity)
        for marker in self.model.markers:
            if marker.name == element:
                return self._motion(marker.body, marker.point, output.quantity)
        if any(force.name == element for force in self.model.force_elements):
            return self.forces.quantities.get(element, {}).get(output.quantity, self.kinematics.builder.zero(1))
        value = named_quantity(self.kinematics.translator, self.model, output)
        return self._joint(output) if value is None else value

    def _motion(self, body: str, point: Vector, quantity: str) -> Block:
        k, b = self.kinematics, self.kinematics.builder
        at = k.point(body, point)
        if quantity in ATTITUDE:
            return attitude(b, k.in_global(k.frames[body].R), quantity)
        axis = "xyz".index(quantity[-1])
        match quantity[:-1]:
            case "":
                return b.element(k.absolute(body, at), axis)
            case "v":
                return b.element(k.in_global(k.velocity(body, at)), axis)
            case "w":
                return b.element(k.in_global(b.take(k.frames[body].Z, (3, 6))), axis)
            case "a":
                return b.element(k.in_global(self.acceleration(body, at)), axis)
        raise ValueError(f"a body has no quantity {quantity}")

    def acceleration(self, body: str, at: Block) -> Block:
        """The acceleration of the body's point that stands at ``at`` from the pole."""
        raise NotImplementedError

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


def let_laws_read(k: Kinematics, model: Model, forces: Forces) -> None:
    """Give the translator of laws the quantities of motion, and of forces as soon as they have acted."""
    k.translator = reading(k.builder, k.translator, model, Quantities(model=model, kinematics=k, forces=forces).quantity)
