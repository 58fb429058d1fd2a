"""SDF: links with poses in the model's frame or relative to others, joints of which a link may be the child of several."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cutjoint.importing.robot import Array, Coupling, Joint, Link, Loop, Pose, Robot, colour_of, roll_pitch_yaw
from cutjoint.importing.xml import Node, read_xml

_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed", "ball": "spherical"}
_GEARBOX = "gearbox"
_WORLD = "world"


def read_sdf(path: Path) -> tuple[Robot, Node]:
    """The robot of an SDF file with one model.  Raises ModelError where it is wrong, or says what a model file cannot."""
    root = read_xml(path)
    if root.tag != "sdf":
        root.refuse("is no SDF", "name a file whose outermost element is <sdf>")
    root.get("version")
    world = root.find("world")
    model = (world or root).need("model")
    for nested in (*model.all("include"), *model.all("model")):
        nested.refuse("stands inside another model", "write its links and joints out")
    robot = Robot(model.attributes.get("name") or path.stem)
    gravity = world.find("gravity") if world else None
    if gravity:
        x, y, z = gravity.numbers(gravity.text, 3)
        robot.gravity = (x, y, z)
    robot.links[_WORLD] = Link(_WORLD, model)
    for node in model.all("link"):
        if node.name() in robot.links:
            node.refuse("has the name of another", "give each a name of its own")
        robot.links[node.name()] = _link(node)
    _Assembly(robot, model).join()
    return robot, root


class _Assembly:
    """The frames of a model, all in its own frame, and the tree of its joints, in the file's order."""

    def __init__(self, robot: Robot, model: Node) -> None:
        self._robot, self._model = robot, model
        self._nodes = {node.name(): node for tag in ("link", "joint", "frame") for node in model.all(tag)}
        self._open: list[str] = []
        self._placed = {_WORLD: Pose(), **{node.name(): self._frame(node) for node in model.all("link")}}
        self._carrier: dict[str, Joint] = {}

    def join(self) -> None:
        """Hang each link on the first joint whose child it is; other joints close loops, and links without a joint move freely."""
        gearboxes = []
        for node in self._model.all("joint"):
            if node.get("type") == _GEARBOX:
                gearboxes.append(node)
            else:
                self._join(node)
        for name, link in self._robot.links.items():
            if name not in self._carrier and name != _WORLD:
                joint = Joint(f"{name}_free", link.node, "free", _WORLD, name, self._placed[name])
                self._robot.joints[joint.name] = self._carrier[name] = joint
        for node in gearboxes:
            self._mesh(node)

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
            resisting.damping, resisting.friction, resisting.stiffness, resisting.rest = (
                found.numbers(found.text, 1)[0] if (found := dynamics.find(tag)) else 0.0
                for tag in ("damping", "friction", "spring_stiffness", "spring_reference")
            )

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
        base = Pose()
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
        expressed = direction.get("expressed_in") or ("__model__" if of_model and of_model.text.strip() in ("1", "true") else "")
        if expressed:
            if expressed != "__model__" and expressed not in self._nodes:
                direction.refuse(f"is expressed in '{expressed[:60]}', which is not there", "correct the name")
            seen = Pose() if expressed == "__model__" else self._frame(self._nodes[expressed])
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


def _link(node: Node) -> Link:
    link = Link(node.name(), node)
    if inertial := node.find("inertial"):
        at, mass, moments = _pose(inertial), inertial.find("mass"), inertial.find("inertia")
        link.mass = 1.0 if mass is None else mass.numbers(mass.text, 1)[0]
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
    numbers = given.numbers(given.text, 6, (0.0,) * 6)
    return Pose(roll_pitch_yaw(numbers[3:]), np.array(numbers[:3]))
