"""The image of every element under a reflection; it must equal the element's reflection.

Pairs of bodies and joints are found by place, not by names, along joints from the ground outwards: where a joint leads on from a body, a
joint like its image leads on from that body's image, and the bodies at their other ends are images of each other.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import sympy

from cutjoint.elements.joint import Direction, JointElement
from cutjoint.formulate.quantities import needs_place
from cutjoint.model.elements import Elements
from cutjoint.model.mirror import coordinate_signs, mirror_elements, reflected_law
from cutjoint.model.records import GROUND, Binding, Body, Force, Joint, Model, Scene, Vector
from cutjoint.reduce.half.plane import AsymmetryError, Plane, Same, is_same, put_in

#: Fields of a force that say who it is and what it acts on.
NAMING = frozenset({"name", "span", "active", "base", "follower", "body"})


@dataclass(frozen=True, kw_only=True)
class Images:
    """The image of each element by name: itself, or the other one of a pair; a force that is switched off may have none.

    ``signs`` has for each joint, by coordinate and speed, 1 where its image's counts the same way, else -1.
    """

    bodies: Mapping[str, str]
    joints: Mapping[str, str]
    forces: Mapping[str, str]
    signs: Mapping[str, Mapping[str, int]]


def require_images(pairs: Pairs) -> Images:
    """The images of all elements; each must equal the reflection.

    Raises:
        AsymmetryError: an element has no image, or differs from it.
    """
    elements, plane = pairs.elements, pairs.plane
    for joint in elements.joints:
        if joint.name not in pairs.joints and (joint.base in pairs.bodies or joint.follower in pairs.bodies):
            words = f"has no image: no {joint.kind} joint like it stands where the reflection in the plane {plane} puts it"
            raise AsymmetryError(joint.name, words, joint.span)
    for body, reflection in zip(elements.bodies, pairs.mirrored.bodies, strict=True):
        _require_body(reflection, next(b for b in elements.bodies if b.name == pairs.bodies[body.name]), plane, pairs.same)
    joints = {j.name: j for j in elements.joints}
    signs = {j.name: _signs(pairs, j, joints[pairs.joints[j.name]]) for j in elements.joints}
    for joint in elements.joints:
        _require_joint(joint, joints[pairs.joints[joint.name]], signs[joint.name], plane)
    forces = _force_images(pairs, signs)
    return Images(bodies=pairs.bodies, joints=pairs.joints, forces=forces, signs=signs)


def _require_body(reflection: Body, image: Body, plane: Plane, same: Same) -> None:
    names = {"mass": "mass", "centre_of_mass": "centre of mass", "inertia": "inertia"}
    differ = [words for name, words in names.items() if not same(getattr(reflection, name), getattr(image, name))]
    if differ and not (reflection.is_massless and image.is_massless):
        is_itself = reflection.name == image.name
        words = f"is not symmetric about the plane {plane}" if is_itself else f"is not what the plane {plane} shows of '{image.name}'"
        raise AsymmetryError(reflection.name, f"{words}: its {differ[0]}{' is not' if is_itself else ' differs'}", reflection.span)


def _signs(pairs: Pairs, joint: Joint, image: Joint) -> Mapping[str, int]:
    """The signs of coordinates and speeds in the image."""
    flips = pairs.signs(joint, image)
    assert flips is not None
    by_axes = _flips(joint.element, flips)
    mirrored = coordinate_signs(pairs.plane.mirror, joint)
    signs = {name: mirrored[name] * by_axes.get(name, 1) for name in joint.element.coordinates}
    spin = {name: pairs.plane.sign(name) for name in joint.element.speeds if name.startswith("w")}
    return {**signs, **dict(zip(joint.element.speeds, signs.values(), strict=False)), **spin}


def _flips(element: JointElement, of_axes: Sequence[int]) -> Mapping[str, int]:
    """The signs of coordinates when axes are turned about; the second direction across one is a product with two of them."""
    signs = dict(zip((Direction.AXIS, Direction.AXIS_2), of_axes, strict=False))
    if of_axes:
        signs[Direction.ACROSS_1] = of_axes[0]
    return {m.coordinate: signs.get(m.direction, 1) for m in element.scalar_motions}


def _require_joint(joint: Joint, image: Joint, signs: Mapping[str, int], plane: Plane) -> None:
    """Raises AsymmetryError unless the image is cut and guided as the joint is."""
    if joint.cut is not image.cut:
        raise AsymmetryError(joint.name, f"is not cut as '{image.name}' is, its image in the plane {plane}", joint.span)
    if (joint.guide is None) is not (image.guide is None):
        raise AsymmetryError(joint.name, f"is not guided as '{image.name}' is, its image in the plane {plane}", joint.span)
    guides = zip(joint.element.coordinates, joint.guide or (), image.guide or (), strict=False)
    for coordinate, guide, other in guides:
        if not is_same(signs[coordinate] * guide, other):
            problem = f"has a guide of its {coordinate} that moves it out of the plane {plane}, and is not zero in this scene"
            words = problem if joint.name == image.name else f"is not guided as the plane {plane} shows '{image.name}'"
            raise AsymmetryError(joint.name, words, joint.span)


def _force_images(pairs: Pairs, signs: Mapping[str, Mapping[str, int]]) -> Mapping[str, str]:
    """The image of each force; one that the scene has switched off needs none."""
    images: dict[str, str] = {}
    forces = pairs.elements.forces
    for force, reflection in zip(forces, pairs.mirrored.forces, strict=True):
        free = sorted((f for f in forces if f.name not in images and f.active is force.active), key=lambda f: f.name != force.name)
        like = [f for f in free if _is_attached(pairs, force, f) and _is_image(pairs, force, reflection, f, signs)]
        if force.name not in images and like:
            images |= {force.name: like[0].name, like[0].name: force.name}
    alone = [f for f in forces if f.name not in images]
    for force in alone:
        if force.active:
            raise AsymmetryError(force.name, _why(pairs.plane, force, [f for f in alone if _is_attached(pairs, force, f)]), force.span)
    return images


def _why(plane: Plane, force: Force, attached: Iterable[Force]) -> str:
    """The fault of a force that has no image; ``attached`` are others without one, and itself, that act on the right bodies."""
    names = [f.name for f in attached]
    if names == [force.name]:
        return f"is not symmetric about the plane {plane}, nor has it an image there"
    if names:
        other = next(name for name in names if name != force.name)
        return f"is not what the plane {plane} shows of '{other}': they differ in place or law, or one is switched off"
    return f"has no image: nothing like it acts where the reflection in the plane {plane} puts it"


def _is_attached(pairs: Pairs, force: Force, candidate: Force) -> bool:
    """Return whether a candidate is of the type of a force and acts on the images of its bodies or its coordinate."""
    if type(force) is not type(candidate):
        return False
    if force.joint_of:
        return (pairs.joints[force.joint_of], force.coordinate_of) == (candidate.joint_of, candidate.coordinate_of)
    images = tuple(pairs.bodies[body] for body in force.bodies)
    return images == candidate.bodies or (bool(force.swapped) and images[::-1] == candidate.bodies)


def _is_image(pairs: Pairs, force: Force, reflection: Force, candidate: Force, signs: Mapping[str, Mapping[str, int]]) -> bool:
    if force.joint_of:
        sign = signs[force.joint_of][force.coordinate_of]
        return pairs.same(tuple(reflected_law(law, sign) for law in force.expressions), candidate.expressions)
    names = [f.name for f in fields(reflection) if f.name not in NAMING]
    shown = {name: getattr(reflection, name) for name in names}
    if tuple(pairs.bodies[body] for body in force.bodies) != candidate.bodies:
        shown |= reflection.swapped
    return all(pairs.same(value, getattr(candidate, name)) for name, value in shown.items())


def settle(model: Model, scene: Scene) -> Elements:
    """The elements as the scene has them, with functions of time in place of inputs."""
    inputs = {
        p.symbol: scene.inputs.get(p.name, sympy.Integer(0) if p.value == 0 else sympy.Float(p.value))
        for p in model.parameters if p.binding is Binding.INPUT
    }  # fmt: skip
    forces = (replace(f, active=needs_place(f, model, scene, scene.outputs)) for f in model.forces)
    return Elements(
        tuple(put_in(b, inputs) for b in model.bodies), tuple(put_in(j, inputs) for j in model.joints),
        tuple(put_in(f, inputs) for f in forces), (), (),
    )  # fmt: skip


def find_pairs(elements: Elements, plane: Plane, same: Same = is_same) -> Pairs:
    """The images of bodies and joints as far as joints lead to them; ``same`` compares what should be alike."""
    pairs = Pairs(elements=elements, plane=plane, mirrored=mirror_elements(elements, plane.axis), same=same)
    queue = [GROUND]
    for body in queue:
        for joint in elements.joints:
            if body in (joint.base, joint.follower) and joint.name not in pairs.joints:
                queue.extend(pairs.follow(joint))
    return pairs


@dataclass(kw_only=True)
class Pairs:
    """Images of bodies and joints as they are found; ``mirrored`` are the elements' reflections."""

    elements: Elements
    plane: Plane
    mirrored: Elements
    same: Same = is_same
    bodies: dict[str, str] = field(default_factory=lambda: {GROUND: GROUND})
    joints: dict[str, str] = field(default_factory=dict)

    @property
    def any(self) -> bool:
        """Return whether some element has another one as its image."""
        return any(name != image for images in (self.bodies, self.joints) for name, image in images.items())

    def reflection(self, joint: Joint) -> Joint:
        """A joint as the mirror shows it."""
        return next(m for m in self.mirrored.joints if m.name == joint.name)

    def signs(self, joint: Joint, candidate: Joint) -> tuple[int, ...] | None:
        """The signs by which the axes of a joint's image are turned against a candidate's, see `axis_signs`."""
        return axis_signs(self.reflection(joint), candidate, self.same)

    def follow(self, joint: Joint) -> list[str]:
        """Find the image of a joint at a body whose image is known, and so that of the body at its other end; returns what is new."""
        candidates = [c for c in self.elements.joints if self._may_be_image(joint, c)]
        if not candidates:
            return []
        image = max(candidates, key=lambda c: self._likeness(joint, c))
        self.joints |= {joint.name: image.name, image.name: joint.name}
        found = []
        for one, other in ((joint.base, image.base), (joint.follower, image.follower)):
            found += [name for name in dict.fromkeys((one, other)) if name not in self.bodies]
            self.bodies |= {one: other, other: one}
        return found

    def _may_be_image(self, joint: Joint, candidate: Joint) -> bool:
        if candidate.name in self.joints or self.signs(joint, candidate) is None:
            return False
        ends = ((joint.base, candidate.base), (joint.follower, candidate.follower))
        return all(self.bodies.get(a, b) == b and self.bodies.get(b, a) == a for a, b in ends)

    def _likeness(self, joint: Joint, candidate: Joint) -> tuple[int, bool]:
        """The number of joints around with an image like a joint around the candidate; of equals, an element is its own image."""
        around = [j for j in self.elements.joints if {j.base, j.follower} & ({joint.base, joint.follower} - {GROUND})]
        there = [j for j in self.elements.joints if {j.base, j.follower} & ({candidate.base, candidate.follower} - {GROUND})]
        matched = sum(any(self.signs(j, c) is not None for c in there) for j in around)
        return matched, joint.name == candidate.name


def axis_signs(reflection: Joint, candidate: Joint, same: Same) -> tuple[int, ...] | None:
    """For each axis 1 where the candidate's has the direction of the reflection's, -1 where the opposite; None for another joint."""
    if reflection.kind is not candidate.kind or not same(reflection.at, candidate.at):
        return None
    if not same(reflection.to, candidate.to) or not same(reflection.pitch, candidate.pitch):
        return None
    signs = [_axis_sign(a, b, same) for a, b in zip(reflection.axes, candidate.axes, strict=True)]
    return None if 0 in signs else tuple(signs)


def _axis_sign(a: Vector, b: Vector, same: Same) -> int:
    if same(a, b):
        return 1
    return -1 if same(a, (-b[0], -b[1], -b[2])) else 0
