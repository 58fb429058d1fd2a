"""SDF: links with poses in the model's frame or relative to others, joints of which a link may be the child of several."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cutjoint.importing.robot import Array, Coupling, Joint, Link, Loop, Pose, Robot, colour_of, of_xyzw, roll_pitch_yaw, unlike
from cutjoint.importing.xml import Node, read_xml

_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed", "ball": "spherical"}
_GEARBOX = "gearbox"
_WORLD = "world"


def read_sdf(path: Path) -> tuple[Robot, Node]:
    """The robot of an SDF file with one model.  Raises ModelError where it is wrong, or says what a model file cannot."""
    root = read_xml(path)
    if root.tag != "sdf":
        root.refuse("is no SDF", "name a file whose outermost element is <sdf>")
    version = tuple(int(part) if part.isdigit() else 0 for part in (root.get("version") or "1.9").split("."))
    world = root.find("world")
    model = (world or root).need("model")
    for nested in (*model.all("include"), *model.all("model")):
        nested.refuse("stands inside another model", "write its links and joints out")
    robot = Robot(model.attributes.get("name") or path.stem)
    if world:
        gravity = world.find("gravity")
        x, y, z = gravity.numbers(gravity.text, 3) if gravity else (0.0, 0.0, -9.8)
        robot.gravity = (x, y, z)
    robot.links[_WORLD] = Link(_WORLD, model)
    for node in model.all("link"):
        if node.name() == _WORLD:
            node.refuse("has the name of the world", "give it another name")
        robot.links[node.name()] = _link(node)
    _Assembly(robot, model, old=version < (1, 5)).join()
    return robot, root


class _Assembly:
    """The frames of a model, all in that of the world, and the tree of its joints, in the file's order.

    In ``old`` files, before version 1.5, the axes of joints are in the model's frame.
    """

    def __init__(self, robot: Robot, model: Node, *, old: bool) -> None:
        self._robot, self._model, self._old = robot, model, old
        self._base = _pose(model)
        self._nodes: dict[str, Node] = {}
        for node in (node for tag in ("link", "joint", "frame") for node in model.all(tag)):
            if node.name() in self._nodes:
                node.refuse("has the name of another", "give each link, joint and frame a name of its own")
            self._nodes[node.name()] = node
        self._open: list[str] = []
        self._placed = {_WORLD: Pose(), **{node.name(): self._frame(node) for node in model.all("link")}}
        self._carrier: dict[str, Joint] = {}

    def join(self) -> None:
        """Hang each link on the first joint whose child it is; other joints close loops, and links without a joint move freely."""
        static = self._model.find("static")
        still = static is not None and static.text.strip() in ("1", "true")
        nodes = [] if still else self._model.all("joint")
        for node in nodes:
            if node.get("type") != _GEARBOX:
                self._join(node)
        for name, link in self._robot.links.items():
            if name not in self._carrier and name != _WORLD:
                kind, suffix = ("fixed", "weld") if still else ("free", "free")
                joint = Joint(unlike(f"{name}_{suffix}", self._nodes), link.node, kind, _WORLD, name, self._placed[name])
                self._robot.joints[joint.name] = self._carrier[name] = joint
        for node in nodes:
            self._mesh(node) if node.get("type") == _GEARBOX else self._follow(node)

    def _follow(self, node: Node) -> None:
        """A joint that follows another: its coordinate is multiplier times (that of the leader - reference) + offset."""
        axis, joints = node.find("axis"), self._robot.joints
        mimic = axis.find("mimic") if axis else None
        if mimic is None:
            return
        name, leader = node.name(), mimic.name("joint")
        for one in (name, leader):
            if one not in joints or joints[one].freedom != 1:
                mimic.refuse(f"relates '{one[:60]}', which has no coordinate of its own", "relate joints that close no loop, of one axis")
        ratio, offset, reference = _number(mimic, "multiplier", 1.0), _number(mimic, "offset", 0.0), _number(mimic, "reference", 0.0)
        joints[name].follows = True
        self._robot.couplings.append(Coupling(f"{name}_mimic", mimic, {name: 1.0, leader: -ratio}, offset - ratio * reference))

    def _join(self, node: Node) -> None:
        kind, (parent, child) = node.get("type") or "", (self._end(node, end) for end in ("parent", "child"))
        if kind not in _KINDS:
            node.refuse(f"is of type '{kind[:40]}'", f"use one of {', '.join((*_KINDS, _GEARBOX))}")
        if node.find("axis2"):
            node.refuse("has a second axis", "write two joints with a link between")
        frame, name = self._frame(node), node.name()
        first, second = (self._placed[link].inverse() @ frame for link in (parent, child))
        axis_node = node.find("axis")
        axis = np.array([0.0, 0.0, 1.0])
        if axis_node and _KINDS[kind] in ("revolute", "prismatic"):
            axis = self._axis(axis_node, frame)
        resisting: Joint | Loop
        if child == _WORLD or child in self._carrier or self._hangs_on(parent, child):
            resisting = loop = Loop(name, node, _KINDS[kind], (parent, child), first, second, axis)
            self._robot.loops.append(loop)
        else:
            resisting = joint = Joint(name, node, _KINDS[kind], parent, child, first, axis, second.inverse())
            self._robot.joints[name] = self._carrier[child] = joint
        dynamics = axis_node.find("dynamics") if axis_node else None
        if dynamics:
            tags = ("damping", "friction", "spring_stiffness", "spring_reference")
            resisting.damping, resisting.friction, resisting.stiffness, resisting.rest = (_number(dynamics, tag, 0.0) for tag in tags)

    def _end(self, node: Node, tag: str) -> str:
        end = node.need(tag)
        name = end.text.strip()
        if name != _WORLD and name not in self._robot.links:
            end.refuse(f"names the link '{name[:60]}', which is not there", "correct the name")
        return name

    def _hangs_on(self, link: str, ancestor: str) -> bool:
        while link in self._carrier and link != ancestor:
            link = self._carrier[link].parent
        return link == ancestor

    def _frame(self, node: Node) -> Pose:
        """The pose of a link, a joint or a frame."""
        name = node.name()
        if name in self._open or len(self._open) > 50:
            node.refuse("is placed relative to itself", "break the circle of relative_to")
        self._open.append(name)
        given = node.find("pose")
        relative = (given.get("relative_to") or given.get("frame") or "") if given else ""
        if not relative and node.tag == "joint":
            relative = node.need("child").text.strip()
        elif not relative and node.tag == "frame":
            relative = node.get("attached_to") or ""
        base = Pose() if relative == _WORLD else self._base
        if relative not in ("", "__model__", _WORLD):
            if relative not in self._nodes:
                node.refuse(f"is placed relative to '{relative[:60]}', which is not there", "correct the name")
            base = self._frame(self._nodes[relative])
        self._open.pop()
        return base @ _pose(node)

    def _axis(self, node: Node, frame: Pose) -> Array:
        """A unit vector in the joint's frame."""
        direction = node.need("xyz")
        axis = np.array(direction.numbers(direction.text, 3))
        if np.linalg.norm(axis) < 1e-9:
            direction.refuse("is an axis without length", "give it a direction")
        of_model = node.find("use_parent_model_frame")
        in_model = of_model.text.strip() in ("1", "true") if of_model else self._old
        expressed = direction.get("expressed_in") or ("__model__" if in_model else "")
        if expressed:
            if expressed not in ("__model__", _WORLD) and expressed not in self._nodes:
                direction.refuse(f"is expressed in '{expressed[:60]}', which is not there", "correct the name")
            seen = {"__model__": self._base, _WORLD: Pose()}.get(expressed) or self._frame(self._nodes[expressed])
            axis = frame.rotation.T @ seen.rotation @ axis
        unit: Array = axis / np.linalg.norm(axis)
        return unit

    def _mesh(self, node: Node) -> None:
        """A gearbox: from a reference body the child's angle is -ratio times the parent's, each about its axis."""
        reference, ratio = node.need("gearbox_reference_body"), node.need("gearbox_ratio")
        frame, terms = self._frame(node), dict[str, float]()
        for end, tag, factor in (("parent", "axis", ratio.numbers(ratio.text, 1)[0]), ("child", "axis2", 1.0)):
            axis_node = node.find(tag) or node.need("axis")
            axis = frame.rotation @ self._axis(axis_node, frame)
            for joint, sign in self._way(reference.text.strip(), self._end(node, end), node):
                along = float(axis @ (self._placed[joint.parent].rotation @ joint.origin.rotation @ joint.axis))
                if joint.kind != "revolute" or abs(along) < 1 - 1e-6:
                    node.refuse(f"relates '{joint.name}', which does not turn about its axis", "couple hinges that are parallel")
                terms[joint.name] = terms.get(joint.name, 0.0) + factor * sign * np.sign(along)
        self._robot.couplings.append(Coupling(node.name(), node, terms))

    def _way(self, start: str, end: str, node: Node) -> list[tuple[Joint, int]]:
        """The joints from a link to another, and whether they are passed outwards (1) or inwards (-1)."""
        ways: list[list[Joint]] = []
        for link in (start, end):
            way = []
            while link in self._carrier:
                way.append(self._carrier[link])
                link = self._carrier[link].parent
            ways.append(way)
        inwards, outwards = ([j for j in way if j not in other and j.freedom] for way, other in (ways, ways[::-1]))
        if not ways[0] and start != _WORLD:
            node.refuse(f"has the reference body '{start[:60]}', which is not there", "correct the name")
        return [*((j, -1) for j in inwards), *((j, 1) for j in outwards)]


def _number(node: Node, tag: str, default: float) -> float:
    found = node.find(tag)
    return found.numbers(found.text, 1)[0] if found else default


def _link(node: Node) -> Link:
    link = Link(node.name(), node)
    if inertial := node.find("inertial"):
        at, moments = _pose(inertial), inertial.find("inertia")
        link.mass = _number(inertial, "mass", 1.0)
        own = np.eye(3)
        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
            entry = moments.find("i" + "xyz"[i] + "xyz"[j]) if moments else None
            if entry:
                own[i, j] = own[j, i] = entry.numbers(entry.text, 1)[0]
        link.centre, link.inertia = at.place, at.rotation @ own @ at.rotation.T
    for visual in node.all("visual"):
        geometry = visual.find("geometry")
        mesh = geometry.find("mesh") if geometry else None
        if mesh and not link.mesh:
            scaling = mesh.find("scale")
            scale = mesh.numbers(scaling.text if scaling else "", 3, (1.0, 1.0, 1.0))
            if scale[0] == scale[1] == scale[2] > 0:
                link.mesh, link.scale, link.mesh_pose = mesh.need("uri").text.strip(), scale[0], _pose(visual)
        material = visual.find("material")
        colour = (material.find("diffuse") or material.find("ambient")) if material else None
        if colour:
            link.colour = colour_of(colour.numbers(colour.text, 4))
    return link


def _pose(node: Node) -> Pose:
    given = node.find("pose")
    if given is None:
        return Pose()
    form = given.get("rotation_format") or "euler_rpy"
    if form == "quat_xyzw":
        x, y, z, *quaternion = given.numbers(given.text, 7, (0.0,) * 6 + (1.0,))
        return Pose(of_xyzw(given, tuple(quaternion)), np.array([x, y, z]))
    if form != "euler_rpy":
        given.refuse(f"has the unknown rotation_format '{form[:40]}'", "use euler_rpy or quat_xyzw")
    numbers = given.numbers(given.text, 6, (0.0,) * 6)
    unit = np.pi / 180 if (given.get("degrees") or "false").strip() in ("1", "true") else 1.0
    return Pose(roll_pitch_yaw(tuple(unit * angle for angle in numbers[3:])), np.array(numbers[:3]))
