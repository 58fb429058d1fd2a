"""Mirror images of elements, for instances with ``mirror``.

Points, translation axes and forces mirror as vectors; axes of rotation and torques mirror as pseudo-vectors,
so that a positive angle of the image is the image of a positive angle.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from cutjoint.elements.force import Mirror
from cutjoint.elements.joint import DESIGN_FRAME, Direction, Translation
from cutjoint.model.elements.build import Elements
from cutjoint.model.elements.geometry import least_component
from cutjoint.model.expressions.parse import POSITION
from cutjoint.model.expressions.quantities import Element as Quantified
from cutjoint.model.expressions.scope import FAILED
from cutjoint.model.records import Body, Force, Gear, Joint, Marker, Reaction, Visual

ANGLES: Mapping[str, str] = {"x": "roll", "y": "pitch", "z": "yaw"}  #: the angles of a body by the axis that each turns about


@dataclass(frozen=True)
class Image:
    """The signs of quantities in the image of a reflection along ``axis``, and those of ``joints`` by name, relative to the original."""

    axis: str
    joints: Mapping[str, Joint]

    def sign(self, element: Quantified, quantity: str) -> int:
        """1 where a quantity of an element of the image is that of the original, -1 where it is its opposite."""
        match element:
            case Joint():
                return self._of_joint(element, quantity)
            case Force():
                joint = self.joints.get(element.joint_of)
                return element.image_sign(quantity, self.of_component, self._of_joint(joint, element.coordinate_of) if joint else 1)
            case Body() | Marker() | Reaction(direction=None):
                return self.of_component(quantity)
            case Reaction():
                return -1 if quantity == "moment" else 1
            case Gear():
                joint = self.joints.get(element.first.joint)
                return self._of_joint(joint, element.first.name) if joint else 1
        return 1

    def _of_joint(self, joint: Joint, quantity: str) -> int:
        if quantity in ("wx", "wy", "wz"):
            return self.of_component(quantity)
        return coordinate_signs(mirror_along(self.axis), joint).get(quantity.removesuffix("_rate"), 1)

    def of_component(self, quantity: str) -> int:
        """The sign of a component of a vector (x, vy, az, Fx), of an angle (roll) or of a rotational quantity (wx, Mz, rz)."""
        turns = {**{angle: axis for axis, angle in ANGLES.items()}, **{f"{name}{axis}": axis for name in "wMr" for axis in "xyz"}}
        if quantity in turns:
            return 1 if turns[quantity] == self.axis else -1
        return -1 if quantity[-1] == self.axis else 1


def mirror_along(axis: str) -> Mirror:
    """The reflection along "x", "y" or "z"."""
    x, y, z = (-1 if name == axis else 1 for name in "xyz")
    return Mirror((x, y, z))


def mirror_elements(elements: Elements, axis: str) -> Elements:
    """The image of all elements under reflection along "x", "y" or "z"."""
    mirror = mirror_along(axis)
    signs = {joint.name: coordinate_signs(mirror, joint) for joint in elements.joints}
    return Elements(
        tuple(_body(mirror, body) for body in elements.bodies),
        tuple(_joint(mirror, joint, signs[joint.name]) for joint in elements.joints),
        tuple(force.mirrored(mirror, signs) for force in elements.forces),
        tuple(r if r.direction is None else replace(r, direction=mirror.vector(r.direction)) for r in elements.reactions),
        tuple(replace(marker, point=mirror.vector(marker.point)) for marker in elements.markers),
        tuple(_gear(gear, signs) for gear in elements.gears),
        elements.states, elements.signals, elements.controllers,
    )  # fmt: skip


def _body(mirror: Mirror, body: Body) -> Body:
    x, y, z = mirror.signs
    xx, yy, zz, xy, xz, yz = body.inertia
    inertia = (xx, yy, zz, x * y * xy, x * z * xz, y * z * yz)
    shapes = tuple(replace(s, points=tuple(map(mirror.vector, s.points)), axes=tuple(map(mirror.vector, s.axes))) for s in body.shapes)
    return replace(
        body, centre_of_mass=mirror.vector(body.centre_of_mass), inertia=inertia, shapes=shapes,
        visuals=tuple(_visual(mirror, visual) for visual in body.visuals),
    )  # fmt: skip


def _visual(mirror: Mirror, visual: Visual) -> Visual:
    x, y, z = map(mirror.vector, visual.axes)
    return replace(visual, at=mirror.vector(visual.at), axes=(x, y, z))


def coordinate_signs(mirror: Mirror, joint: Joint) -> Mapping[str, int]:
    """For each coordinate of a joint whether it keeps its sign in the image.
    A displacement along a direction is a vector, a rotation about it a pseudovector."""
    return {
        m.coordinate: _image_sign(mirror, joint, m.direction) * (1 if isinstance(m, Translation) else -1)
        for m in joint.element.scalar_motions
    }


def _image_sign(mirror: Mirror, joint: Joint, direction: Direction) -> int:
    """1 where a direction of the joint's image is the image of the direction as a vector, -1 where it is the opposite.
    Directions across another one are its vector products with a global axis, and with the first of them."""
    match direction:
        case Direction.X | Direction.Y | Direction.Z:
            return mirror.signs[DESIGN_FRAME.index(direction)]
        case Direction.ACROSS_1:
            main = Direction.AXIS if joint.to is None else Direction.ROD
            return -_image_sign(mirror, joint, main) * _tangent_sign(mirror, joint)
        case Direction.ACROSS_2:
            return _tangent_sign(mirror, joint)
        case Direction.ROD:
            return 1
    return -1 if joint.element.axis_mirrors_as_rotation else 1


def _tangent_sign(mirror: Mirror, joint: Joint) -> int:
    """The sign of the global axis from which the tangents across a direction are made; an open direction has none to derive."""
    x, y, z = joint.axes[0] if joint.to is None else (b - a for a, b in zip(joint.at, joint.to, strict=True))
    if any(component.free_symbols or component.has(FAILED) for component in (x, y, z)):
        return 1
    return mirror.signs[least_component((x, y, z))]


def _joint(mirror: Mirror, joint: Joint, signs: Mapping[str, int]) -> Joint:
    image = mirror.rotation if joint.element.axis_mirrors_as_rotation else mirror.vector
    return replace(
        joint, at=mirror.vector(joint.at), axes=tuple(image(axis) for axis in joint.axes),
        to=None if joint.to is None else mirror.vector(joint.to), pitch=None if joint.pitch is None else -joint.pitch,
        guide=joint.guide and tuple(sign * guide for sign, guide in zip(signs.values(), joint.guide, strict=False)),
    )  # fmt: skip


def _gear(gear: Gear, signs: Mapping[str, Mapping[str, int]]) -> Gear:
    first, second, *others = (signs.get(c.joint, {}).get(c.name, 1) for c in gear.coordinates)
    if gear.law is not None:
        return replace(gear, law=first * gear.law.xreplace({POSITION: second * POSITION}))
    reflected = ((c, first * sign * ratio) for sign, (c, ratio) in zip(others, gear.others, strict=True))
    return replace(gear, ratio=first * second * gear.ratio, others=tuple(reflected))
