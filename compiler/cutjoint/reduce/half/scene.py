"""The start of the half of a symmetric model, and the columns of the whole that follow from its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from cutjoint.elements.joint import ATTITUDE
from cutjoint.model.mirror import ANGLES
from cutjoint.model.quantities import JOINT_QUANTITIES, reaction_component, reported_element
from cutjoint.model.records import (
    GROUND,
    Body,
    Controller,
    FirstOrderState,
    Force,
    Gear,
    Joint,
    Marker,
    Output,
    Reaction,
    RodForce,
    Scalar,
    Scene,
    Signal,
    Vector,
)
from cutjoint.reduce.half.model import Half
from cutjoint.reduce.half.plane import AsymmetryError, is_nought, is_same


def half_scene(half: Half, scene: Scene) -> Scene:
    """The scene of the half.

    Raises:
        AsymmetryError: it is not symmetric, or asks for what the half does not determine.
    """
    _require_road(half, scene)
    return replace(
        scene, positions=_states(half, scene.positions), rates=_states(half, scene.rates),
        switches={name: is_on for name, is_on in scene.switches.items() if name not in half.gone},
        outputs=tuple(_output(half, o) for o in scene.outputs),
    )  # fmt: skip


def _require_road(half: Half, scene: Scene) -> None:
    tyres = [f for f in half.model.forces if f.has_road and scene.switches.get(f.name, f.active)]
    if tyres and scene.road.parts:
        what = "a surface" if "surface" in scene.road.parts else "patches of friction"
        raise AsymmetryError(scene.name, f"has {what} on its road, which need not be symmetric", scene.span)
    if half.flat:
        return
    if tyres and half.plane.axis != "y":
        raise AsymmetryError(tyres[0].name, "rolls along x, so that the road has no image but in the plane y = 0", tyres[0].span)
    left, right = ([(s.kind, s.length, s.rise) for s in track] for track in (scene.road.left, scene.road.right))
    if tyres and left != right:
        raise AsymmetryError(scene.name, "has a road whose left and right tracks differ", scene.span)


def _states(half: Half, states: Mapping[str, Scalar]) -> dict[str, Scalar]:
    """Initial coordinates or speeds of the half by "joint.component"."""
    found: dict[str, Scalar] = {}
    for key, value in states.items():
        name, _, component = key.rpartition(".")
        joint = next(j for j in half.model.joints if j.name == name)
        if component in ATTITUDE:
            raise AsymmetryError(name, "starts with an attitude, which the pass does not compare", joint.span)
        if not half.flat:
            _require_image(half, states, joint, component)
        if name in half.in_plane:
            found |= _in_plane_state(half, joint, component, value)
        elif name not in half.removed:
            found[key] = value
    return found


def _require_image(half: Half, states: Mapping[str, Scalar], joint: Joint, component: str) -> None:
    image, sign = half.images.joints[joint.name], half.images.signs[joint.name][component]
    other = states.get(f"{image}.{component}")
    if other is None or not is_same(sign * states[f"{joint.name}.{component}"], other):
        problem = f"starts with a {component} that leaves the plane {half.plane}"
        words = problem if image == joint.name else f"does not start with the {component} that the plane {half.plane} shows of '{image}'"
        raise AsymmetryError(joint.name, words, joint.span)


def _in_plane_state(half: Half, joint: Joint, component: str, value: Scalar) -> dict[str, Scalar]:
    found = half.in_plane[joint.name]
    if component in found.kept:
        name, sign = found.kept[component]
        return {f"{joint.name}.{name}": sign * value}
    if not is_nought(value):
        raise AsymmetryError(joint.name, f"starts with a {component} that leaves the plane {half.plane}", joint.span)
    return {}


def _output(half: Half, output: Output) -> Output:
    """The column of the half from which one of the whole follows."""
    element = reported_element(half.model, output)
    match element:
        case Marker():
            return _scaled(output, half.plane.sign(output.quantity) if element.body in half.removed else 1)
        case Reaction():
            return _reaction_output(half, element, output)
        case Body():
            sign = half.plane.sign(output.quantity)
            return _scaled(output, sign, half.images.bodies[element.name]) if element.name in half.removed else output
        case Joint():
            return _joint_output(half, element, output)
        case RodForce() if not half.flat:
            raise AsymmetryError(element.name, "is measured by distances that already stand for a link", element.span)
    return output if isinstance(element, RodForce | Gear | FirstOrderState | Signal | Controller) else _force_output(half, element, output)


def _reaction_output(half: Half, reaction: Reaction, output: Output) -> Output:
    """A component of a reaction.

    Raises:
        AsymmetryError: the half does not determine it.
    """
    is_moment, direction = reaction_component(reaction, output.quantity)
    if reaction.joint in half.in_plane or half.is_own(reaction.joint):
        return _in_plane_reaction(half, reaction, output, is_moment, direction)
    if reaction.joint not in half.removed:
        return output
    turned = -1 if is_moment else 1  # a moment is an axial vector: its image along a mirrored direction is the opposite
    return _scaled(output, turned if reaction.direction is not None else half.plane.sign(output.quantity))


def _in_plane_reaction(half: Half, reaction: Reaction, output: Output, is_moment: bool, direction: Vector) -> Output:
    """The output of a joint in the plane: the half has half of the force in it and of the moment across it; the rest of a symmetric whole
    is zero."""
    in_plane, across = half.plane.within(direction), half.plane.along_normal(direction)
    if half.flat or reaction.body == GROUND or half.is_own(reaction.body):
        if across if is_moment else in_plane:
            return _scaled(output, 1 if half.flat else 2)
        if (in_plane if is_moment else across) and not half.flat:
            return _scaled(output, 0)
    words = f"is asked for its {output.quantity}, which a model in the plane {half.plane} does not determine"
    raise AsymmetryError(reaction.name, words, output.span)


def _scaled(output: Output, factor: float, element: str = "", quantity: str = "") -> Output:
    """An output that is read from another column, or from another multiple of its own."""
    read = replace(output, element=element or output.element, quantity=quantity or output.quantity, factor=factor * output.factor)
    return read if read.column == output.column else replace(read, stands_for=output.column)


def _force_output(half: Half, force: Force, output: Output) -> Output:
    name, sign = force.name, 1
    if half.kept_force(name) in half.gone:
        raise AsymmetryError(name, "is asked for, but acts on what rests in the plane", output.span)
    if name in half.removed:
        name, sign = half.images.forces[name], _force_sign(half, force, output.quantity)
    if half.is_own(force.name) and force.is_halved(output.quantity):
        sign = 2 * sign
    if force.joint_of and output.quantity == "force" and (joint := half.in_plane.get(half.kept_joint(force.joint_of))):
        sign *= joint.kept[force.coordinate_of][1]
    return _scaled(output, sign, name)


def _force_sign(half: Half, force: Force, quantity: str) -> int:
    """The sign of the image of a force's quantity: 1 if it counts the same way, else -1."""
    of_coordinate = half.images.signs[force.joint_of][force.coordinate_of] if force.joint_of else 1
    return force.image_sign(quantity, half.plane.sign, of_coordinate)


def _joint_output(half: Half, joint: Joint, output: Output) -> Output:
    name = half.kept_joint(joint.name)
    sign = 1 if name == joint.name else half.images.signs[joint.name][output.quantity]
    if name not in half.in_plane:
        return _scaled(output, sign, name)
    found = half.in_plane[name]
    if output.quantity in found.kept:
        quantity, factor = found.kept[output.quantity]
        return _scaled(output, sign * factor, name, quantity)
    if output.quantity in found.unknown:
        raise AsymmetryError(joint.name, f"is asked for its {output.quantity}, which a plane model does not determine", output.span)
    return _zero(half, joint, output)


def _zero(half: Half, joint: Joint, output: Output) -> Output:
    """A coordinate that would leave the plane: what a body of the joint has of the same unit, times nought."""
    plane = half.plane
    by_unit = {"m": plane.axis, "m/s": f"v{plane.axis}", "rad": ANGLES[plane.across], "rad/s": f"w{plane.across}"}
    quantity = by_unit[JOINT_QUANTITIES[joint.kind][output.quantity]]
    body = next(b.name for b in half.model.bodies if b.name in (joint.base, joint.follower))
    return _scaled(output, 0, body, quantity)
