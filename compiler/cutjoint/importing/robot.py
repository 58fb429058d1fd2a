"""A mechanism as other programs describe it: links in frames of their own, joints, loops, relations of coordinates.

Each reader makes a :class:`Robot`; `closing.py` finds a position in which its loops close, `document.py` writes it as a model file.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.importing.xml import Node
from cutjoint.model.elements.mass import TOLERANCE
from cutjoint.model.text import is_number

Array: TypeAlias = NDArray[np.float64]

POINT = 1e-12  #: the square of a radius of gyration below which a body is a point, m2
#: Axes that miss a point by less meet in it, m; the least volume that directions of three hinges of a ball span.
_MEETING, _APART = 1e-9, 0.5
_FIRSTS = ("_rev0", "_x", "_1")  #: endings of the name of the first of three hinges, which the ball has without them
#: Coordinates of the joint kinds: turns about the axis, displacements along it, all turns, everything.
FREEDOMS = {"fixed": 0, "revolute": 1, "prismatic": 1, "spherical": 3, "free": 6}


@dataclass(frozen=True)
class Pose:
    """A frame in another: the columns of ``rotation`` (3 by 3) are its axes, ``place`` (3) its origin, m."""

    rotation: Array = field(default_factory=lambda: np.eye(3))
    place: Array = field(default_factory=lambda: np.zeros(3))

    def __matmul__(self, inner: "Pose") -> "Pose":
        return Pose(self.rotation @ inner.rotation, self.rotation @ inner.place + self.place)

    def inverse(self) -> "Pose":
        """The outer frame in this one."""
        return Pose(self.rotation.T, -self.rotation.T @ self.place)


@dataclass
class Link:
    """A body: ``mass`` (kg), ``centre`` (3,), m, and ``inertia`` (3, 3) about it, kg m2, in the link's axes; its picture."""

    name: str
    node: Node
    mass: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    mesh: str = ""
    mesh_pose: Pose = field(default_factory=Pose)
    scale: float = 1.0
    colour: str = ""

    def add(self, other: "Link", pose: Pose) -> None:
        """Take over the mass and the inertia of another link, whose frame is at a ``pose`` in this one's; the other one has none then."""
        total = self.mass + other.mass
        there = pose.rotation @ other.centre + pose.place
        centre = (self.mass * self.centre + other.mass * there) / total if total else self.centre
        inertia = self.inertia + pose.rotation @ other.inertia @ pose.rotation.T
        for mass, place in ((self.mass, self.centre), (other.mass, there)):
            arm = place - centre
            inertia = inertia + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        self.mass, self.centre, self.inertia = total, centre, inertia
        other.mass, other.inertia = 0.0, np.zeros((3, 3))

    @property
    def massless(self) -> bool:
        """Return whether nothing resists its motion."""
        return self.mass == 0 and not self.inertia.any()


@dataclass
class Joint:
    """A joint of ``kind`` from a ``parent`` link to a ``child``: its frame is ``origin`` in the parent's, the child's is ``inner`` in it.
    ``axis`` (3), a unit vector, is in the joint's frame. ``stiffness`` (N m or N/m) acts from ``rest``, ``damping`` (N m s or N s/m) on
    the rate, ``friction`` (N m or N) against it, ``armature`` (kg m2 or kg) on the acceleration. It ``follows`` others, says the file."""

    name: str
    node: Node
    kind: str
    parent: str
    child: str
    origin: Pose
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    inner: Pose = field(default_factory=Pose)
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    follows: bool = False

    @property
    def freedom(self) -> int:
        """The number of its coordinates."""
        return FREEDOMS[self.kind]

    def moved(self, q: Array) -> Pose:
        """The child's frame in the parent's; ``q`` are the coordinates, a rotation vector of a spherical joint."""
        motion = Pose()
        match self.kind:
            case "revolute":
                motion = Pose(rotation_about(self.axis * q[0]))
            case "prismatic":
                motion = Pose(place=self.axis * q[0])
            case "spherical":
                motion = Pose(rotation_about(q))
            case "free":
                motion = Pose(rotation_about(q[3:]), q[:3])
        return self.origin @ motion @ self.inner


@dataclass(eq=False)
class Loop:
    """A joint that closes a loop: frames ``first`` and ``second`` of two links meet; ``axis`` (3) is in both.  It resists as joints do."""

    name: str
    node: Node
    kind: str
    links: tuple[str, str]
    first: Pose
    second: Pose
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0


@dataclass(frozen=True)
class Spring:
    """A spring (N/m) and a damper (N s/m) between points, each a link and a place (3,) in it; ``rest`` (m) is the free length."""

    name: str
    first: tuple[str, Array]
    second: tuple[str, Array]
    stiffness: float
    damping: float
    rest: float


@dataclass(eq=False)
class Coupling:
    """A relation: the sum of ``terms`` (factors by joints) times coordinates is ``constant`` plus a polynomial of ``independent``.
    ``higher_terms`` are the coefficients of that joint's coordinate from the square up."""

    name: str
    node: Node
    terms: dict[str, float]
    constant: float = 0.0
    independent: str = ""
    higher_terms: tuple[float, ...] = ()

    def violation(self, q: Mapping[str, Array]) -> float:
        """By how much coordinates miss it."""
        higher = sum(c * q[self.independent][0] ** i for i, c in enumerate(self.higher_terms, 2)) if self.independent else 0.0
        return float(sum(k * q[j][0] for j, k in self.terms.items()) - self.constant - higher)


@dataclass
class Drive:
    """A motor on a joint's coordinate: ``gear`` times the sum of ``gain`` times its input, ``bias``, and a spring and damper before it.
    The input and that force have bounds, ``controls`` and ``forces``, or None. ``offset`` is the coordinate of the file where the
    reader's is zero. ``tendon`` are the coefficients, by joints, of a tendon that it pulls in place of one joint, {} for none."""

    name: str
    joint: str
    gear: float = 1.0
    gain: float = 1.0
    bias: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    controls: tuple[float, float] | None = None
    forces: tuple[float, float] | None = None
    offset: float = 0.0
    tendon: Mapping[str, float] = field(default_factory=dict)

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints on which it works."""
        return tuple(self.tendon) or (self.joint,)

    @property
    def is_plain(self) -> bool:
        """Return whether its input is a force or torque, before the gear."""
        return self.gain == 1 and not (self.bias or self.stiffness or self.damping)

    def law(self, name: str, here: float, position: str = "position", rate: str = "rate") -> str:
        """Its law over the input's name, ``position`` and ``rate``; ``here`` is the reader's coordinate where the position is zero."""
        outer = self.gear if self.forces else 1.0
        inner = self.gear / outer
        rest = self.bias - self.stiffness * self.gear * (here + self.offset)
        words = {_bounded(name, self.controls): inner * self.gain, "": inner * rest,
                 position: -inner * self.gear * self.stiffness, rate: -inner * self.gear * self.damping}  # fmt: skip
        parts = [_times(factor, word) for word, factor in words.items() if factor]
        return _times(outer, _bounded(" + ".join(parts).replace("+ -", "- ") or "0", self.forces))


def _bounded(word: str, bounds: tuple[float, float] | None) -> str:
    return word if bounds is None else f"max({short(bounds[0])!r}, min({short(bounds[1])!r}, {word}))"


def _times(factor: float, word: str) -> str:
    return word if factor == 1 and word else f"{short(factor)!r}{'*' * bool(word)}{word}"


def short(value: float, digits: int = 12) -> float | int:
    """A number without the rounding of the file's frames, whole if it is."""
    rounded = float(f"{value:.{digits}g}")
    return int(rounded) if rounded.is_integer() and abs(rounded) < 1e15 else rounded


@dataclass
class Robot:
    """All of a file, as read.  A link without a parent stands on the ground.  ``starts`` are coordinates by joints, by names of scenes;
    ``references`` are the file's own coordinates by joints, but for zeros, where those here are zero;
    ``balls`` are those that stand for three hinges; ``notes`` are sentences of decisions."""

    name: str
    links: dict[str, Link] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    loops: list[Loop] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    drives: list[Drive] = field(default_factory=list)
    springs: list[Spring] = field(default_factory=list)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    starts: dict[str, dict[str, float]] = field(default_factory=dict)
    references: dict[str, float] = field(default_factory=dict)
    balls: dict[str, list[Joint]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def root(self) -> list[Link]:
        """Links that are no joint's child."""
        children = {joint.child for joint in self.joints.values()}
        return [link for link in self.links.values() if link.name not in children]

    def outwards(self) -> Iterator[Joint]:
        """The joints, each behind that which carries it."""
        below: dict[str, list[Joint]] = {}
        for joint in self.joints.values():
            below.setdefault(joint.parent, []).append(joint)
        waiting = [joint for link in self.root() for joint in below.get(link.name, [])]
        while waiting:
            joint = waiting.pop(0)
            yield joint
            waiting[:0] = below.get(joint.child, [])

    def leave_out_idle(self) -> None:
        """Leave out links that move and have nothing behind them that resists, with all that hangs on them.  Ties keep links."""
        carried, roots = {joint.child: joint for joint in self.joints.values()}, {link.name for link in self.root()}
        ties = [set(loop.links) - roots for loop in self.loops]
        ties += [{self.joints[name].child for name in coupling.terms} for coupling in self.couplings]
        waiting = [name for name, link in self.links.items() if not link.massless or (name in carried and carried[name].armature)]
        kept: set[str] = set()
        while waiting:
            name = waiting.pop()
            if name not in kept:
                kept.add(name)
                waiting += [carried[name].parent] if name in carried else []
                waiting += [other for tie in ties if name in tie for other in tie]
        gone: dict[str, Joint] = {}
        for joint in self.outwards():
            if joint.parent in gone or (joint.freedom and joint.child not in kept):
                gone[joint.child] = joint
        if gone:
            self._leave_out(gone)

    def _leave_out(self, gone: dict[str, Joint]) -> None:
        """Take out joints by the links that they carry, and all that names either."""
        joints = {joint.name for joint in gone.values()}
        ties = [loop for loop in self.loops if gone.keys() & loop.links]
        bound = [coupling for coupling in self.couplings if joints & coupling.terms.keys()]
        drives = [drive for drive in self.drives if joints.intersection(drive.joints)]
        names = [*sorted(gone), *(tie.name for tie in ties), *(tie.name for tie in bound), *(drive.name for drive in drives)]
        self.notes.append(f"left out, since nothing resists their motion: {', '.join(names)}")
        self.springs = [spring for spring in self.springs if spring.first[0] not in gone and spring.second[0] not in gone]
        self.links = {name: link for name, link in self.links.items() if name not in gone}
        self.joints = {name: joint for name, joint in self.joints.items() if name not in joints}
        self.loops = [loop for loop in self.loops if loop not in ties]
        self.couplings = [coupling for coupling in self.couplings if coupling not in bound]
        self.drives = [drive for drive in self.drives if drive not in drives]

    def join_balls(self) -> None:
        """Make one ball of three hinges on a way round a loop whose axes meet, with nothing between them that resists or hangs there."""
        in_loops, behind = self.in_loops(), dict[str, list[Joint]]()
        for joint in self.joints.values():
            behind.setdefault(joint.parent, []).append(joint)
        busy = {name for coupling in self.couplings for name in coupling.terms} | {joint for drive in self.drives for joint in drive.joints}
        held = {end for loop in self.loops for end in loop.links}

        def is_plain(joint: Joint) -> bool:
            resists = joint.stiffness or joint.damping or joint.friction or joint.armature
            return joint.kind == "revolute" and not resists and joint.name in in_loops - busy

        def next_of(joint: Joint) -> Joint | None:
            link, others = self.links[joint.child], behind.get(joint.child, [])
            alone = link.massless and link.name not in held and not link.mesh and len(others) == 1
            return others[0] if alone and is_plain(others[0]) else None

        for first in list(self.outwards()):
            if first.name not in self.joints or not is_plain(first):
                continue
            if (second := next_of(first)) and (third := next_of(second)) and (centre := _meeting([first, second, third])) is not None:
                self._join([first, second, third], centre)

    def _join(self, hinges: list[Joint], centre: Array) -> None:
        """Put a ball at a point (3, in the first parent's frame) in the place of hinges."""
        first, last = hinges[0], hinges[-1]
        origin, whole = Pose(place=centre), Pose()
        for hinge in hinges:
            whole = whole @ hinge.moved(np.zeros(1))
        name = next((first.name[: -len(end)] for end in _FIRSTS if first.name.endswith(end)), first.name)
        name = unique_name(name, self.joints.keys() - {hinge.name for hinge in hinges})
        ball = Joint(name, first.node, "spherical", first.parent, last.child, origin, inner=origin.inverse() @ whole)
        self.joints = {
            (ball.name if joint is first else key): (ball if joint is first else joint)
            for key, joint in self.joints.items() if joint not in hinges[1:]
        }  # fmt: skip
        self.links = {key: link for key, link in self.links.items() if key not in (hinges[0].child, hinges[1].child)}
        self.balls[name] = hinges

    @staticmethod
    def inwards(carriers: Mapping[str, Joint], link: str) -> list[Joint]:
        """The joints from a link to the root; ``carriers`` are joints by the links that they carry."""
        way: list[Joint] = []
        while link in carriers:
            way.append(carriers[link])
            link = carriers[link].parent
        return way

    def in_loops(self) -> set[str]:
        """The joints on the ways round loops."""
        carried = {joint.child: joint for joint in self.joints.values()}
        found: set[str] = set()
        for loop in self.loops:
            first, second = ({joint.name for joint in self.inwards(carried, link)} for link in loop.links)
            found |= first ^ second
        return found | {name for coupling in self.couplings for name in coupling.terms}

    def poses(self, q: dict[str, Array]) -> dict[str, Pose]:
        """The global poses of all links for coordinates by joints; those of joints that are not named are zero."""
        placed = {link.name: Pose() for link in self.root()}
        for joint in self.outwards():
            placed[joint.child] = placed[joint.parent] @ joint.moved(q.get(joint.name, np.zeros(joint.freedom)))
        return placed


def _meeting(hinges: list[Joint]) -> Array | None:
    """The point (3, in the first parent's frame) where the axes of three hinges meet; None if there is none.
    None also if they are nearly in a plane."""
    frame, places, axes = Pose(), [], []
    for hinge in hinges:
        inner = frame @ hinge.origin
        places.append(inner.place)
        axes.append(inner.rotation @ hinge.axis)
        frame = frame @ hinge.moved(np.zeros(1))
    if abs(np.linalg.det(np.array(axes))) < _APART:
        return None
    across = [np.eye(3) - np.outer(axis, axis) for axis in axes]
    matrix, right = sum(across, np.zeros((3, 3))), sum((p @ x for p, x in zip(across, places, strict=True)), np.zeros(3))
    centre = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
    missed = max(float(np.linalg.norm(p @ (centre - x))) for p, x in zip(across, places, strict=True))
    return centre if missed < _MEETING else None


def is_negative(link: Link) -> bool:
    moments = np.linalg.eigvalsh(link.inertia)
    return bool(link.mass < 0 or moments[0] < -max(TOLERANCE * abs(moments[2]), POINT * link.mass))


def lump(robot: Robot) -> Iterator[tuple[str, str]]:
    """Add links with a negative moment of inertia to those that they are welded to: such parts may be of a sound body."""
    for joint in reversed(list(robot.outwards())):
        link, carrier = robot.links[joint.child], robot.links[joint.parent]
        if not joint.freedom and is_negative(link) and link.mass >= 0:
            yield link.name, carrier.name
            carrier.add(link, joint.moved(np.zeros(0)))


def excess(link: Link) -> tuple[float, Array]:
    """By how much the largest principal moment of a link is larger than the sum of the others, kg m2, and its direction."""
    if is_negative(link):
        link.node.refuse("has a negative mass or principal moment of inertia", "correct its inertial")
    moments, axes = np.linalg.eigh(link.inertia)
    left = moments[2] - moments[1] - moments[0]
    axis = forward(axes[:, 2])
    return (float(left), axis) if link.mass and left > TOLERANCE * moments[2] else (0.0, axis)


def forward(axis: Array) -> Array:
    """An axis in that of its two directions whose largest component is positive."""
    return np.asarray(axis * np.sign(axis[np.argmax(np.abs(axis))]))


def rotation_about(vector: Array) -> Array:
    """The rotation (3 by 3) about a vector's direction by its length, rad."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def roll_pitch_yaw(angles: tuple[float, ...]) -> Array:
    """The rotation R_z(yaw) R_y(pitch) R_x(roll), 3 by 3; angles in rad."""
    roll, pitch, yaw = angles
    x, y, z = np.eye(3)
    return np.asarray(rotation_about(yaw * z) @ rotation_about(pitch * y) @ rotation_about(roll * x))


def of_quaternion(w: float, x: float, y: float, z: float) -> Array:
    """The rotation (3 by 3) of a unit quaternion, the scalar first."""
    sine = float(np.linalg.norm([x, y, z]))
    if sine == 0:
        return np.eye(3)
    return rotation_about(2 * np.arctan2(sine, w) / sine * np.array([x, y, z]))


def of_xyzw(node: Node, parts: tuple[float, ...]) -> Array:
    """The rotation (3 by 3) of an element's quaternion, the scalar last, of any length.  Raises ModelError where it has no length."""
    length = float(np.linalg.norm(parts))
    if length < 1e-9:
        node.refuse("has a quaternion without length", "use 0 0 0 1 for no rotation")
    x, y, z, w = (part / length for part in parts)
    return of_quaternion(w, x, y, z)


def unique_name(wanted: str, taken: Container[str]) -> str:
    """The wanted name, with a number behind it where it is taken."""
    return wanted if wanted not in taken else next(name for i in count(2) if (name := f"{wanted}_{i}") not in taken)


def colour_of(parts: Sequence[str]) -> str:
    """A colour of a model file, of texts of red, green, blue and more, each from 0 to 1; "" where they are none."""
    if len(parts) < 3 or not all(map(is_number, parts)):
        return ""
    return "#" + "".join(f"{round(255 * min(max(float(part), 0.0), 1.0)):02x}" for part in parts[:3])
