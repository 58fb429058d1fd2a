"""URDF: trees with mimic joints, loops and couplings of URDF+ in its dialects, and what a YAML beside the file says."""

import re
from collections.abc import Iterator
from difflib import get_close_matches
from itertools import takewhile
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from cutjoint.importing.robot import Array, Coupling, Drive, Joint, Link, Loop, Pose, Robot, colour_of, of_xyzw, roll_pitch_yaw, unique_name
from cutjoint.importing.xml import Node, read_xml
from cutjoint.model.document.source import parse_yaml, read_text
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Span
from cutjoint.package.errors import plural

_KINDS = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed", "floating": "free",
    "spherical": "spherical",
}  # fmt: skip
_ENDS, _OLD_ENDS = ("predecessor", "successor"), ("parent", "child")  #: tags of the two ends of a loop or a coupling
_KEYS = ("closed_loop", "type", "joint_name", "joint_type", "name_mot")
_CARDAN = re.compile(r"UJOINT_([XYZ])([XYZ])")
_HINT = "see 'Loops in a YAML beside a URDF' in docs/how-to/import.md"


def read_urdf(path: Path) -> tuple[Robot, Node]:
    """The robot of a URDF file, with the loops of a YAML of the same name beside it.  Raises ModelError where either is wrong."""
    root = read_xml(path)
    if root.tag != "robot":
        root.refuse("is no URDF", "name a file whose outermost element is <robot>")
    robot = Robot(root.attributes.get("name") or path.stem)
    for node in root.all("link"):
        _add(robot.links, _link(node), node)
    for node in root.all("joint"):
        _add(robot.joints, _joint(node, robot), node)
    beside = Sidecar(path)
    beside.change_joints(robot)
    for node in root.all("joint"):
        _couple(node, robot)
    _require_tree(robot, root)
    _relate(robot, root)
    for node in root.all("transmission"):
        for driven in node.all("joint"):
            if driven.name() not in robot.joints:
                driven.refuse("is of a transmission, and no joint of the robot", "correct the name")
            add_drive(robot, driven.name())
    beside.close_loops(robot, root)
    tied = robot.in_loops()
    if alone := [joint.name for joint in robot.joints.values() if joint.follows and joint.name not in tied]:
        robot.notes.append(f"free, since the file does not say on which joints they depend: {', '.join(alone)}")
    return robot, root


def _relate(robot: Robot, root: Node) -> None:
    """Take loops and couplings, by the tags of URDF+ and of its older dialects, whose loops hold points together."""
    for node in root.all("loop"):
        robot.loops.append(_loop(node, robot, node.get("type") or "revolute"))
    for node in root.all("loop_constraint"):
        robot.loops.append(_loop(node, robot, "spherical", _OLD_ENDS))
    if any(child.tag == "joint" for part in root.children if part.tag == "gazebo" for child in part.children):
        for node in (joint for part in root.all("gazebo") for joint in part.all("joint")):
            _add_sdf_joint(robot, node)
    for node in root.all("coupling"):
        robot.couplings.append(_coupling(node, robot))
    for node in root.all("joint_constraint"):
        robot.couplings.append(_coupling(node, robot, _OLD_ENDS, "gear_ratio"))
    for node in root.all("constraint"):
        match node.get("type"):
            case "position":
                robot.loops.append(_loop(node, robot, "spherical"))
            case "rolling":
                robot.couplings.append(_coupling(node, robot))
            case kind:
                node.refuse(f"has the unknown type '{(kind or '')[:40]}'", "write it as <loop> or <coupling>")


def _add(into: dict[str, Any], thing: Link | Joint, node: Node) -> None:
    if thing.name in into:
        node.refuse("has the name of another", "give each a unique name")
    into[thing.name] = thing


def _link(node: Node) -> Link:
    link = Link(node.name(), node)
    if inertial := node.find("inertial"):
        at = _pose(inertial.find("origin"))
        link.mass = inertial.need("mass").number("value")
        link.centre = at.place
        if moments := inertial.find("inertia"):
            xx, xy, xz, yy, yz, zz = (moments.number(f"i{ij}", 0.0) for ij in ("xx", "xy", "xz", "yy", "yz", "zz"))
            own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            link.inertia = at.rotation @ own @ at.rotation.T
    for visual in node.all("visual"):
        geometry = visual.find("geometry")
        if geometry and not link.mesh and (mesh := geometry.find("mesh")):
            scale = mesh.numbers(mesh.get("scale"), 3, (1.0, 1.0, 1.0))
            if scale[0] == scale[1] == scale[2] > 0:
                link.mesh, link.scale, link.mesh_pose = mesh.name("filename"), scale[0], _pose(visual.find("origin"))
        if (material := visual.find("material")) and (colour := material.find("color")):
            link.colour = colour_of((colour.get("rgba") or "").split())
    return link


def _joint(node: Node, robot: Robot) -> Joint:
    kind = node.get("type") or ""
    if kind == "planar":
        node.refuse("is of type planar", "write it as two prismatic joints and a revolute one")
    if kind not in _KINDS:
        node.refuse(f"has the unknown type '{kind[:40]}'", f"use one of {', '.join(_KINDS)}")
    parent, child = (node.need(end).name("link") for end in ("parent", "child"))
    for name in (parent, child):
        if name not in robot.links:
            node.refuse(f"names the link '{name[:60]}', which is not there", "add the link, or correct the name")
    joint = Joint(node.name(), node, _KINDS[kind], parent, child, _pose(node.find("origin")))
    axis = node.find("axis")
    if axis and axis.get("xyz") and joint.kind in ("revolute", "prismatic"):
        joint.axis = _direction(axis, axis.get("xyz"))
    dynamics = node.find("dynamics")
    if dynamics and joint.freedom:
        joint.damping, joint.friction = dynamics.number("damping", 0.0), dynamics.number("friction", 0.0)
    elif dynamics and (idle := [key for key in ("damping", "friction") if dynamics.get(key)]):
        robot.notes.append(f"{joint.name} is fixed: {' and '.join(idle)} of its <dynamics> have no effect")
    limit = next((child for child in node.children if child.tag == "limit"), None)
    if limit and joint.freedom == 1 and kind != "continuous" and limit.attributes.get("lower", "-") == limit.attributes.get("upper", "+"):
        robot.notes.append(f"{joint.name} moves, though its limits are equal: limits are not heeded")
    joint.follows = (node.get("independent") or "").lower() == "false" or node.find("mimic") is not None
    return joint


def _couple(node: Node, robot: Robot) -> None:
    if mimic := node.find("mimic"):
        independent = mimic.name("joint")
        if independent not in robot.joints:
            mimic.refuse(f"follows the joint '{independent[:60]}', which is not there", "correct the name")
        name, ratio = node.name(), mimic.number("multiplier", 1.0)
        if name not in robot.joints:
            mimic.refuse("is of a joint that the sidecar YAML makes a Cardan joint", "remove one of them")
        if not robot.joints[name].freedom:
            robot.notes.append(f"{name} no longer follows {independent}, since it is fixed")
            return
        if not robot.joints[independent].freedom:
            mimic.refuse(f"follows the joint '{independent[:60]}', which is fixed", "fix both")
        robot.couplings.append(Coupling(f"{name}_mimic", mimic, {name: 1.0, independent: -ratio}, mimic.number("offset", 0.0)))


def _require_tree(robot: Robot, root: Node) -> None:
    seen = {link.name for link in robot.root()}
    for joint in robot.outwards():
        if joint.child in seen:
            joint.node.refuse(f"carries '{joint.child}', which another joint carries too", "a URDF is a tree: write loops as <loop>")
        seen.add(joint.child)
    if left := [link for name, link in robot.links.items() if name not in seen]:
        left[0].node.refuse("hangs in a circle of joints", "a URDF is a tree: write loops as <loop>")
    if not robot.links:
        root.refuse("has no <link>", "expand it first, if it is a macro")
    if len(robot.root()) != 1:
        root.refuse(f"has {len(robot.root())} links without a parent, where one is needed", "connect them with joints")


def _loop(node: Node, robot: Robot, kind: str, tags: tuple[str, str] = _ENDS) -> Loop:
    if kind not in ("revolute", "continuous", "spherical", "fixed", "prismatic"):
        node.refuse(f"has the unknown type '{kind[:40]}'", "use revolute, prismatic, spherical or fixed")
    ends = [node.need(tag) for tag in tags]
    names = [end.name("link") for end in ends]
    for end, name in zip(ends, names, strict=True):
        if name not in robot.links:
            end.refuse(f"names the link '{name[:60]}', which is not there", "correct the name")
    axis = node.find("axis")
    first, second = (_pose(end.find("origin") or node.find(f"{end.tag}_origin")) for end in ends)
    direction = np.array([1.0, 0.0, 0.0]) if axis is None else _direction(axis, axis.get("xyz"))
    return Loop(node.name(), node, _KINDS[kind], (names[0], names[1]), first, second, direction)


def _add_sdf_joint(robot: Robot, node: Node) -> None:
    """A joint of SDF in <gazebo> closes a loop; its pose is in its child, and it is closed in the zero position."""
    name, kind = node.name(), node.get("type") or ""
    ends = [node.need(tag).text.strip() for tag in ("parent", "child")]
    pose = node.find("pose")
    note = "left out is the loop that the joint '{}' in <gazebo> closes: {}"
    if kind not in ("revolute", "continuous", "prismatic", "fixed", "ball"):
        robot.notes.append(note.format(name, f"it is of type '{kind[:40]}'"))
        return
    if any(end not in robot.links for end in ends) or ends[0] == ends[1] or (pose is not None and pose.attributes):
        robot.notes.append(note.format(name, "its ends or its pose are not those of links"))
        return
    x, y, z, *angles = pose.numbers(pose.text, 6, (0.0,) * 6) if pose is not None else (0.0,) * 6
    second = Pose(roll_pitch_yaw(tuple(angles)), np.array([x, y, z]))
    poses, axis = robot.poses({}), np.array([0.0, 0.0, 1.0])
    frame = poses[ends[1]] @ second
    if axis_node := node.find("axis"):
        axis = _direction(axis_node.need("xyz"), axis_node.need("xyz").text)
        of_model = axis_node.find("use_parent_model_frame")
        seen = axis_node.need("xyz").get("expressed_in") or ""
        if seen not in ("", "__model__"):
            robot.notes.append(note.format(name, f"its axis is expressed in '{seen[:40]}'"))
            return
        if seen or (of_model is not None and of_model.text.strip() in ("1", "true")):
            axis = frame.rotation.T @ axis
    loop = Loop(name, node, _KINDS.get(kind, "spherical"), (ends[0], ends[1]), poses[ends[0]].inverse() @ frame, second, axis)
    if dynamics := axis_node.find("dynamics") if axis_node else None:
        for key in ("damping", "friction"):
            if value := dynamics.find(key):
                setattr(loop, key, value.numbers(value.text, 1)[0])
    robot.loops.append(loop)


def _coupling(node: Node, robot: Robot, tags: tuple[str, str] = _ENDS, factor: str = "ratio") -> Coupling:
    first, second = (_joints_to(robot, node.need(tag).name("link"), node) for tag in tags)
    common = sum(1 for _ in takewhile(lambda pair: pair[0] is pair[1], zip(first, second, strict=False)))
    ratio = node.need(factor).number("value")
    node.get("type")
    return Coupling(node.name(), node, {**{j.name: ratio for j in first[common:]}, **{j.name: -1.0 for j in second[common:]}})


def _joints_to(robot: Robot, link: str, node: Node) -> list[Joint]:
    if link not in robot.links:
        node.refuse(f"names the link '{link[:60]}', which is not there", "correct the name")
    carried = {joint.child: joint for joint in robot.joints.values()}
    return [joint for joint in reversed(robot.inwards(carried, link)) if joint.freedom]


def _pose(node: Node | None) -> Pose:
    if node is None:
        return Pose()
    place = node.numbers(node.get("xyz"), 3, (0.0, 0.0, 0.0))
    if quaternion := node.get("quat_xyzw"):
        node.get("rpy")
        return Pose(of_xyzw(node, node.numbers(quaternion, 4)), np.array(place))
    return Pose(roll_pitch_yaw(node.numbers(node.get("rpy"), 3, (0.0, 0.0, 0.0))), np.array(place))


def _direction(node: Node, text: str | None) -> Array:
    axis = np.array(node.numbers(text, 3, (1.0, 0.0, 0.0)))
    length = np.linalg.norm(axis)
    if length < 1e-9:
        node.refuse("is an axis without length", "give it a direction")
    return np.asarray(axis / length)


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
