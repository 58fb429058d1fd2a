"""Mechanism -> MJCF, the file format of MuJoCo's models."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from cutjoint.export.mjcf import CLOSINGS, closures, couple
from cutjoint.export.robots import WORLD
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import COORDINATES, GROUND, JointKind
from cutjoint_bench.export.chains import Part, chain, chain_problems, speeds
from cutjoint_bench.export.laws import Array, Triple
from cutjoint_bench.export.records import Mechanism, PeerGear, PeerJoint, RigidBody

#: Equality constraints as hard as MuJoCo allows: a time constant that it raises to two steps, and the largest impedance.
SOLREF, SOLIMP = "0.0001 1", "0.9999 0.9999 0.001 0.5 2"

#: Guided joints have this many times the mass of all bodies as armature, in kg or kg m2: what reacts on them moves them by a millionth.
GUIDE_INERTIA = 1e6

#: The least principal moment of inertia as a share of the largest, and by the mass of a body without any (m2).
_LEAST_SHARE, _LEAST_BY_MASS = 1e-6, 1e-9
#: The part added to all principal moments, as a share of their sum: rounding must not make one larger than the sum of the others.
_ROUNDING = 1e-14


@dataclass(frozen=True, kw_only=True)
class Mjcf:
    """The file's text; the names of MuJoCo's scalar joints by joint and number of the model's coordinate.
    Bodies whose inertia is raised; the armature of guided joints, kg or kg m2."""

    text: str
    joints: Mapping[tuple[str, int], str]
    raised: tuple[str, ...]
    guide_inertia: float


def write_mjcf(mechanism: Mechanism) -> Mjcf:
    """The model with its start as keyframe.

    Raises:
        ModelError: a joint that MuJoCo does not have.
    """
    _require_joints(mechanism)
    root = Element("mujoco", model=mechanism.name)
    SubElement(root, "compiler", angle="radian")
    option = SubElement(root, "option", gravity=_text(mechanism.gravity), solver="Newton", iterations="100", tolerance="1e-15")
    SubElement(option, "flag", contact="disable", autoreset="disable", diagexact="enable")
    SubElement(SubElement(root, "default"), "equality", solref=SOLREF, solimp=SOLIMP)
    writer = _Writer(mechanism)
    writer.add_children(SubElement(root, "worldbody"), GROUND)
    equalities = [*writer.pitches(), *map(writer.gear, mechanism.gears), *(e for cut in mechanism.cuts for e in writer.closures(cut))]
    if equalities:
        SubElement(root, "equality").extend(equalities)
    SubElement(SubElement(root, "keyframe"), "key", name="start", qvel=_text(writer.speeds))
    indent(root)
    text = tostring(root, encoding="unicode") + "\n"
    return Mjcf(text=text, joints=writer.joints, raised=tuple(writer.raised), guide_inertia=writer.guide_inertia)


@dataclass(frozen=True)
class _Elementary:
    """One of MuJoCo's joints: ``label`` distinguishes it from the others of a chain, ``coordinate`` is that of the model, if any."""

    type: str
    axis: Triple | None
    label: str
    coordinate: int | None = None


@dataclass(frozen=True)
class _Writer:
    """Writes bodies as it walks down the tree; ``speeds`` are in MuJoCo's order then."""

    mechanism: Mechanism
    speeds: list[float] = field(default_factory=list)
    joints: dict[tuple[str, int], str] = field(default_factory=dict)
    raised: list[str] = field(default_factory=list)

    @property
    def guide_inertia(self) -> float:
        return GUIDE_INERTIA * sum(body.mass for body in self.mechanism.bodies)

    def body(self, name: str) -> RigidBody:
        return next(b for b in self.mechanism.bodies if b.name == name)

    def centre(self, name: str) -> Array:
        return np.zeros(3) if name == GROUND else np.array(self.body(name).centre)

    def add_children(self, parent: Element, name: str) -> None:
        """The bodies that the tree hangs on a body, each with its frame in its centre of mass."""
        for joint in self.mechanism.tree:
            if joint.parent == name:
                body = self.body(joint.child)
                element = SubElement(parent, "body", name=body_name(body.name), pos=_text(self.centre(body.name) - self.centre(name)))
                self.add_joint(element, joint, body)
                SubElement(element, "inertial", pos=_text(np.zeros(3)), mass=repr(body.mass), fullinertia=_text(self.inertia(body)))
                self.add_children(element, body.name)

    def inertia(self, body: RigidBody) -> list[float]:
        """Ixx, Iyy, Izz, Ixy, Ixz, Iyz with principal moments that MuJoCo takes."""
        matrix = np.array(body.inertia)
        moments, axes = np.linalg.eigh(matrix)
        least = _LEAST_SHARE * moments[-1] or _LEAST_BY_MASS * body.mass
        if moments[0] < least:
            matrix = axes @ np.diag(np.maximum(moments, least)) @ axes.T
            self.raised.append(body.name)
        matrix = matrix + _ROUNDING * np.trace(matrix) * np.eye(3)
        return [float(matrix[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]

    def add_joint(self, element: Element, joint: PeerJoint, body: RigidBody) -> None:
        parts = chain(joint)
        if joint.kind is JointKind.FREE and joint.parent == GROUND:
            SubElement(element, "freejoint", name=joint.name)
            self.speeds.extend((*body.velocity, *body.spin))
            return
        self.speeds.extend(_speeds(parts, speeds(self.mechanism, joint, parts)))
        pairs = [(part, one) for part in parts for one in _elementary(joint, part)]
        for part, one in pairs:
            name = joint.name if len(pairs) == 1 else f"{joint.name}.{one.label}"
            if one.coordinate is not None:
                self.joints[joint.name, one.coordinate] = name
            attributes = {"name": name, "type": one.type, "pos": _text(np.array(part.point) - np.array(body.centre))}
            attributes |= {} if one.axis is None else {"axis": _text(one.axis)}
            SubElement(element, "joint", attributes | ({"armature": repr(self.guide_inertia)} if joint.guide else {}))

    def pitches(self) -> Iterator[Element]:
        """Screws: the advance follows the angle."""
        for joint in (j for j in self.mechanism.tree if j.kind is JointKind.SCREW):
            yield couple(f"{joint.name}.pitch", f"{joint.name}.advance", f"{joint.name}.angle", (0.0, joint.pitch))

    def gear(self, gear: PeerGear) -> Element:
        """Coordinates count from the start; beside a joint that stands still the other one stands too."""
        first, second = (self.joints.get(end) for end in (gear.first, gear.second))
        if first is not None and second is not None:
            return couple(gear.name, first, second, (0.0, gear.ratio))
        (moving,) = (joint for joint in (first, second) if joint is not None)
        return Element("joint", {"name": gear.name, "joint1": moving, "polycoef": _text((0.0,) * 5)})

    def closures(self, cut: PeerJoint) -> Iterator[Element]:
        point, ends = np.array(cut.base_point), (cut.base, cut.follower)
        anchors = point - self.centre(ends[0]), point - self.centre(ends[1])
        axis = np.array(cut.base_axes[0]) if cut.base_axes else np.zeros(3)
        return closures(cut.kind, cut.name, (body_name(ends[0]), body_name(ends[1])), anchors, axis)


def body_name(name: str) -> str:
    """A body's name in MuJoCo, where the ground is called the world; no instance is called as a body is."""
    return {GROUND: WORLD, WORLD: "world.body"}.get(name, name)


def _elementary(joint: PeerJoint, part: Part) -> Iterator[_Elementary]:
    """MuJoCo's joints of a part of a chain; each carries the next ones."""
    match part.type:
        case "free":
            yield from (_Elementary("slide", axis, label) for axis, label in zip(_GLOBAL, "xyz", strict=True))
            yield _Elementary("ball", None, "ball")
        case "screw":
            yield _Elementary("slide", part.axis, "advance")
            yield _Elementary("hinge", part.axis, "angle", part.coordinate)
        case "ball":
            yield _Elementary("ball", None, "ball")
        case _:
            number = part.coordinate if part.coordinate is not None else chain(joint).index(part)  # of a distance joint
            yield _Elementary(part.type, part.axis, COORDINATES[joint.kind][number], part.coordinate)


def _speeds(parts: Sequence[Part], values: Sequence[float]) -> Iterator[float]:
    """The speeds of MuJoCo's joints from those of the parts: a screw has two."""
    if parts[0].type == "screw":
        yield parts[0].pitch * values[0]
    yield from values


_GLOBAL: Sequence[Triple] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _require_joints(mechanism: Mechanism) -> None:
    """Raise ModelError for what MuJoCo's joints and equality constraints cannot stand for."""
    problems = [_no_guide(joint) for joint in mechanism.tree if joint.kind is JointKind.SCREW and joint.guide]
    problems += [_no_coupling(gear, joint) for gear, joint in _uncoupled(mechanism)]
    problems += [_no_equality(cut) for cut in mechanism.cuts if cut.kind not in CLOSINGS]
    if problems := [*problems, *chain_problems(mechanism, mechanism.tree)]:
        raise ModelError(problems)


def _no_equality(cut: PeerJoint) -> Problem:
    return Problem(
        span=cut.span, element=f"joint '{cut.name}'", message=f"MuJoCo has no equality constraint for a cut joint of kind {cut.kind}",
        hint="close the loop with a joint of kind revolute or spherical: 'cut: true' there",
    )  # fmt: skip


def _uncoupled(mechanism: Mechanism) -> Iterator[tuple[PeerGear, PeerJoint]]:
    """Gears with a joint whose coordinate belongs to no part of a chain."""
    joints = {joint.name: joint for joint in mechanism.tree}
    for gear in mechanism.gears:
        for name, number in (gear.first, gear.second):
            if name in joints and number not in {part.coordinate for part in chain(joints[name])}:
                yield gear, joints[name]


def _no_coupling(gear: PeerGear, joint: PeerJoint) -> Problem:
    message = f"a coordinate of a joint of kind {joint.kind} is none in MuJoCo"
    return Problem(span=gear.span, element=f"gear '{gear.name}'", message=message, hint="leave it out, or name another joint")


def _no_guide(joint: PeerJoint) -> Problem:
    message, hint = "MuJoCo cannot guide a screw", "guide a revolute joint instead"
    return Problem(span=joint.span, element=f"joint '{joint.name}'", message=message, hint=hint)


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(v) + 0.0) for v in values)
