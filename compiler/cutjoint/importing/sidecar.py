"""A YAML beside a URDF: joints that are balls or Cardan joints, frames that close loops, joints with drives."""

import re
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from cutjoint.importing.robot import Drive, Joint, Link, Loop, Pose, Robot, unique_name
from cutjoint.importing.xml import Node
from cutjoint.model.document.source import parse_yaml, read_text
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Span
from cutjoint.package.errors import plural

_KEYS = ("closed_loop", "type", "joint_name", "joint_type", "name_mot")
_CARDAN = re.compile(r"UJOINT_([XYZ])([XYZ])")
_HINT = "see 'Loops in a YAML beside a URDF' in docs/how-to/import.md"


class Sidecar:
    """The YAML beside a URDF; without entries where there is none, or one of another kind.  Raises ModelError where it is wrong."""

    def __init__(self, path: Path) -> None:
        self._path = path.with_suffix(".yaml")
        text = read_text(self._path) if self._path.is_file() else ""
        self._source = parse_yaml(text, str(self._path)) if any(f"{key}:" in text for key in ("closed_loop", "joint_type")) else None
        self._data: dict[str, Any] = self._source.data if self._source and isinstance(self._source.data, dict) else {}

    def change_joints(self, robot: Robot) -> None:
        """Make balls, Cardan joints and fixed joints of those that the file names."""
        for name, kind in self._pairs("joint_name", "joint_type"):
            if name not in robot.joints:
                self._fail("joint_name", f"names the joint '{name}', which is not there", "correct the name, or remove it and its type")
            joint = robot.joints[name]
            if kind == "SPHERICAL":
                joint.kind = "spherical"
            elif kind == "FIXED":
                joint.kind, joint.damping, joint.friction = "fixed", 0.0, 0.0
            elif (axes := _CARDAN.fullmatch(kind)) and axes[1] != axes[2]:
                _cross(robot, joint, axes[1], axes[2])
            else:
                self._fail("joint_type", f"has the unknown type '{kind}'", "use SPHERICAL, FIXED, or UJOINT_XY and its like")

    def close_loops(self, robot: Robot, root: Node) -> None:
        """Add the pairs of frames that are held together in place (3d) or wholly (6d), and the drives."""
        pairs, kinds = self._items("closed_loop"), self._items("type")
        if len(kinds) not in (0, len(pairs)):
            self._fail("type", f"has {plural(len(kinds), 'type')} for {plural(len(pairs), 'loop')}")
        for i, pair in enumerate(pairs):
            kind = str(kinds[i]).lower() if kinds else "6d"
            if kind not in ("3d", "6d") or not isinstance(pair, tuple) or len(pair) != 2:
                self._fail("closed_loop", "wants pairs of frames, with the type 3d or 6d each")
            first, second = (_frame(robot, str(name)) for name in pair)
            if first is None or second is None:
                wrong = str(pair[0] if first is None else pair[1])
                near = get_close_matches(wrong, (*robot.joints, *robot.links), n=1)
                self._fail("closed_loop", f"names '{wrong}', which is neither joint nor link", *(f"did you mean '{x}'?" for x in near))
            kind, links = "spherical" if kind == "3d" else "fixed", (first[0], second[0])
            robot.loops.append(Loop(f"loop_{i + 1}", root, kind, links, first[1], second[1]))
        for name in map(str, self._items("name_mot")):
            if name not in robot.joints:
                self._fail("name_mot", f"names the joint '{name}', which is not there", "correct the name, or remove it")
            add_drive(robot, name)
        if others := [str(key) for key in self._data if key not in _KEYS]:
            robot.notes.append(f"left out of {self._path.name}: {', '.join(others)}")

    def _items(self, key: str) -> tuple[Any, ...]:
        items = self._data.get(key) or ()
        return items if isinstance(items, tuple) else self._fail(key, "is no list")

    def _pairs(self, first: str, second: str) -> Iterator[tuple[str, str]]:
        names, kinds = (tuple(map(str, self._items(key))) for key in (first, second))
        if len(names) != len(kinds):
            self._fail(second, f"has {len(kinds)} entries for {len(names)} of {first}")
        return zip(names, kinds, strict=True)

    def _fail(self, key: str, message: str, hint: str = _HINT) -> NoReturn:
        span = self._source.key_span((key,)) if self._source and key in self._data else Span(file=str(self._path), line=1, column=1)
        raise ModelError([Problem(span=span, element=key, message=message, hint=hint)])


def add_drive(robot: Robot, joint: str) -> None:
    """Give a joint a drive, unless it has one."""
    if all(drive.joint != joint for drive in robot.drives):
        robot.drives.append(Drive(f"{joint}_drive", joint))


def _cross(robot: Robot, joint: Joint, first: str, second: str) -> None:
    """Make a Cardan joint of one: it turns about the first axis of its frame, its child about the second one behind it."""
    cross = unique_name(f"{joint.name}_cross", robot.links)
    robot.links[cross] = Link(cross, joint.node)
    ends = [unique_name(f"{joint.name}_{axis}", robot.joints) for axis in (first, second)]
    x, y = (np.eye(3)["XYZ".index(axis)] for axis in (first, second))
    hinges = (Joint(ends[0], joint.node, "revolute", joint.parent, cross, joint.origin, x),
              Joint(ends[1], joint.node, "revolute", cross, joint.child, Pose(), y))  # fmt: skip
    old = list(robot.joints.values())
    robot.joints = {each.name: each for one in old for each in (hinges if one is joint else (one,))}


def _frame(robot: Robot, name: str) -> tuple[str, Pose] | None:
    """The link that has a frame, and the frame in it: a joint's is that of its child."""
    if name in robot.joints:
        return robot.joints[name].child, Pose()
    return (name, Pose()) if name in robot.links else None
