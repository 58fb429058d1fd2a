"""The image of every element under a reflection; it must equal the element's reflection."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields

from cutjoint.elements.joint import Direction, JointElement
from cutjoint.model.mirror import coordinate_signs, reflected_law
from cutjoint.model.records import Body, Force, Joint
from cutjoint.reduce.half.pairs import Pairs
from cutjoint.reduce.half.plane import AsymmetryError, Plane, Same, is_same

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
