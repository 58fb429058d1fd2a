"""The quantities of motion and of forces in natural coordinates: bodies and markers, joint coordinates, forces, states and signals."""

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.formulate.inputs import guide_rates
from cutjoint.formulate.natural.motion import Motion, NodeMotions
from cutjoint.formulate.natural.nodes import Form, difference
from cutjoint.formulate.quantities import named_quantity, reading
from cutjoint.formulate.recursive.kinematics import ATTITUDE, attitude
from cutjoint.kernels.joints import slide_axis
from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.records import Joint, Model, Output, Vector
from cutjoint.program.blocks import BindingTime, Block


@dataclass(frozen=True, kw_only=True)
class NaturalQuantities:
    """Knows the quantities that follow from coordinates, speeds and states; ``forces`` has those of forces that have acted."""

    model: Model
    motions: NodeMotions
    forces: Mapping[str, Mapping[str, Block]]

    def quantity(self, output: Output) -> Block:
        """The block of one output."""
        value = named_quantity(self.motions.builder, self.motions.translator, self.model, output, self.forces, self._motion)
        return self._joint(next(j for j in self.model.joints if j.name == output.element), output.quantity) if value is None else value

    def _axes(self, body: str) -> tuple[Form, Form, Form]:
        x, y, z = (self.motions.layout.direction(body, axis) for axis in GLOBAL_AXES)
        return x, y, z

    def _motion(self, body: str, point: Vector, quantity: str) -> Block:
        b = self.motions.builder
        if quantity in ATTITUDE:
            return attitude(b, b.stack([[self.motions.of(axis).x for axis in self._axes(body)]]), quantity)
        axis, kind = "xyz".index(quantity[-1]), quantity[:-1]
        if kind == "w":
            return b.element(self.motions.spin(body, self._axes(body)), axis)
        motion = self.motions.point(body, point)
        return b.element({"": motion.x, "v": motion.v, "a": motion.a}[kind], axis)

    def _joint(self, joint: Joint, quantity: str) -> Block:
        if quantity in ("wx", "wy", "wz"):
            return self._relative_spin(joint, "xyz".index(quantity[-1]))
        is_rate = quantity not in joint.element.coordinates
        names = joint.element.speeds if is_rate else joint.element.coordinates
        coordinate = joint.element.coordinates[names.index(quantity)]
        if joint.guide is not None:
            return self._guided(joint, coordinate, is_rate)
        if (joint.name, coordinate) in self.motions.layout.angles:
            motion = self.motions.node(self.motions.layout.angles[joint.name, coordinate])
        else:
            motion = self._slide(joint, coordinate)
        return motion.v if is_rate else motion.x

    def _guided(self, joint: Joint, coordinate: str, is_rate: bool) -> Block:
        assert joint.guide is not None
        guide = joint.guide[joint.element.coordinates.index(coordinate)]
        place, rate, _ = (self.motions.translator.scalar(e) for e in guide_rates(guide, self.model))
        return self.motions.builder.mul(self.motions.builder.symbol("motion", 1, BindingTime.STEP), rate) if is_rate else place

    def _slide(self, joint: Joint, coordinate: str) -> Motion:
        b, layout = self.motions.builder, self.motions.layout
        base, follower = layout.slide_ends(joint)
        displacement = self.motions.of(difference(layout.point(follower, joint.at), layout.point(base, joint.at)))
        axis = self.motions.direction(base, slide_axis(joint, coordinate))
        rate = b.add(b.dot(displacement.x, axis.v), b.dot(displacement.v, axis.x))
        return Motion(x=b.dot(displacement.x, axis.x), v=rate, a=b.zero(1))

    def _relative_spin(self, joint: Joint, axis: int) -> Block:
        """An element of the outer body's angular velocity against the inner one, in the latter's axes."""
        b, (inner, outer) = self.motions.builder, self.motions.layout.outwards[joint.name]
        spin = b.sub(self.motions.spin(outer, self._axes(outer)), self.motions.spin(inner, self._axes(inner)))
        return b.dot(self.motions.direction(inner, GLOBAL_AXES[axis]).x, spin)


def let_laws_read(motions: NodeMotions, model: Model, forces: Mapping[str, Mapping[str, Block]]) -> None:
    """Give the translator of laws the quantities of motion, and of ``forces``, which grow as they act."""
    known = NaturalQuantities(model=model, motions=motions, forces=forces)
    motions.translator = reading(motions.builder, motions.translator, model, known.quantity)
