"""The quantities of motion and of forces: bodies and markers, joint coordinates, forces, states and signals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256

from cutjoint.elements.joint import rate_name
from cutjoint.formulate.layout import Slot
from cutjoint.formulate.quantities import named_quantity, reading
from cutjoint.formulate.records import POSES, Function
from cutjoint.formulate.recursive.coordinates import measure, tree_motion
from cutjoint.formulate.recursive.kinematics import ATTITUDE, Kinematics, attitude, halves
from cutjoint.model.records import SPEEDS, Model, Output, Vector
from cutjoint.program.blocks import Block, Builder

#: The numbers of one: a point's position, the rotation by columns, the point's velocity, the angular velocity, all in global axes, and
#: the point in the design position, of a contact 0.
LENGTH = 3 + 9 + 3 + 3 + 3
#: The numbers of a pose that hosts get: position, attitude, velocity, angular velocity, and the point in the design position.
NUMBERS_PER_POSE = 16


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
        """The block of one output."""
        k = self.kinematics
        value = named_quantity(k.builder, k.translator, self.model, output, self.forces.quantities, self._motion)
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


def digest_of_poses(model: str, names: Sequence[str]) -> int:
    """A 64-bit digest of the poses of a model and of elements with these names."""
    return int.from_bytes(sha256("\n".join((model, *names)).encode()).digest()[:8], "little")


def posed_elements(model: Model) -> tuple[str, ...]:
    """The names of elements that have a pose: bodies, markers, and wheels on the road."""
    wheels = (force.name for force in model.forces if force.has_road)
    return (*(body.name for body in model.bodies), *(marker.name for marker in model.markers), *wheels)


@dataclass(frozen=True, kw_only=True)
class ContactFrame:
    """The contact of a wheel, where its plane meets the road, ``at`` (3, 1) from the pole of its ``body``.
    ``axes`` (3, 3) are columns: the rolling direction, to the left in the road's plane, and the road's normal."""

    body: str
    at: Block
    axes: Block


def poses_function(k: Kinematics, model: Model, contacts: Mapping[str, ContactFrame]) -> tuple[Function, ...]:
    """The function, for the model's bodies and markers in that order, then for the ``contacts`` of wheels by their names."""
    points = {body.name: (body.name, body.centre_of_mass) for body in model.bodies}
    points |= {marker.name: (marker.body, marker.point) for marker in model.markers}
    results = {f"pose:{name}": _pose(k, body, k.point(body, p), k.frames[body].R, k.vector(p)) for name, (body, p) in points.items()}
    results |= {f"pose:{name}": _pose(k, c.body, c.at, c.axes, k.builder.zero(3)) for name, c in contacts.items()}
    return (Function(name=POSES, arguments=("const Real* q", "const Real* v", "Real* pose"), results=results),)


def pose_slots(model: Model) -> dict[str, Slot]:
    """The places of the results."""
    names = tuple(str(i) for i in range(LENGTH))
    return {f"pose:{name}": Slot(array="pose", offset=i * LENGTH, names=names) for i, name in enumerate(posed_elements(model))}


def _pose(k: Kinematics, body: str, at: Block, axes: Block, design: Block) -> Block:
    """The pose of ``axes`` at a point of a body, ``at`` from its pole, with the motion of the body there."""
    b, (_, spin) = k.builder, halves(k.builder, k.frames[body].Z)
    R = k.in_global(axes)
    columns = [b.take(R, (0, 3), (j, j + 1)) for j in range(3)]
    return b.stack([[part] for part in (k.absolute(body, at), *columns, k.in_global(k.velocity(body, at)), k.in_global(spin), design)])
