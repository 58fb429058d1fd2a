"""Parts that are symmetric about a plane: each is its own reflection, and nothing pushes it out of the plane."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import fields, replace

import sympy

from cutjoint.elements.joint import Direction, JointElement
from cutjoint.formulate.quantities import needs_place
from cutjoint.model.elements.build import Elements
from cutjoint.model.elements.mirror import coordinate_signs, mirror_elements, reflected_law
from cutjoint.model.records import Binding, Body, Force, Joint, Model, Scene, Vector
from cutjoint.reduce.plane import AsymmetryError, Plane, is_same, substitute

#: Fields of a force that say who it is and what it acts on.
_NAMING = frozenset({"name", "span", "active", "base", "follower", "body"})


def require_own_images(model: Model, scene: Scene, plane: Plane, loose: Collection[str]) -> None:
    """Check that bodies which no joint holds in a plane, and all that touches them, are their own images; forces may be in pairs.

    Raises:
        AsymmetryError: one is not, or gravity pulls out of the plane.
    """
    if not plane.within(model.gravity):
        raise AsymmetryError(model.name, f"has gravity that pulls out of the plane {plane}", model.span)
    elements = _fix_inputs(model, scene)
    joints = tuple(j for j in elements.joints if {j.base, j.follower} & set(loose))
    names = {j.name for j in joints}
    forces = tuple(f for f in elements.forces if f.active and (f.joint_of in names or set(f.bodies) & set(loose)))
    touched = Elements(tuple(b for b in elements.bodies if b.name in loose), joints, forces, (), ())
    mirrored = mirror_elements(touched, plane.axis)
    for body, reflection in zip(touched.bodies, mirrored.bodies, strict=True):
        _require_body(body, reflection, plane)
    signs = {j.name: _joint_signs(j, reflection, plane) for j, reflection in zip(joints, mirrored.joints, strict=True)}
    _require_forces(forces, mirrored.forces, signs, plane)


def _fix_inputs(model: Model, scene: Scene) -> Elements:
    """The elements as the scene has them, with functions of time in place of inputs."""
    inputs = {
        p.symbol: scene.inputs.get(p.name, sympy.Integer(0) if p.value == 0 else sympy.Float(p.value))
        for p in model.parameters if p.binding is Binding.INPUT
    }  # fmt: skip
    forces = (replace(f, active=needs_place(f, model, scene, scene.outputs)) for f in model.forces)
    return Elements(
        tuple(substitute(b, inputs) for b in model.bodies), tuple(substitute(j, inputs) for j in model.joints),
        tuple(substitute(f, inputs) for f in forces), (), (),
    )  # fmt: skip


def _require_body(body: Body, reflection: Body, plane: Plane) -> None:
    names = {"mass": "mass", "centre_of_mass": "centre of mass", "inertia": "inertia"}
    differ = [text for name, text in names.items() if not is_same(getattr(reflection, name), getattr(body, name))]
    if differ and not body.is_massless:
        raise AsymmetryError(body.name, f"is not symmetric about the plane {plane}: its {differ[0]} is not", body.span)


def _joint_signs(joint: Joint, reflection: Joint, plane: Plane) -> Mapping[str, int]:
    """1 for each coordinate that the reflection leaves unchanged, -1 for each that it reverses."""
    alike = all(is_same(getattr(reflection, name), getattr(joint, name)) for name in ("at", "to", "pitch"))
    of_axes = [_axis_sign(a, b) for a, b in zip(reflection.axes, joint.axes, strict=True)]
    if not alike or 0 in of_axes:
        raise AsymmetryError(joint.name, f"is not symmetric about the plane {plane}", joint.span)
    mirrored, by_axes = coordinate_signs(plane.mirror, joint), _flips(joint.element, of_axes)
    signs = {name: mirrored[name] * by_axes.get(name, 1) for name in joint.element.coordinates}
    for coordinate, guide in zip(joint.element.coordinates, joint.guide or (), strict=False):
        if not is_same(signs[coordinate] * guide, guide):
            text = f"has a guide of its {coordinate} that moves it out of the plane {plane}, and is not zero in this scene"
            raise AsymmetryError(joint.name, text, joint.span)
    return signs


def _axis_sign(a: Vector, b: Vector) -> int:
    """1 of equal directions, -1 of opposite ones, else 0."""
    return 1 if is_same(a, b) else -1 if is_same(a, (-b[0], -b[1], -b[2])) else 0


def _flips(element: JointElement, of_axes: Sequence[int]) -> Mapping[str, int]:
    """The signs of coordinates when axes are reversed; the second transverse direction is a product with two of them."""
    signs = dict(zip((Direction.AXIS, Direction.AXIS_2), of_axes, strict=False))
    if of_axes:
        signs[Direction.ACROSS_1] = of_axes[0]
    return {m.coordinate: signs.get(m.direction, 1) for m in element.scalar_motions}


def _require_forces(forces: Sequence[Force], mirrored: Iterable[Force], signs: Mapping[str, Mapping[str, int]], plane: Plane) -> None:
    """Check that each force equals its own reflection or that of another force."""
    free = list(forces)
    for force, reflection in zip(forces, mirrored, strict=True):
        image = next((f for f in free if _is_image(force, reflection, f, signs)), None)
        if image is None:
            raise AsymmetryError(force.name, f"is not symmetric about the plane {plane}, nor has it an image there", force.span)
        free.remove(image)


def _is_image(force: Force, reflection: Force, candidate: Force, signs: Mapping[str, Mapping[str, int]]) -> bool:
    if type(force) is not type(candidate):
        return False
    if force.joint_of:
        if (force.joint_of, force.coordinate_of) != (candidate.joint_of, candidate.coordinate_of):
            return False
        sign = signs[force.joint_of][force.coordinate_of]
        return is_same(tuple(reflected_law(law, sign) for law in force.expressions), candidate.expressions)
    shown = {f.name: getattr(reflection, f.name) for f in fields(reflection) if f.name not in _NAMING}
    if force.bodies != candidate.bodies:
        if not force.swapped or force.bodies[::-1] != candidate.bodies:
            return False
        shown |= reflection.swapped
    return all(is_same(value, getattr(candidate, name)) for name, value in shown.items())
