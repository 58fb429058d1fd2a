"""Massless links in loops become distances.
A link with a ball at each end, or a ball and a universal joint, keeps two points at a distance: one equation in place of five coordinates
and three. A link with a hinge and a ball keeps a point on a circle about the hinge: two distances from points of the axis, so far from the
centre that the two lines are perpendicular."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import sympy

from cutjoint.elements.interaction import Carrier
from cutjoint.model.outcome import Note, Outcome
from cutjoint.model.records import Body, Force, Joint, JointKind, Marker, Model, Reaction, RodForce, Scalar, Scene, Vector
from cutjoint.topology.build import build_topology

_BALLS = (JointKind.SPHERICAL, JointKind.UNIVERSAL)


def shorten_links(model: Model, scene: Scene) -> Outcome:
    """The pass; it looks at massless bodies with two joints of which one is cut."""
    outcome = Outcome(model=model, scene=scene)
    cuts = {joint.name for joint in build_topology(model).cuts}
    for body in model.bodies:
        joints = [j for j in model.joints if body.name in (j.base, j.follower)]
        if body.is_massless and len(joints) == 2 and any(j.name in cuts for j in joints):
            cut, kept = sorted(joints, key=lambda j: j.name not in cuts)
            outcome = _shorten(outcome, _Link(body=body, cut=cut, tree=kept))
    return outcome


class _StaysError(Exception):
    """The reason that a link is not replaced."""


@dataclass(frozen=True, kw_only=True)
class _Link:
    """A massless body between the cut joint that closes its loop and its joint in the tree."""

    body: Body
    cut: Joint
    tree: Joint

    def outside(self, joint: Joint) -> str:
        """The other body of one of its joints."""
        return joint.follower if joint.base == self.body.name else joint.base

    def rods(self) -> tuple[Joint, ...]:
        """The distances that replace it, from the cut joint's other body to the tree joint's."""
        kinds = {self.cut.kind, self.tree.kind}
        if kinds <= set(_BALLS) and JointKind.SPHERICAL in kinds:
            return (self._rod(self.body.name, self.cut.at, self.tree.at),)
        if kinds != {JointKind.REVOLUTE, JointKind.SPHERICAL}:
            raise _StaysError(f"stays: it has a {self.cut.kind} and a {self.tree.kind} joint")
        hinge, ball = (self.cut, self.tree) if self.cut.kind is JointKind.REVOLUTE else (self.tree, self.cut)
        ends = (_offset_circle(hinge, ball.at, side) for side in (1, -1))
        pairs = (((end, ball.at) if hinge is self.cut else (ball.at, end)) for end in ends)
        return tuple(self._rod(f"{self.body.name}_{i}", *pair) for i, pair in enumerate(pairs, start=1))

    def _rod(self, name: str, start: Vector, end: Vector) -> Joint:
        return Joint(
            name=name, kind=JointKind.DISTANCE, base=self.outside(self.cut), follower=self.outside(self.tree), at=start, to=end, axes=(),
            pitch=None, cut=True, guide=None, span=self.body.span,
        )  # fmt: skip


def _offset_circle(hinge: Joint, point: Vector, side: int) -> Vector:
    """A point of a hinge's axis, as far from the centre of the circle of ``point`` as its radius."""
    at, axis, p = (sympy.Matrix(v) for v in (hinge.at, hinge.axes[0], point))
    centre = at + axis * (axis.dot(p - at) / axis.dot(axis))
    x, y, z = centre + side * axis * ((p - centre).norm() / axis.norm())
    return x, y, z


def _shorten(outcome: Outcome, link: _Link) -> Outcome:
    try:
        rods = link.rods()
        _require_idle(outcome, link)
        forces = tuple(_moved(force, link) for force in outcome.model.forces)
        reactions = tuple(_converted(reaction, link, rods, outcome.model.forces) for reaction in outcome.model.reactions)
        markers = tuple(replace(marker, body=_carrier(link, marker.body, marker.point, marker)) for marker in outcome.model.markers)
    except _StaysError as reason:
        return replace(outcome, left=(*outcome.left, Note(element=link.body.name, text=str(reason), span=link.body.span)))
    gone = (link.cut.name, link.tree.name)
    joints = (*(j for j in outcome.model.joints if j.name not in gone), *rods)
    bodies = tuple(b for b in outcome.model.bodies if b.name != link.body.name)
    model = replace(outcome.model, bodies=bodies, joints=joints, forces=forces, reactions=reactions, markers=markers)
    text = "becomes a distance" if len(rods) == 1 else "becomes two distances that keep a point on a circle"
    return replace(outcome, model=model, done=(*outcome.done, Note(element=link.body.name, text=text, span=link.body.span)))


def _require_idle(outcome: Outcome, link: _Link) -> None:
    """Check that nothing reads the link's own motion, prescribes it or couples it."""
    names = (link.body.name, link.cut.name, link.tree.name)
    for name in (o.column for o in outcome.scene.outputs if o.element in names):
        raise _StaysError(f"stays: the output '{name}' needs it")
    for joint in (link.cut, link.tree):
        if joint.guide is not None:
            raise _StaysError(f"stays: the joint '{joint.name}' is guided")
    for gear in outcome.model.gears:
        if link.tree.name in gear.joints:
            raise _StaysError(f"stays: the gear '{gear.name}' couples its joint '{link.tree.name}'")
    for state in chain(outcome.scene.positions, outcome.scene.rates):
        if state.rpartition(".")[0] in names:
            raise _StaysError(f"stays: the scene gives '{state}'")
    if link.outside(link.cut) == link.outside(link.tree):
        raise _StaysError("stays: it joins a body to itself")
    moments = {r.name for r in outcome.model.reactions if isinstance(r, Reaction) and r.joint == link.cut.name}
    for name in (o.column for o in outcome.scene.outputs if o.element in moments and o.quantity == "moment"):
        raise _StaysError(f"stays: the output '{name}' needs a moment in its joint '{link.cut.name}'")


def _moved(force: Force, link: _Link) -> Force:
    """A force whose points on the link are at its joints; it acts on the bodies that these connect."""
    if force.joint_of in (link.cut.name, link.tree.name):
        raise _StaysError(f"stays: the force '{force.name}' acts in its joint")
    changed: dict[str, Any] = {}
    for carrier in (carrier for carrier in Carrier if getattr(force, carrier, None) == link.body.name):
        point = force.sole_point(carrier)
        if point is None:
            raise _StaysError(f"stays: the force '{force.name}' acts on it")
        changed[carrier] = _carrier(link, link.body.name, point.of(force), force)
    return replace(force, **changed)


def _carrier(link: _Link, body: str, point: Vector, element: Force | Marker) -> str:
    """The body that moves with a point of the link."""
    if body != link.body.name:
        return body
    for joint in (link.tree, link.cut):
        if joint.at == point:
            return link.outside(joint)
    raise _StaysError(f"stays: '{element.name}' is at a point between its joints")


def _converted(reaction: Reaction | RodForce, link: _Link, rods: Sequence[Joint], forces: Sequence[Force]) -> Reaction | RodForce:
    """The force in the link's cut joint: the forces in the rods less the force that acts on the link. The link has no weight."""
    if isinstance(reaction, RodForce) or reaction.joint not in (link.cut.name, link.tree.name):
        if isinstance(reaction, Reaction) and reaction.body == link.body.name:
            raise _StaysError(f"stays: the direction of '{reaction.name}' is fixed in it")
        return reaction
    if reaction.joint == link.tree.name:
        raise _StaysError(f"stays: '{reaction.name}' is the reaction of its joint '{link.tree.name}'")
    if reaction.body != link.body.name:
        raise _StaysError(f"stays: the direction of '{reaction.name}' is fixed in '{reaction.body}'")
    if reaction.direction is None:
        raise _StaysError(f"stays: '{reaction.name}' is the reaction of its joint '{link.cut.name}' without a direction")
    for force in forces:
        points = (point for carrier in Carrier if (point := force.sole_point(carrier)) is not None)
        if any(point.body(force) == link.body.name and point.of(force) == link.cut.at for point in points):
            raise _StaysError(f"stays: '{force.name}' and '{reaction.name}' are at the same end")
    sign = 1 if link.cut.follower == link.body.name else -1
    weights = tuple((rod.name, sign * _along(rod, reaction.direction)) for rod in rods)
    return RodForce(name=reaction.name, weights=weights, span=reaction.span)


def _along(rod: Joint, direction: Vector) -> Scalar:
    """The component of a rod's line along a direction."""
    line = sympy.Matrix(rod.to) - sympy.Matrix(rod.at)
    return line.dot(sympy.Matrix(direction)) / line.norm()
