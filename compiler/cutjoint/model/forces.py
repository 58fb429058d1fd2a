"""Forces, those of joints included: from the document's parts to records, not yet mirrored."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from cutjoint.model import force_parts, joint_parts
from cutjoint.model.coordinates import Naming, read_coordinate
from cutjoint.model.expressions import variable
from cutjoint.model.geometry import GLOBAL_AXES, coincide, read_axes, read_direction, read_point
from cutjoint.model.laws import LawKind, read_law, read_names, soft_stops
from cutjoint.model.names import name_problem
from cutjoint.model.operations import Term
from cutjoint.model.records import (
    AxialForce,
    BodyLoad,
    Bushing,
    Force,
    JointForce,
    PointSpring,
    Scalar,
    Tyre,
    Vector,
)
from cutjoint.model.scope import Element
from cutjoint.model.source import Path
from cutjoint.model.units import ANGLE, ANGULAR_SPEED, FORCE, INERTIA, LENGTH, SPEED, TIME, TORQUE
from cutjoint.model.values import SpringDamper

_POINT_SPRING = LawKind({"length": LENGTH, "rate": SPEED, "t": TIME}, FORCE)
_AXIAL_FORCE = LawKind({"travel": LENGTH, "rate": SPEED, "t": TIME}, FORCE)
_SLIDE = LawKind({"position": LENGTH, "rate": SPEED, "t": TIME}, FORCE)
_TURN = LawKind({"position": ANGLE, "rate": ANGULAR_SPEED, "t": TIME}, TORQUE)
_LOAD = ("x", "y", "z", "vx", "vy", "vz", "t")
_TORQUE = ("wx", "wy", "wz", "t")


def read_force(element: Element, force: force_parts.Force) -> Force:
    """One of the elements under ``forces``."""
    match force:
        case force_parts.PointSpring():
            return _read_point_spring(element, force)
        case force_parts.AxialForce():
            return _read_axial_force(element, force)
        case force_parts.Bushing():
            return _read_bushing(element, force)
        case force_parts.Load():
            return _read_load(element, force)
        case force_parts.JointForce():
            return _read_joint_force(element, force)
        case force_parts.Tyre():
            return _read_tyre(element, force)


def _read_point_spring(element: Element, force: force_parts.PointSpring) -> PointSpring:
    base, follower = element.two_bodies(force.bodies)
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


def _read_axial_force(element: Element, force: force_parts.AxialForce) -> AxialForce:
    base, follower = element.two_bodies(force.bodies)
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


def _read_bushing(element: Element, force: force_parts.Bushing) -> Bushing:
    base, follower = element.two_bodies(force.bodies)
    axes: tuple[Vector, Vector, Vector] = GLOBAL_AXES
    if force.x is not None or force.y is not None or force.z is not None:
        axes = read_axes(element, force, ())
    laws = force.laws or (None,) * 6
    return Bushing(
        name=element.name,
        base=base,
        follower=follower,
        point=read_point(element, force.at, ("at",)),
        axes=axes,
        laws=tuple(_bushing_law(element, force, law, index) for index, law in enumerate(laws)),
        active=force.active,
        span=element.span,
    )


def _bushing_law(element: Element, force: force_parts.Bushing, law: Any, index: int) -> Scalar:
    """The force along an axis, or the torque about one, that draws the follower back."""
    kind = _SLIDE if index < 3 else _TURN
    if law is not None:
        return read_law(element, law, kind, ("laws", index))
    stiffness, damping = force.stiffness or (0,) * 6, force.damping or (0,) * 6
    k = element.scalar(stiffness[index], kind.per("position"), ("stiffness", index))
    c = element.scalar(damping[index], kind.per("rate"), ("damping", index))
    return -k * variable("position") - c * variable("rate")


def _read_load(element: Element, load: force_parts.Load) -> BodyLoad:
    if load.force is not None:
        components = element.triple(load.force, FORCE, ("force",), _load_names(element, load, _LOAD))
    else:
        assert load.torque is not None
        components = element.triple(load.torque, TORQUE, ("torque",), _load_names(element, load, _TORQUE))
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


def _load_names(element: Element, load: force_parts.Load, variables: tuple[str, ...]) -> Mapping[str, Term]:
    """The symbols of a load's components."""
    return read_names(element, load.let, ("let",), element.with_variables(*variables))


def _read_joint_force(element: Element, force: force_parts.JointForce) -> JointForce:
    name, joint = element.joint(force.joint, ("joint",))
    coordinate = ""
    if joint is not None:
        coordinate = read_coordinate(element, name, joint, force.coordinate, _naming(("joint",), ("coordinate",)))
    law = read_law(element, force.law, _law_of(coordinate), ("law",))
    return JointForce(name=element.name, joint=name, coordinate=coordinate, law=law, active=force.active, span=element.span)


def _naming(joint: Path, coordinate: Path) -> Naming:
    return Naming("a force needs one to act on", "coordinate: ", "", joint, coordinate)


def _law_of(coordinate: str) -> LawKind:
    """Over angles a law gives torques."""
    return _TURN if coordinate.startswith("angle") or not coordinate else _SLIDE


#: What the names of a joint's own forces end in, by the field that makes them.
JOINT_FORCES = {"spring": "spring", "limits": "stop"}


def joint_forces(element: Element, joint: joint_parts.Joint) -> Iterator[JointForce]:
    """The spring and the stops that are written in a joint."""
    for field, suffix in JOINT_FORCES.items():
        part: joint_parts.JointSpring | joint_parts.JointLimits | None = getattr(joint, field)
        if part is None:
            continue
        coordinate = read_coordinate(element, element.name, joint, part.coordinate, _naming((field,), (field, "coordinate")))
        problem = name_problem(f"{element.path[-1]}_{suffix}")
        if problem:
            element.fail(f"{field}: {problem[0]}", "rename the joint", (field,), at_key=True)
        yield JointForce(
            name=f"{element.name}_{suffix}",
            joint=element.name,
            coordinate=coordinate,
            law=_own_law(element, part, _law_of(coordinate)),
            active=True,
            span=element.scope.source.key_span((*element.path, field)),
        )


def _own_law(element: Element, part: joint_parts.JointSpring | joint_parts.JointLimits, kind: LawKind) -> Scalar:
    return _spring_law(element, part, kind) if isinstance(part, joint_parts.JointSpring) else _stop_law(element, part, kind)


def _spring_law(element: Element, spring: joint_parts.JointSpring, kind: LawKind) -> Scalar:
    law = SpringDamper(stiffness=spring.stiffness, damping=spring.damping, free_position=spring.free_position)
    return read_law(element, law, kind, ("spring",))


def _stop_law(element: Element, limits: joint_parts.JointLimits, kind: LawKind) -> Scalar:
    lower, upper = limits.lower, limits.upper
    if lower is not None and upper is not None:
        low, high = (element.value(element.scalar(x, None, ("limits",))) for x in (lower, upper))
        if low >= high:
            element.fail("limits: lower is not below upper", "", ("limits",))
    return soft_stops(element, kind, ("limits",), limits.stiffness, limits.damping, lower=lower, upper=upper)


def _read_tyre(element: Element, tyre: force_parts.Tyre) -> Tyre:
    constants = {
        "stiffness": element.scalar(tyre.stiffness, FORCE / LENGTH, ("stiffness",)),
        "radius": element.scalar(tyre.radius, LENGTH, ("radius",)),
        "spin_inertia": element.scalar(tyre.spin_inertia, INERTIA, ("spin_inertia",)),
    }
    for name in force_parts.Calspan.model_fields:
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
