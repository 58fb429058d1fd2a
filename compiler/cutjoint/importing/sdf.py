"""SDF: models, within each other too, of links with poses relative to others; a link may be the child of several joints."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cutjoint.importing.robot import Array, Coupling, Joint, Link, Loop, Pose, Robot, colour_of, of_xyzw, roll_pitch_yaw, unique_name
from cutjoint.importing.xml import Node, read_xml
from cutjoint.model.errors import nearest

_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed", "ball": "spherical"}
_GEARBOX = "gearbox"
_WORLD = "world"
_OF_WORLD = "/"  #: begins the names of what is in the world and in no model
_VERSION = re.compile(r"\d{1,4}(\.\d{1,4})*", re.ASCII)


def read_sdf(path: Path, model: str = "") -> tuple[Robot, Node]:
    """The robot of an SDF file: of all its models, or of the one that has a name.  Raises ModelError where it is wrong, or says what a
    model file cannot."""
    root = read_xml(path)
    if root.tag != "sdf":
        root.refuse("is no SDF", "name a file whose outermost element is <sdf>")
    version = root.get("version") or "1.9"
    if not _VERSION.fullmatch(version):
        root.refuse(f"has the version '{version[:20]}'", "write for example 1.9")
    world = root.find("world")
    around = world or root
    models = around.all("model")
    if not models:
        around.refuse("has no <model>", "add one; included files are not read")
    if model and not (models := [node for node in models if node.get("name") == model]):
        around.refuse(f"has no model '{model[:60]}'", nearest(model, [node.name() for node in around.all("model")], "models"))
    several = around.attributes.get("name") if len(models) > 1 else models[0].attributes.get("name")
    robot = Robot(several or path.stem)
    if world:
        gravity = world.find("gravity")
        x, y, z = gravity.numbers(gravity.text, 3) if gravity else (0.0, 0.0, -9.8)
        robot.gravity = (x, y, z)
    robot.links[_WORLD] = Link(_WORLD, models[0])
    _Assembly(robot, world, models, old=[int(part) for part in version.split(".")] < [1, 5]).join(alone=bool(model))
    return robot, root


@dataclass(frozen=True)
class _Scope:
    """A model, or the world (None) around all models.
    ``prefix`` is that of what is in it, ``outer`` the scope that it is in, ``still`` whether it stands still."""

    node: Node | None
    name: str
    prefix: str
    outer: "_Scope | None" = None
    still: bool = False


class _Assembly:
    """The frames of models, all in that of the world, and the tree of their joints, in the file's order.
    In ``old`` files, before version 1.5, the axes of joints are in the model's frame. Names of several models, and of those inside
    others, begin with those of their models and ``::``."""

    def __init__(self, robot: Robot, world: Node | None, models: list[Node], *, old: bool) -> None:
        self._robot, self._old = robot, old
        self._nodes: dict[str, tuple[Node, _Scope]] = {}
        self._scopes: dict[str, _Scope] = {}
        self._placed: dict[str, Pose] = {_WORLD: Pose()}
        self._carrier: dict[str, Joint] = {}
        self._only = f"{models[0].name()}::" if len(models) == 1 else ""
        everything = _Scope(None, _WORLD, _OF_WORLD)
        for node in (node for tag in ("frame", "joint") for node in (world.all(tag) if world else ())):
            self._add(node, everything)
        for model in models:
            self._add_model(model, everything, "" if self._only else f"{model.name()}::")

    def _add(self, node: Node, scope: _Scope) -> str:
        name = scope.prefix + node.name()
        if name in self._nodes:
            node.refuse("has the name of another", "give each model, link, joint and frame a unique name")
        self._nodes[name] = node, scope
        return name

    def _add_model(self, model: Node, outer: _Scope, prefix: str) -> None:
        static = model.find("static")
        still = outer.still or (static is not None and static.text.strip() in ("1", "true"))
        scope = _Scope(model, self._add(model, outer), prefix, outer, still)
        self._scopes[scope.name] = scope
        for node in model.all("include"):
            node.refuse("includes another file, which is not read", "write its links and joints out")
        for node in (node for tag in ("link", "joint", "frame") for node in model.all(tag)):
            name = self._add(node, scope)
            if name == _WORLD:
                node.refuse("has the name of the world", "give it another name")
            if node.tag == "link":
                self._robot.links[name] = _link(node, name, still=still)
        for inner in model.all("model"):
            self._add_model(inner, scope, f"{prefix}{inner.name()}::")

    def join(self, *, alone: bool) -> None:
        """Hang each link on the first joint whose child it is; other joints close loops, and links without a joint move freely.
        A model ``alone`` has no joints with others."""
        joints = [(name, node) for name, (node, scope) in self._nodes.items()
                  if node.tag == "joint" and not scope.still and (scope.outer or not alone)]  # fmt: skip
        for name, node in joints:
            if node.get("type") != _GEARBOX:
                self._join(name, node)
        for name, link in self._robot.links.items():
            if name not in self._carrier and name != _WORLD:
                kind, suffix = ("fixed", "weld") if self._nodes[name][1].still else ("free", "free")
                joint = Joint(unique_name(f"{name}_{suffix}", self._nodes), link.node, kind, _WORLD, name, self._pose(name))
                self._robot.joints[joint.name] = self._carrier[name] = joint
        for name, node in joints:
            self._mesh(name, node) if node.get("type") == _GEARBOX else self._follow(name, node)

    def _follow(self, name: str, node: Node) -> None:
        """A joint that follows another: its coordinate is multiplier times (that of the leader - reference) + offset."""
        axis, joints = node.find("axis"), self._robot.joints
        mimic = axis.find("mimic") if axis else None
        if mimic is None:
            return
        independent = self._nodes[name][1].prefix + mimic.name("joint")
        for one in (name, independent):
            if one not in joints or joints[one].freedom != 1:
                mimic.refuse(f"relates '{one[:60]}', which has no coordinate of its own", "relate joints that close no loop, of one axis")
        ratio, offset, reference = _number(mimic, "multiplier", 1.0), _number(mimic, "offset", 0.0), _number(mimic, "reference", 0.0)
        joints[name].follows = True
        self._robot.couplings.append(Coupling(f"{name}_mimic", mimic, {name: 1.0, independent: -ratio}, offset - ratio * reference))

    def _join(self, name: str, node: Node) -> None:
        kind, (parent, child) = node.get("type") or "", (self._end(name, end) for end in ("parent", "child"))
        if kind not in _KINDS:
            node.refuse(f"is of type '{kind[:40]}'", f"use one of {', '.join((*_KINDS, _GEARBOX))}")
        if node.find("axis2"):
            node.refuse("has a second axis", "write two joints with a link between")
        if parent == child:
            node.refuse(f"connects '{parent}' with itself", "leave it out")
        frame = self._pose(name)
        first, second = (self._pose(link).inverse() @ frame for link in (parent, child))
        axis_node = node.find("axis")
        axis = np.array([0.0, 0.0, 1.0])
        if axis_node and _KINDS[kind] in ("revolute", "prismatic"):
            axis = self._axis(axis_node, name)
        resisting: Joint | Loop
        if child == _WORLD or child in self._carrier or child in (joint.parent for joint in self._robot.inwards(self._carrier, parent)):
            resisting = loop = Loop(name, node, _KINDS[kind], (parent, child), first, second, axis)
            self._robot.loops.append(loop)
        else:
            resisting = joint = Joint(name, node, _KINDS[kind], parent, child, first, axis, second.inverse())
            self._robot.joints[name] = self._carrier[child] = joint
        dynamics = axis_node.find("dynamics") if axis_node else None
        if dynamics:
            tags = ("damping", "friction", "spring_stiffness", "spring_reference")
            resisting.damping, resisting.friction, resisting.stiffness, resisting.rest = (_number(dynamics, tag, 0.0) for tag in tags)

    def _end(self, name: str, tag: str) -> str:
        node, scope = self._nodes[name]
        end = node.need(tag)
        said = end.text.strip()
        found = self._find(said, scope) or end.refuse(f"names the link '{said[:60]}', which is not there", "correct the name")
        return self._link_of(found, end)

    def _find(self, name: str, scope: _Scope) -> str | None:
        """The whole name of what a name means in a model, None if it is not there."""
        if name in (_WORLD, "__model__"):
            return _WORLD if name == _WORLD else scope.name
        names = [scope.prefix + name, *([name.removeprefix(self._only)] if scope.outer is None else [])]
        return next((each for each in names if each in self._nodes), None)

    def _link_of(self, name: str, where: Node) -> str:
        seen = set[str]()
        while name != _WORLD and name not in self._robot.links:
            node, scope = self._nodes[name]
            if name in seen:
                where.refuse("is fixed to itself", "break the circle of attached_to")
            seen.add(name)
            said = node.need("child").text.strip() if node.tag == "joint" else node.get("attached_to") or "__model__"
            if node.tag == "model":
                scope, said = self._scopes[name], node.get("canonical_link") or ""
                first = (link for link in self._robot.links if link.startswith(scope.prefix) and link != _WORLD)
                found = next(first, None) if not said else self._find(said, scope)
            else:
                found = self._find(said, scope)
            name = found or where.refuse(f"is fixed to '{said[:60]}', which is not there", "correct the name")
        return name

    def _pose(self, name: str, within: str = "") -> Pose:
        """The global pose of a link, a joint, a frame or a model, or that ``within`` a model."""
        way, known = dict[str, None](), ({within: Pose()} if within else self._placed)
        at = name
        while at not in known:
            node = self._nodes[at][0] if at != _WORLD else self._nodes[within][0]
            if at in way or at == _WORLD:
                node.refuse("is placed relative to itself", "break the circle of relative_to")
            way[at] = None
            at = self._base(at)
        pose = known[at]
        for each in reversed(way):
            pose = known[each] = pose @ self._local_pose(each)
        return pose

    def _base(self, name: str) -> str:
        """The frame in which the pose of another is given."""
        node, scope = self._nodes[name]
        pose = node.find("pose")
        relative = (pose.get("relative_to") or pose.get("frame") or "") if pose else ""
        if not relative and node.tag in ("joint", "frame"):
            relative = node.need("child").text.strip() if node.tag == "joint" else node.get("attached_to") or ""
        found = self._find(relative or "__model__", scope)
        return found or node.refuse(f"is placed relative to '{relative[:60]}', which is not there", "correct the name")

    def _local_pose(self, name: str) -> Pose:
        """The pose of something in its base; a model may say it of one of its frames."""
        node, _ = self._nodes[name]
        frame = node.get("placement_frame") if node.tag == "model" else None
        if not frame:
            return _pose(node)
        found = self._find(frame, self._scopes[name])
        if found is None or found == _WORLD:
            node.refuse(f"is placed by '{frame[:60]}', which is not there", "correct the name")
        return _pose(node) @ self._pose(found, name).inverse()

    def _axis(self, node: Node, name: str) -> Array:
        scope = self._nodes[name][1]
        direction = node.need("xyz")
        axis = np.array(direction.numbers(direction.text, 3))
        if np.linalg.norm(axis) < 1e-9:
            direction.refuse("is an axis without length", "give it a direction")
        of_model = node.find("use_parent_model_frame")
        in_model = of_model.text.strip() in ("1", "true") if of_model else self._old
        expressed = direction.get("expressed_in") or ("__model__" if in_model else "")
        if expressed:
            message = f"is expressed in '{expressed[:60]}', which is not there"
            found = self._find(expressed, scope) or direction.refuse(message, "correct the name")
            axis = self._pose(name).rotation.T @ self._pose(found).rotation @ axis
        return np.asarray(axis / np.linalg.norm(axis))

    def _mesh(self, name: str, node: Node) -> None:
        """A gearbox: from a reference body the child's angle is -ratio times the parent's, each about its axis."""
        reference, ratio = node.need("gearbox_reference_body"), node.need("gearbox_ratio")
        frame, terms = self._pose(name), dict[str, float]()
        message = f"has the reference body '{reference.text.strip()[:60]}', which is not there"
        start = self._find(reference.text.strip(), self._nodes[name][1]) or node.refuse(message, "correct the name")
        for end, tag, factor in (("parent", "axis", ratio.numbers(ratio.text, 1)[0]), ("child", "axis2", 1.0)):
            axis_node = node.find(tag) or node.need("axis")
            axis = frame.rotation @ self._axis(axis_node, name)
            for joint, sign in self._joints_between(self._link_of(start, node), self._end(name, end)):
                along = float(axis @ (self._pose(joint.parent).rotation @ joint.origin.rotation @ joint.axis))
                if joint.kind != "revolute" or abs(along) < 1 - 1e-6:
                    node.refuse(f"relates '{joint.name}', which does not turn about its axis", "couple hinges that are parallel")
                terms[joint.name] = terms.get(joint.name, 0.0) + factor * sign * np.sign(along)
        self._robot.couplings.append(Coupling(name, node, terms))

    def _joints_between(self, start: str, end: str) -> list[tuple[Joint, int]]:
        """The joints from a link to another, and whether they are passed outwards (1) or inwards (-1)."""
        ways = [self._robot.inwards(self._carrier, link) for link in (start, end)]
        inwards, outwards = ([j for j in way if j not in other and j.freedom] for way, other in (ways, ways[::-1]))
        return [*((j, -1) for j in inwards), *((j, 1) for j in outwards)]


def _number(node: Node, tag: str, default: float) -> float:
    found = node.find(tag)
    return found.numbers(found.text, 1)[0] if found else default


def _link(node: Node, name: str, *, still: bool) -> Link:
    link = Link(name, node)
    for tag, usual in (("gravity", ("", "1", "true")), ("kinematic", ("", "0", "false"))) if not still else ():
        if (given := node.find(tag)) and given.text.strip().lower() not in usual:
            given.refuse(f"is '{given.text.strip()[:20]}', which has no counterpart here", "leave it out")
    if inertial := node.find("inertial"):
        if not still and (inertial.get("auto") or "").strip() in ("1", "true"):
            inertial.refuse("takes mass and inertia from collisions ('auto'), which are not read", "write mass, pose and inertia out")
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
            link.colour = colour_of(colour.text.split())
    return link


def _pose(node: Node) -> Pose:
    pose = node.find("pose")
    if pose is None:
        return Pose()
    form = pose.get("rotation_format") or "euler_rpy"
    if form == "quat_xyzw":
        x, y, z, *quaternion = pose.numbers(pose.text, 7, (0.0,) * 6 + (1.0,))
        return Pose(of_xyzw(pose, tuple(quaternion)), np.array([x, y, z]))
    if form != "euler_rpy":
        pose.refuse(f"has the unknown rotation_format '{form[:40]}'", "use euler_rpy or quat_xyzw")
    numbers = pose.numbers(pose.text, 6, (0.0,) * 6)
    unit = np.pi / 180 if (pose.get("degrees") or "false").strip() in ("1", "true") else 1.0
    return Pose(roll_pitch_yaw(tuple(unit * angle for angle in numbers[3:])), np.array(numbers[:3]))
