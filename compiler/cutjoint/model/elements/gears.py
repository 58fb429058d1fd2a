"""Coordinates of joints that other elements name, and gears: from the document's parts to records, not yet mirrored."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cutjoint.elements.joints import JOINTS
from cutjoint.model.document import element_parts as joint_parts
from cutjoint.model.document import model_file
from cutjoint.model.document.source import Path
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.laws import LawKind, read_law
from cutjoint.model.expressions.operations import Term
from cutjoint.model.expressions.parse import POSITION
from cutjoint.model.expressions.scope import FAILED, Element
from cutjoint.model.expressions.units import ANGLE, LENGTH, NONE, Dimension
from cutjoint.model.records import Gear, JointCoordinate, Scalar
from cutjoint.package.errors import plural

_DIMENSIONS: Mapping[str, Dimension] = {"rad": ANGLE, "m": LENGTH}


@dataclass(frozen=True)
class Naming:
    """The reference of an element to a coordinate, for messages. It has the reason that a coordinate is needed, the field and the text
    before a name in it, the places of joint and coordinate, and whether it must be a tree joint's."""

    need: str
    field: str
    before: str
    joint: Path
    coordinate: Path
    of_tree: bool = False


def read_coordinate(element: Element, name: str, joint: joint_parts.Joint, coordinate: str | None, naming: Naming) -> JointCoordinate:
    """The coordinate of a joint that an element names, its only one if it names none; without name and unit when there is none."""
    kind = JOINTS[joint.kind]
    known, what = kind.coordinates, f"the {joint.kind} joint '{name}'"
    if joint.cut and naming.of_tree:
        known, what = (), f"the cut joint '{name}'"
    elif joint.cut:
        known, what = kind.measurable, f"the cut {joint.kind} joint '{name}'"
    if not known:
        element.fail(f"{what} has no coordinates", naming.need, naming.joint)
    elif coordinate is None and len(known) > 1:
        options = " or ".join(naming.before + one for one in known)
        element.fail(f"{what} has {plural(len(known), 'coordinate')}", f"write {naming.field}{options}", naming.joint)
    elif coordinate is not None and coordinate not in known:
        element.fail(f"{what} has no coordinate '{coordinate}'", nearest(coordinate, known, "coordinates"), naming.coordinate)
    else:
        found = coordinate or known[0]
        return JointCoordinate(joint=name, name=found, unit=kind.units[found])
    return JointCoordinate(joint=name, name="", unit="")


def read_gear(element: Element, gear: model_file.Gear) -> Gear:
    """One of the elements under ``gears``."""
    ends = [_end(element, index, text) for index, text in enumerate(gear.joints)]
    (first, second, *others), joints = ([end for end, _ in ends], [joint for _, joint in ends])
    known = [end.joint for end, joint in ends if joint is not None]
    if twice := next((name for name in known if known.count(name) > 1), ""):
        element.fail(f"couples the joint '{twice}' to itself", "name two joints; a screw couples displacement and angle", ("joints",))
    elif all(joint is not None and getattr(joint, "guide", None) is not None for joint in joints):
        which = "all" if others else "both"
        element.fail(f"{which} its joints are guided", "leave one of them unguided, or remove the gear", ("joints",))
    if gear.law is not None:
        kind = LawKind({POSITION.name: _DIMENSIONS.get(second.unit, NONE)}, _DIMENSIONS.get(first.unit))
        names = {**element.scope.constants(), POSITION.name: Term(POSITION)}
        law = read_law(element, gear.law, kind, ("law",), names)
        if not (law.has(FAILED) or law.has(POSITION)):
            element.fail("its law has no position", "write a function of position, the second joint's coordinate", ("law",))
        return Gear(name=element.name, first=first, second=second, ratio=None, law=law, span=element.span)
    ratio, *more = _ratios(element, gear.ratio, first, [second, *others])
    return Gear(name=element.name, first=first, second=second, ratio=ratio, span=element.span, others=tuple(zip(others, more, strict=True)))


def _ratios(element: Element, ratio: Any, first: JointCoordinate, others: list[JointCoordinate]) -> list[Scalar]:
    """The ratios of a gear, by its coordinates but the first."""
    found = []
    for index, other in enumerate(others):
        keys: Path = ("ratio", index) if isinstance(ratio, tuple) else ("ratio",)
        expected = _DIMENSIONS[first.unit] / _DIMENSIONS[other.unit] if first.unit and other.unit else None
        found.append(element.scalar(ratio[index] if isinstance(ratio, tuple) else ratio or 0, expected, keys))
        if element.value(found[-1]) == 0:
            element.fail("the ratio is zero", "a joint that does not move is of kind fixed, or has guide: 0", keys)
    return found


def _end(element: Element, index: int, text: str) -> tuple[JointCoordinate, joint_parts.Joint | None]:
    """The coordinate at one end of a gear, named by a joint or a joint.coordinate, and the joint in the document."""
    local, coordinate = _parted(element, text)
    keys = ("joints", index)
    name, joint = element.joint(local, keys)
    if joint is None:
        return JointCoordinate(joint=name, name="", unit=""), None
    naming = Naming("a gear couples the coordinates of two joints in the tree", "", f"{local}.", keys, keys, of_tree=True)
    return read_coordinate(element, name, joint, coordinate, naming), joint


def _parted(element: Element, text: str) -> tuple[str, str | None]:
    """A joint's name and a coordinate's: a joint in an instance has a dot in its name too."""
    if element.scope.prefix + text in element.scope.directory.joints or "." not in text:
        return text, None
    local, _, coordinate = text.rpartition(".")
    return local, coordinate
