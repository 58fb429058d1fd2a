"""URDF: trees with mimic joints, loops and couplings of URDF+, and loops in a YAML beside it (``closed_loop``, ``type``, ``name_mot``)."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.importing.robot import Array, Coupling, Drive, Joint, Link, Loop, Pose, Robot, colour_of, of_xyzw, roll_pitch_yaw
from cutjoint.importing.xml import Node, read_xml
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Span
from cutjoint.model.source import parse_yaml, read_text

_KINDS = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed", "floating": "free",
    "spherical": "spherical",
}  # fmt: skip


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
    for node in root.all("joint"):
        _couple(node, robot)
    _require_tree(robot, root)
    for node in root.all("loop"):
        robot.loops.append(_loop(node, robot))
    for node in root.all("coupling"):
        robot.couplings.append(_coupling(node, robot))
    for node in root.all("transmission"):
        for driven in node.all("joint"):
            if driven.name() not in robot.joints:
                driven.refuse("is of a transmission, and no joint of the robot", "correct the name")
            _drive(robot, driven.name())
    beside = path.with_suffix(".yaml")
    if beside.is_file() and "closed_loop" in read_text(beside):
        _add_closures(robot, root, beside)
    return robot, root


def _drive(robot: Robot, joint: str) -> None:
    if all(drive.joint != joint for drive in robot.drives):
        robot.drives.append(Drive(f"{joint}_drive", joint))


def _add(into: dict[str, Any], thing: Link | Joint, node: Node) -> None:
    if thing.name in into:
        node.refuse("has the name of another", "give each a name of its own")
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
            link.colour = colour_of(colour.numbers(colour.get("rgba"), 4))
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
    limit = next((child for child in node.children if child.tag == "limit"), None)
    if limit and joint.freedom == 1 and kind != "continuous" and limit.attributes.get("lower", "-") == limit.attributes.get("upper", "+"):
        robot.notes.append(f"{joint.name} moves, though its limits are equal: limits are not heeded")
    joint.follows = (node.get("independent") or "").lower() == "false" or node.find("mimic") is not None
    return joint


def _couple(node: Node, robot: Robot) -> None:
    if mimic := node.find("mimic"):
        leader = mimic.name("joint")
        if leader not in robot.joints:
            mimic.refuse(f"follows the joint '{leader[:60]}', which is not there", "correct the name")
        name, ratio = node.name(), mimic.number("multiplier", 1.0)
        if not robot.joints[name].freedom:
            robot.notes.append(f"{name} follows {leader} no more, since it is fixed")
            return
        if not robot.joints[leader].freedom:
            mimic.refuse(f"follows the joint '{leader[:60]}', which is fixed", "fix both")
        robot.couplings.append(Coupling(f"{name}_mimic", mimic, {name: 1.0, leader: -ratio}, mimic.number("offset", 0.0)))


def _require_tree(robot: Robot, root: Node) -> None:
    seen = {link.name for link in robot.root()}
    for joint in robot.outwards():
        if joint.child in seen:
            joint.node.refuse(f"carries '{joint.child}', which another joint carries too", "a URDF is a tree: say loops by <loop>")
        seen.add(joint.child)
    if left := [link for name, link in robot.links.items() if name not in seen]:
        left[0].node.refuse("hangs in a circle of joints", "a URDF is a tree: say loops by <loop>")
    if not robot.links:
        root.refuse("has no <link>", "expand it first, if it is a macro")
    if len(robot.root()) != 1:
        root.refuse(f"has {len(robot.root())} links without a parent, where one is needed", "connect them with joints")


def _loop(node: Node, robot: Robot) -> Loop:
    kind = node.get("type") or "revolute"
    if kind not in ("revolute", "continuous", "spherical", "fixed", "prismatic"):
        node.refuse(f"has the unknown type '{kind[:40]}'", "use revolute, prismatic, spherical or fixed")
    ends = [node.need(end) for end in ("predecessor", "successor")]
    names = [end.name("link") for end in ends]
    for end, name in zip(ends, names, strict=True):
        if name not in robot.links:
            end.refuse(f"names the link '{name[:60]}', which is not there", "correct the name")
    axis = node.find("axis")
    first, second = (_pose(end.find("origin")) for end in ends)
    direction = np.array([1.0, 0.0, 0.0]) if axis is None else _direction(axis, axis.get("xyz"))
    return Loop(node.name(), node, _KINDS[kind], (names[0], names[1]), first, second, direction)


def _coupling(node: Node, robot: Robot) -> Coupling:
    first, second = (_way(robot, node.need(end).name("link"), node) for end in ("predecessor", "successor"))
    common = sum(1 for _ in takewhile(lambda pair: pair[0] is pair[1], zip(first, second, strict=False)))
    ratio = node.need("ratio").number("value")
    node.get("type")
    return Coupling(node.name(), node, {**{j.name: ratio for j in first[common:]}, **{j.name: -1.0 for j in second[common:]}})


def _way(robot: Robot, link: str, node: Node) -> list[Joint]:
    """The moving joints from the root to a link."""
    if link not in robot.links:
        node.refuse(f"names the link '{link[:60]}', which is not there", "correct the name")
    carried = {joint.child: joint for joint in robot.joints.values()}
    way: list[Joint] = []
    while link in carried:
        way.insert(0, carried[link])
        link = carried[link].parent
    return [joint for joint in way if joint.freedom]


def _add_closures(robot: Robot, root: Node, path: Path) -> None:
    """The loops of a YAML beside the file: pairs of frames, which are links or joints, held together in place (3d) or wholly (6d)."""
    source = parse_yaml(read_text(path), str(path))
    data: Any = source.data if isinstance(source.data, dict) else {}
    pairs, kinds = data.get("closed_loop") or (), data.get("type") or ()

    def fail(key: str, message: str) -> ModelError:
        span = source.key_span((key,)) if key in data else Span(file=str(path), line=1, column=1)
        return ModelError([Problem(span=span, element=key, message=message, hint="see the convention in docs/import.md")])

    if len(kinds) not in (0, len(pairs)):
        raise fail("type", f"has {len(kinds)} types for {len(pairs)} loops")
    for i, pair in enumerate(pairs):
        kind = str(kinds[i]).lower() if kinds else "6d"
        if kind not in ("3d", "6d") or not isinstance(pair, tuple) or len(pair) != 2:
            raise fail("closed_loop", "wants pairs of frames, with the type 3d or 6d each")
        ends = [_frame(robot, str(name)) for name in pair]
        if ends[0] is None or ends[1] is None:
            raise fail("closed_loop", f"names a frame that is neither joint nor link: {', '.join(map(str, pair))}")
        robot.loops.append(
            Loop(f"loop_{i + 1}", root, "spherical" if kind == "3d" else "fixed", (ends[0][0], ends[1][0]), ends[0][1], ends[1][1])
        )
    for name in data.get("name_mot") or ():
        if name not in robot.joints:
            raise fail("name_mot", f"names the joint '{name}', which is not there")
        _drive(robot, str(name))


def _frame(robot: Robot, name: str) -> tuple[str, Pose] | None:
    """The link that has a frame, and the frame in it: a joint's is that of its child."""
    if name in robot.joints:
        return robot.joints[name].child, Pose()
    return (name, Pose()) if name in robot.links else None


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
    unit: Array = axis / length
    return unit
