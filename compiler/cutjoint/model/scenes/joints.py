"""Joints that a scene locks, drives or releases: their guides in that scene."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import sympy

from cutjoint.model.document import model_file
from cutjoint.model.document.source import Path
from cutjoint.model.elements.build import GUIDES
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.laws import read_law
from cutjoint.model.expressions.scope import Element
from cutjoint.model.records import Joint, Scalar

#: The guides that a scene gives to joints by their names, None to those that it leaves free.
Guides = Mapping[str, tuple[Scalar, ...] | None]


def read_drives(where: Element, scene: model_file.Scene, joints: Mapping[str, Joint]) -> Guides:
    """The guides of joints that a scene drives or releases; errors are reported."""
    found: dict[str, tuple[Scalar, ...] | None] = {}
    for index, name in enumerate(scene.release):
        joint = _joint(where, name, joints, ("release", index))
        if joint is not None and joint.guide is None:
            where.fail(f"release: the joint '{name}' has no guide", "remove it here", ("release", index))
        elif joint is not None:
            found[name] = None
    laws: dict[str, dict[str, Scalar]] = {}
    for key, law in scene.drive.items():
        name, coordinate = _coordinate(where, key, joints)
        if name:
            kind = GUIDES[joints[name].element.units[coordinate]]
            laws.setdefault(name, {})[coordinate] = read_law(where, law, kind, ("drive", key), where.scope.timed())
    for name, parts in laws.items():
        names = joints[name].element.coordinates
        if missing := [other for other in names if other not in parts]:
            key = next(key for key in scene.drive if key in (name, *(f"{name}.{other}" for other in parts)))
            hint = f"add {', '.join(f'{name}.{other}' for other in missing)}"
            where.fail(f"drive: '{name}' needs a law for each coordinate", hint, ("drive", key))
        found[name] = tuple(parts.get(other, sympy.nan) for other in names)
    return found


def read_locks(where: Element, scene: model_file.Scene, joints: Mapping[str, Joint]) -> Iterator[Joint]:
    """The joints that a scene locks; errors are reported."""
    for index, name in enumerate(scene.lock):
        joint = _joint(where, name, joints, ("lock", index))
        if joint is None or not _can_be_guided(where, joint, ("lock", index)):
            continue
        if name in scene.release or any(key == name or key.rpartition(".")[0] == name for key in scene.drive):
            where.fail(f"lock: the joint '{name}' is driven or released too", "say one of them", ("lock", index))
        elif rate := next((key for key in scene.rates if key.rpartition(".")[0] == name), None):
            where.fail(f"rates: the joint '{name}' is locked", "remove its rate", ("rates", rate), at_key=True)
        else:
            yield joint


def locked_at_start(joint: Joint, positions: Mapping[str, Scalar]) -> tuple[Scalar, ...]:
    """The guide of a locked joint: its positions at the start, else those of the design position."""
    return tuple(sympy.sympify(positions.get(f"{joint.name}.{name}", 0)) for name in joint.element.coordinates)


def with_guides(joints: Mapping[str, Joint], guides: Guides) -> dict[str, Joint]:
    """The joints by name with other guides."""
    return {name: replace(joint, guide=guides[name]) if name in guides else joint for name, joint in joints.items()}


def _coordinate(where: Element, key: str, joints: Mapping[str, Joint]) -> tuple[str, str]:
    """The joint and the coordinate that a key of ``drive`` names; empty where it names none."""
    name, coordinate = (key, "") if key in joints else key.rpartition(".")[::2]
    joint = _joint(where, name or key, joints, ("drive", key))
    if joint is None or not _can_be_guided(where, joint, ("drive", key)):
        return "", ""
    names = joint.element.coordinates
    if not coordinate and len(names) == 1:
        return name, names[0]
    if coordinate not in names:
        where.fail(f"drive: '{key}' names no coordinate", nearest(coordinate, names, "coordinates"), ("drive", key), at_key=True)
        return "", ""
    return name, coordinate


def _joint(where: Element, name: str, joints: Mapping[str, Joint], keys: Path) -> Joint | None:
    if name not in joints and not where.scope.directory.misses(name):
        hint = nearest(name, [*joints, *where.scope.broken("joints")], "joints")
        where.fail(f"{keys[0]}: unknown joint '{name}'", hint, keys, at_key=isinstance(keys[1], str))
    return joints.get(name)


def _can_be_guided(where: Element, joint: Joint, keys: Path) -> bool:
    able = joint.element.can_be_guided and not joint.cut
    if not able:
        what: Any = "cut" if joint.cut else joint.kind
        where.fail(f"{keys[0]}: a {what} joint has no coordinate to guide", "take another joint of the loop", keys)
    return able
