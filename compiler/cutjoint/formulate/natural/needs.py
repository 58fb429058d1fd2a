"""The points and directions of each body that natural coordinates must provide for joints, forces, inertia and outputs."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy

from cutjoint.elements.interaction import Axis, Point
from cutjoint.elements.joint import Condition, Direction, Products, SameAttitude, SameDirection
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.natural.nodes import NodeKind, NodeName
from cutjoint.kernels.joints import direction_of
from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.expressions.quantities import readings_of
from cutjoint.model.records import GROUND, Body, Force, Joint, Model, Output, Reaction, Scalar, Scene, Vector

_FLAT = 1e-9  #: a second moment of mass below this share of the largest is a shape without extent in that direction

_ATTITUDE = frozenset({"roll", "pitch", "yaw", "wx", "wy", "wz"})


@dataclass(frozen=True, kw_only=True)
class Need:
    """A point or direction of a body in the design position, and its name."""

    kind: NodeKind
    place: Vector
    title: NodeName


@dataclass(kw_only=True)
class Needs:
    """The needs of one rigid group of bodies: ``shared`` may become coordinates, ``spanned`` need only follow from these."""

    shared: list[Need] = field(default_factory=list)
    spanned: list[Need] = field(default_factory=list)

    def point(self, place: Vector, element: str, which: str = "") -> None:
        """A point that other bodies or forces meet."""
        self.shared.append(Need(kind=NodeKind.POINT, place=place, title=NodeName(element, which)))

    def direction(self, place: Vector, element: str, which: str) -> None:
        """A direction that other bodies or forces meet."""
        self.shared.append(Need(kind=NodeKind.VECTOR, place=place, title=NodeName(element, which)))

    def span(self, kind: NodeKind, places: Iterable[Vector], element: str, which: str = "") -> None:
        """Points or directions that must be combinations of the others."""
        self.spanned.extend(Need(kind=kind, place=place, title=NodeName(element, which)) for place in places)

    def attitude(self, body: str) -> None:
        """All directions."""
        self.span(NodeKind.VECTOR, GLOBAL_AXES, body)


def require_coordinates(model: Model, scene: Scene, outputs: Sequence[Output]) -> None:
    """Natural coordinates do not have all angles: a rod of a distance joint has no attitude.
    Raises ModelError: an output, a law, a force, a gear or a guide asks for one that they do not have."""
    kinds = {j.name: j.kind for j in model.joints if not j.element.is_measured}
    requested = [(kinds[o.element], o.span, f"output '{o.column}'") for o in outputs if o.element in kinds]
    requested += [(kinds[o.element], o.span, f"quantity '{o.column}' of a law or signal") for o in readings_of(model) if o.element in kinds]
    forces = [f for f in model.force_elements if f.joint_of in kinds and is_active(f, scene)]
    requested += [(kinds[f.joint_of], f.span, f"force '{f.name}'") for f in forces]
    requested += [(kinds[name], g.span, f"gear '{g.name}'") for g in model.gears for name in g.joints if name in kinds]
    requested += [(j.kind, j.span, f"joint '{j.name}'") for j in model.joints if j.guide is not None and j.name in kinds]
    hint = "use --method recursive"
    if rotors := [joint for joint in model.joints if joint.armature != 0]:
        raise ModelError([Problem(j.span, f"joint '{j.name}'", "natural coordinates have no armatures of joints", hint) for j in rotors])
    if requested:
        words = "natural coordinates do not have the coordinates of a"
        raise ModelError([Problem(span, element, f"{words} {kind} joint", hint) for kind, span, element in requested])


def requested_angles(model: Model, scene: Scene, outputs: Sequence[Output]) -> list[tuple[Joint, str]]:
    """The joints' angles that laws, gears, screws or outputs use; each becomes a coordinate of its own."""
    joints = {j.name: j for j in model.joints}
    wanted = {(o.element, o.quantity.removesuffix("_rate")) for o in outputs if o.element in joints}
    wanted |= {(f.joint_of, f.coordinate_of) for f in model.force_elements if f.joint_of and is_active(f, scene)}
    wanted |= {(c.joint, c.name) for gear in model.gears for c in gear.coordinates}
    wanted |= {(j.name, name) for j in model.joints if j.element.is_screw for name in j.element.measures}
    return [
        (joint, name) for joint in model.joints for name in joint.element.measures
        if (joint.name, name) in wanted and (joint.guide is None or joint.element.is_screw)
    ]  # fmt: skip


class Collector:
    """Collects the needs of rigid groups; ``group`` names the group of a body."""

    def __init__(self, model: Model, group: Callable[[str], str], value: Callable[[Scalar], float]) -> None:
        self.needs: dict[str, Needs] = {}
        self._model = model
        self._group = group
        self._value = value
        for body in model.bodies:
            self.of(body.name)
            if not body.is_massless:
                self._inertia(body)

    def of(self, body: str) -> Needs:
        """The needs of a body's group."""
        return self.needs.setdefault(self._group(body), Needs())

    def _inertia(self, body: Body) -> None:
        needs = self.of(body.name)
        if body.mass != 0:
            needs.span(NodeKind.POINT, [body.centre_of_mass], body.name, "centre")
        moments, axes = np.linalg.eigh(second_moments(body, self._value))
        largest = np.abs(moments).max()
        extents = [tuple(axes[:, i]) for i in range(3) if abs(moments[i]) > _FLAT * largest]
        needs.span(NodeKind.VECTOR, [tuple(sympy.Float(x) for x in axis) for axis in extents], body.name)

    def joint(self, joint: Joint, idle: bool) -> None:
        """A joint's points and directions; ``idle`` leaves out the directions of one that steers a body without mass."""
        base, follower, name = self.of(joint.base), self.of(joint.follower), joint.name
        if not joint.element.closes:
            return
        base.point(joint.at, name)
        follower.point(joint.to or joint.at, name, "to" if joint.to else "")
        for condition in joint.element.conditions:
            self._condition(joint, condition, idle)
        if joint.guide is not None:
            base.attitude(joint.base)
            if joint.element.angles:
                follower.attitude(joint.follower)

    def _condition(self, joint: Joint, condition: Condition, idle: bool) -> None:
        base, follower = self.of(joint.base), self.of(joint.follower)
        match condition:
            case SameDirection():
                for needs in (base, follower):
                    self._direction(needs, joint, condition.direction)
            case SameAttitude():
                self.angles(joint)
            case Products() if condition.joins_points:
                if len(condition.base) > 1:
                    base.attitude(joint.base)
                else:
                    self._direction(base, joint, condition.base[0])
            case Products() if not idle:
                for needs, directions in ((base, condition.base), (follower, condition.follower)):
                    for direction in directions:
                        self._direction(needs, joint, direction)

    def _direction(self, needs: Needs, joint: Joint, direction: Direction) -> None:
        label = "axis_1" if direction is Direction.AXIS and len(joint.axes) > 1 else direction
        needs.direction(direction_of(joint, direction), joint.name, label)

    def angles(self, joint: Joint) -> None:
        """The directions that a joint's angles are measured by."""
        for body in (joint.base, joint.follower):
            self.of(body).attitude(body)

    def force(self, force: Force) -> None:
        """A force's points and directions; a point that both bodies have goes by the force's name alone."""
        if force.joint_of:
            self.coordinate(force.joint_of, force.coordinate_of)
        fields = [place.field for place in force.places]
        for place in force.places:
            needs, which = self.of(place.body(force)), place.field if fields.count(place.field) == 1 else ""
            if isinstance(place, Point):
                needs.point(place.of(force), force.name, which)
            elif isinstance(place, Axis) and not force.needs_attitude:
                needs.direction(place.of(force), force.name, which)
        for body in force.bodies if force.needs_attitude else ():
            self.of(body).attitude(body)

    def coordinate(self, name: str, coordinate: str) -> None:
        """Require the nodes that measure a joint's coordinate, unless it is an angle."""
        joint = next(j for j in self._model.joints if j.name == name)
        if coordinate not in joint.element.measures:
            self.slide(joint)

    def slide(self, joint: Joint) -> None:
        """Require the nodes that measure a displacement of a joint."""
        self.of(joint.base).point(joint.at, joint.name)
        self.of(joint.base).attitude(joint.base)
        self.of(joint.follower).point(joint.at, joint.name)

    def output(self, output: Output) -> None:
        """Require the nodes from which a reported quantity follows."""
        model = self._model
        for body in model.bodies:
            if body.name == output.element:
                self._motion(body.name, body.centre_of_mass, output)
        for marker in model.markers:
            if marker.name == output.element:
                self._motion(marker.body, marker.point, output)
        for reaction in model.reactions:
            if reaction.name == output.element and isinstance(reaction, Reaction):
                if reaction.direction is None:
                    self.of(reaction.body).attitude(reaction.body)
                else:
                    self.of(reaction.body).direction(reaction.direction, reaction.name, "direction")
        for joint in model.joints:
            if joint.name == output.element:
                self._joint_output(joint, output.quantity)

    def _motion(self, body: str, point: Vector, output: Output) -> None:
        if body == GROUND:
            return
        if output.quantity in _ATTITUDE:
            self.of(body).attitude(body)
        else:
            self.of(body).span(NodeKind.POINT, [point], output.element)

    def _joint_output(self, joint: Joint, quantity: str) -> None:
        if quantity in ("wx", "wy", "wz"):
            self.angles(joint)
        elif quantity.removesuffix("_rate") not in joint.element.measures:
            self.slide(joint)


def second_moments(body: Body, value: Callable[[Scalar], float]) -> np.ndarray:
    """The second moments of a body's mass about its centre, the integral of x x^T dm = tr(J)/2 1 - J, (3, 3), kg m2."""
    xx, yy, zz, xy, xz, yz = (value(x) for x in body.inertia)
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.asarray(np.trace(J) / 2 * np.eye(3) - J)
