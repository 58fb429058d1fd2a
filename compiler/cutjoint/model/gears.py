"""Gears: from the document's parts to records, not yet mirrored."""

from __future__ import annotations

from collections.abc import Mapping

from cutjoint.elements.joints import JOINTS
from cutjoint.elements.kinds import JointKind
from cutjoint.model import document, joint_parts
from cutjoint.model.coordinates import Naming, read_coordinate
from cutjoint.model.records import Gear, JointCoordinate
from cutjoint.model.scope import Element
from cutjoint.model.units import ANGLE, LENGTH, Dimension

_DIMENSIONS: Mapping[str, Dimension] = {"rad": ANGLE, "m": LENGTH}


def read_gear(element: Element, gear: document.Gear) -> Gear:
    """One of the elements under ``gears``."""
    (first, a), (second, b) = (_end(element, index, text) for index, text in enumerate(gear.joints))
    if a is not None and first.joint == second.joint:
        element.fail(f"couples the joint '{first.joint}' to itself", "name two joints; a screw couples displacement and angle", ("joints",))
    elif all(joint is not None and getattr(joint, "guide", None) is not None for joint in (a, b)):
        element.fail("both its joints are guided", "leave one of them unguided, or remove the gear", ("joints",))
    expected = _DIMENSIONS[first.unit] / _DIMENSIONS[second.unit] if first.unit and second.unit else None
    ratio = element.scalar(gear.ratio, expected, ("ratio",))
    if element.value(ratio) == 0:
        element.fail("the ratio is zero", "a joint that does not move is of kind fixed, or has guide: 0", ("ratio",))
    return Gear(name=element.name, first=first, second=second, ratio=ratio, span=element.span)


def _end(element: Element, index: int, text: str) -> tuple[JointCoordinate, joint_parts.Joint | None]:
    """The coordinate at one end of a gear, named by a joint or a joint.coordinate, and the joint in the document; without a unit if the
    name is wrong."""
    local, coordinate = _parted(element, text)
    keys = ("joints", index)
    name, joint = element.joint(local, keys)
    if joint is None:
        return JointCoordinate(joint=name, name="", unit=""), None
    naming = Naming("a gear couples the coordinates of two joints in the tree", "", f"{local}.", keys, keys, of_tree=True)
    found = read_coordinate(element, name, joint, coordinate, naming)
    return JointCoordinate(joint=name, name=found, unit=JOINTS[JointKind(joint.kind)].units.get(found, "")), joint


def _parted(element: Element, text: str) -> tuple[str, str | None]:
    """A joint's name and a coordinate's: a joint in an instance has a dot in its name too."""
    if element.scope.prefix + text in element.scope.directory.joints or "." not in text:
        return text, None
    local, _, coordinate = text.rpartition(".")
    return local, coordinate
