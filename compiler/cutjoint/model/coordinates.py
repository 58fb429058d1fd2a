"""Coordinates of joints that other elements name."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.elements.joints import JOINTS
from cutjoint.model import joint_parts
from cutjoint.model.errors import nearest
from cutjoint.model.records import COORDINATES, JointKind
from cutjoint.model.scope import Element
from cutjoint.model.source import Path


@dataclass(frozen=True)
class Naming:
    """The way an element names a coordinate: the reason that it needs one, the field and the text before a name in it, the places of joint
    and coordinate, and whether it must be a tree joint's."""

    need: str
    field: str
    before: str
    joint: Path
    coordinate: Path
    of_tree: bool = False


def read_coordinate(element: Element, name: str, joint: joint_parts.Joint, coordinate: str | None, naming: Naming) -> str:
    """The coordinate of a joint that an element names, its only one if it names none; empty when there is none."""
    known, what = COORDINATES[JointKind(joint.kind)], f"the {joint.kind} joint '{name}'"
    if joint.cut and naming.of_tree:
        known, what = (), f"the cut joint '{name}'"
    elif joint.cut:
        known, what = JOINTS[JointKind(joint.kind)].measurable, f"the cut {joint.kind} joint '{name}'"
    if not known:
        element.fail(f"{what} has no coordinates", naming.need, naming.joint)
    elif coordinate is None and len(known) > 1:
        options = " or ".join(naming.before + one for one in known)
        element.fail(f"{what} has {len(known)} coordinates", f"write {naming.field}{options}", naming.joint)
    elif coordinate is not None and coordinate not in known:
        element.fail(f"{what} has no coordinate '{coordinate}'", nearest(coordinate, known, "coordinates"), naming.coordinate)
    else:
        return coordinate or known[0]
    return ""
