"""Bodies, joints, forces and sensors: from the document's parts to records, not yet mirrored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import sympy

from cutjoint.model import document
from cutjoint.model.geometry import coincide, perpendicular, read_direction, read_inertia, read_point
from cutjoint.model.laws import LawKind, read_law
from cutjoint.model.records import (
    SPEEDS,
    AxialForce,
    Body,
    BodyLoad,
    Force,
    Joint,
    JointForce,
    JointKind,
    Marker,
    PointSpring,
    Reaction,
    Tyre,
    Vector,
)
from cutjoint.model.scope import UNKNOWN, Element, Scope, element, with_points
from cutjoint.model.units import ANGLE, ANGULAR_SPEED, FORCE, LENGTH, MASS, SPEED, TIME, TORQUE

_POINT_SPRING = LawKind({"length": LENGTH, "rate": SPEED, "t": TIME}, FORCE)
_AXIAL_FORCE = LawKind({"travel": LENGTH, "rate": SPEED, "t": TIME}, FORCE)
_SLIDE = LawKind({"position": LENGTH, "rate": SPEED, "t": TIME}, FORCE)
_TURN = LawKind({"position": ANGLE, "rate": ANGULAR_SPEED, "t": TIME}, TORQUE)
_LOAD = ("x", "y", "z", "vx", "vy", "vz", "t")


@dataclass(frozen=True)
class Elements:
    """What one scope holds."""

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    forces: tuple[Force, ...]
    reactions: tuple[Reaction, ...]
    markers: tuple[Marker, ...]


def read_elements(scope: Scope, part: document.Elements) -> Elements:
    """Read all elements of the model, or of a submodel in one instance's scope."""
    scope = with_points(scope, _read_points(scope, part))
    return Elements(
        tuple(_read_body(element(scope, "body", "bodies", name), body) for name, body in part.bodies.items()),
        tuple(_read_joint(element(scope, "joint", "joints", name), joint) for name, joint in part.joints.items()),
        tuple(_read_force(element(scope, "force", "forces", name), force) for name, force in part.forces.items()),
        tuple(_read_reaction(element(scope, "reaction", "reactions", name), r) for name, r in part.reactions.items()),
        tuple(_read_marker(element(scope, "marker", "markers", name), m) for name, m in part.markers.items()),
    )


def _read_points(scope: Scope, part: document.Elements) -> Mapping[str, Vector]:
    """The points, each able to use those above it."""
    points: dict[str, Vector] = {}
    scope = with_points(scope, points)
    for name, point in part.points.items():
        points[name] = read_point(element(scope, "point", "points", name), point, ())
    return points


def _read_body(element: Element, body: document.Body) -> Body:
    zero = sympy.Integer(0)
    centre = (zero, zero, zero)
    if body.centre_of_mass is not None:
        centre = read_point(element, body.centre_of_mass, ("centre_of_mass",))
    return Body(
        name=element.name,
        mass=zero if body.mass is None else element.scalar(body.mass, MASS, ("mass",)),
        centre_of_mass=centre,
        inertia=read_inertia(element, body.inertia),
        span=element.span,
    )


def _bodies(element: Element, names: tuple[str, ...]) -> tuple[str, str]:
    base, follower = (element.body(name, ("bodies", index)) for index, name in enumerate(names))
    if base == follower != UNKNOWN:
        element.fail(f"joins the body '{base}' to itself", "name two bodies", ("bodies",))
    return base, follower


def _read_joint(element: Element, joint: document.Joint) -> Joint:
    base, follower = _bodies(element, joint.bodies)
    pitch = element.scalar(joint.pitch, LENGTH, ("pitch",)) if isinstance(joint, document.ScrewJoint) else None
    at = read_point(element, joint.at, ("at",))
    to = read_point(element, joint.to, ("to",)) if isinstance(joint, document.DistanceJoint) else None
    if to is not None and coincide(element, at, to):
        element.fail("at and to are the same point", "a distance needs two", ("to",))
    return Joint(
        name=element.name,
        kind=JointKind(joint.kind),
        base=base,
        follower=follower,
        at=at,
        axes=_axes(element, joint),
        to=to,
        pitch=pitch,
        cut=joint.cut,
        guide=_guide(element, joint),
        span=element.span,
    )


def _axes(element: Element, joint: document.Joint) -> tuple[Vector, ...]:
    if isinstance(joint, document.UniversalJoint):
        axes = (
            read_direction(element, joint.axis, ("axis",)),
            read_direction(element, joint.axis_2, ("axis_2",)),
        )
        if not perpendicular(element, *axes):
            element.fail("axis and axis_2 are not perpendicular", "", ("axis_2",))
        return axes
    if isinstance(joint, (document.AxisJoint, document.GuidableJoint, document.ScrewJoint)):
        return (read_direction(element, joint.axis, ("axis",)),)
    return ()


def _guide(element: Element, joint: document.Joint) -> Any:
    if not isinstance(joint, (document.GuidableJoint, document.ScrewJoint)) or joint.guide is None:
        return None
    if joint.cut:
        element.fail("a cut joint has no coordinate to guide", "remove cut or guide", ("guide",))
    kind = LawKind({"t": TIME}, LENGTH if joint.kind == "prismatic" else ANGLE)
    return read_law(element, joint.guide, kind, ("guide",))


def _read_force(element: Element, force: document.Force) -> Force:
    match force:
        case document.PointSpring():
            return _read_point_spring(element, force)
        case document.AxialForce():
            return _read_axial_force(element, force)
        case document.Load():
            return _read_load(element, force)
        case document.JointForce():
            return _read_joint_force(element, force)
        case document.Tyre():
            return _read_tyre(element, force)


def _read_point_spring(element: Element, force: document.PointSpring) -> PointSpring:
    base, follower = _bodies(element, force.bodies)
    start, end = read_point(element, force.from_, ("from",)), read_point(element, force.to, ("to",))
    if coincide(element, start, end):
        element.fail("from and to are the same point", "the line between them gives the direction", ("to",))
    return PointSpring(
        name=element.name,
        base=base,
        follower=follower,
        start=start,
        end=end,
        law=read_law(element, force.law, _POINT_SPRING, ("law",)),
        active=force.active,
        span=element.span,
    )


def _read_axial_force(element: Element, force: document.AxialForce) -> AxialForce:
    base, follower = _bodies(element, force.bodies)
    return AxialForce(
        name=element.name,
        base=base,
        follower=follower,
        origin=read_point(element, force.origin, ("origin",)),
        point=read_point(element, force.point, ("point",)),
        axis=read_direction(element, force.axis, ("axis",)),
        law=read_law(element, force.law, _AXIAL_FORCE, ("law",)),
        active=force.active,
        span=element.span,
    )


def _read_load(element: Element, load: document.Load) -> BodyLoad:
    if load.force is not None:
        components = element.triple(load.force, FORCE, ("force",), element.with_variables(*_LOAD))
    else:
        assert load.torque is not None
        components = element.triple(load.torque, TORQUE, ("torque",), element.with_variables("t"))
    return BodyLoad(
        name=element.name,
        body=element.body(load.body, ("body",)),
        point=None if load.at is None else read_point(element, load.at, ("at",)),
        axes=load.axes,
        components=components,
        moving_only=load.moving_only,
        active=load.active,
        span=element.span,
    )


def _read_joint_force(element: Element, force: document.JointForce) -> JointForce:
    name, joint = element.joint(force.joint, ("joint",))
    if joint is not None and (joint.cut or len(SPEEDS[JointKind(joint.kind)]) != 1):
        what = "cut" if joint.cut else joint.kind
        element.fail(
            f"the {what} joint '{name}' has no single coordinate",
            "use a revolute, prismatic or screw joint",
            ("joint",),
        )
    slides = joint is not None and joint.kind == "prismatic"
    law = read_law(element, force.law, _SLIDE if slides else _TURN, ("law",))
    return JointForce(name=element.name, joint=name, law=law, active=force.active, span=element.span)


def _read_tyre(element: Element, tyre: document.Tyre) -> Tyre:
    constants = {
        "stiffness": element.scalar(tyre.stiffness, FORCE / LENGTH, ("stiffness",)),
        "radius": element.scalar(tyre.radius, LENGTH, ("radius",)),
    }
    for name in document.Calspan.model_fields:
        constants[name] = element.scalar(getattr(tyre.calspan, name), None, ("calspan", name))
    return Tyre(
        name=element.name,
        body=element.body(tyre.body, ("body",)),
        centre=read_point(element, tyre.centre, ("centre",)),
        axis=read_direction(element, tyre.axis, ("axis",)),
        constants=constants,
        active=tyre.active,
        span=element.span,
    )


def _read_reaction(element: Element, reaction: document.Reaction) -> Reaction:
    name, joint = element.joint(reaction.joint, ("joint",))
    if joint is not None and not joint.cut:
        element.fail(
            f"the joint '{name}' is not cut, so it has no reaction",
            "write cut: true in the joint",
            ("joint",),
        )
    return Reaction(
        name=element.name,
        joint=name,
        body=element.body(reaction.body, ("body",)),
        direction=read_direction(element, reaction.direction, ("direction",)),
        span=element.span,
    )


def _read_marker(element: Element, marker: document.Marker) -> Marker:
    body = element.body(marker.body, ("body",))
    return Marker(name=element.name, body=body, point=read_point(element, marker.at, ("at",)), span=element.span)
