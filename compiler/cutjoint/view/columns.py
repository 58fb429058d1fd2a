"""The bodies to which a column of a run's table belongs."""

from __future__ import annotations

from collections.abc import Iterator

from cutjoint.model.quantities import Element
from cutjoint.model.records import GROUND, Force, Gear, Joint, Marker, Model, Reaction, RodForce


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
