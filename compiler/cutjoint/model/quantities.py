"""The quantities of each element that can be outputs, with units, and the bodies to which an output's element belongs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeAlias

from cutjoint.elements.gear import FORCE_UNITS
from cutjoint.elements.joint import rate_name
from cutjoint.elements.joints import JOINTS
from cutjoint.model.geometry import GLOBAL_AXES
from cutjoint.model.records import (
    GROUND,
    VALUE,
    Body,
    FirstOrderState,
    Force,
    Gear,
    Joint,
    Marker,
    Model,
    Output,
    Reaction,
    RodForce,
    Vector,
)

Element: TypeAlias = Body | Joint | Gear | Force | Reaction | RodForce | Marker | FirstOrderState

_MOTION: Mapping[str, str] = {
    **dict.fromkeys(("x", "y", "z"), "m"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
}

_ATTITUDE: Mapping[str, str] = dict.fromkeys(("roll", "pitch", "yaw"), "rad")

#: The pose of a body: its quantities with their units.
POSE: Mapping[str, str] = {**dict.fromkeys(("x", "y", "z"), "m"), **_ATTITUDE}

#: Quantities and units of each kind of element but joints and forces.  A body's x to az are of its centre of mass, in
#: global axes.
QUANTITIES: Mapping[type[Element], Mapping[str, str]] = {
    Body: {
        **_MOTION,
        **_ATTITUDE,
        **dict.fromkeys(("wx", "wy", "wz"), "rad/s"),
    },
    Marker: _MOTION,
    Reaction: {"force": "N", "moment": "N*m"},
    RodForce: {"force": "N"},
}

#: The quantities of a reaction without a direction.
_WRENCH: Mapping[str, str] = {**dict.fromkeys(("Fx", "Fy", "Fz"), "N"), **dict.fromkeys(("Mx", "My", "Mz"), "N*m")}


#: Quantities and units of the tree joints of each kind: coordinates, then speeds.
JOINT_QUANTITIES: Mapping[str, Mapping[str, str]] = {kind: joint.units for kind, joint in JOINTS.items()}


def quantities(element: Element) -> Mapping[str, str]:
    """The quantities of an element and their units; a cut joint has those that can be measured."""
    match element:
        case Joint(cut=True):
            shown = {name for c in element.element.measurable for name in (c, rate_name(c))}
            return {name: unit for name, unit in JOINT_QUANTITIES[element.kind].items() if name in shown}
        case Joint():
            return JOINT_QUANTITIES[element.kind]
        case Gear():
            return {"force": FORCE_UNITS.get(element.first.unit, "")}  # without a unit where its coordinate is wrong, which is noted
        case Reaction(direction=None):
            return _WRENCH
        case Force():
            return element.quantities
        case FirstOrderState():
            return {VALUE: element.unit}
    return QUANTITIES[type(element)]


def reaction_component(reaction: Reaction, quantity: str) -> tuple[bool, Vector]:
    """Return whether a quantity of a reaction is one of its moment, and the direction, fixed in the reaction's body, that it counts
    along."""
    if reaction.direction is not None:
        return quantity == "moment", reaction.direction
    return quantity.startswith("M"), GLOBAL_AXES["xyz".index(quantity[-1])]


def unit_of(model: Model, output: Output) -> str:
    """The unit of an output of a validated model."""
    return quantities(reported_element(model, output))[output.quantity]


def reported_element(model: Model, output: Output) -> Element:
    """The element that an output is a quantity of."""
    groups = (model.bodies, model.markers, model.reactions, model.force_elements, model.joints, model.gears, model.states)
    return next(e for group in groups for e in group if e.name == output.element)


def bodies_of(model: Model) -> dict[str, tuple[str, ...]]:
    """The bodies of every element by its name, the ground left out."""
    joints = {joint.name: joint for joint in model.joints}
    elements: list[Element] = [
        *model.joints, *model.gears, *model.force_elements, *model.reactions, *model.markers,
    ]  # fmt: skip
    found = {e.name: tuple(dict.fromkeys(b for b in _bodies(e, joints) if b != GROUND)) for e in elements}
    return {**{body.name: (body.name,) for body in model.bodies}, **found}


def _bodies(element: Element, joints: dict[str, Joint]) -> Iterator[str]:
    match element:
        case Marker():
            yield element.body
        case Force() if not element.joint_of:
            yield from element.bodies
        case Force():
            yield from _bodies(joints[element.joint_of], joints)
        case Reaction():
            yield from _bodies(joints[element.joint], joints)
        case Gear():
            yield from (body for name in element.joints for body in _bodies(joints[name], joints))
        case RodForce():
            yield from (body for name, _ in element.pushes for body in _bodies(joints[name], joints))
        case Joint():
            yield from (element.base, element.follower)
