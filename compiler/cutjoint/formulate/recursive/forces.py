"""Body matrices, inertia forces and applied forces, as contributions to the body system (Cuadrado et al. 2000, eqs. 24-25).

Each element also yields its reported quantities, so that results and equilibrium tables have the values of the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy

from cutjoint.elements.force import AxisForce, Compliance, Interaction, LineForce, OnCoordinate, Place, RoadContact, Wrench
from cutjoint.formulate.forces import (
    PLACE,
    POSITION,
    RATE,
    SIDE,
    TRAVEL,
    guards_of,
    is_active,
    law_of,
    line_force,
    reported_variables,
    six_laws,
    smallest_margin,
    stretch,
)  # fmt: skip
from cutjoint.formulate.recursive.coordinates import measure, travel, tree_motion
from cutjoint.formulate.recursive.kinematics import Kinematics, halves
from cutjoint.formulate.recursive.recursion import BodySystem, add_to
from cutjoint.formulate.tyre import Contact, Wheel, tyre_force
from cutjoint.kernels.directions import slide_axis
from cutjoint.model.records import COORDINATES, Body, BodyLoad, Force, JointForce, LawForce, Model, Scalar, Scene, Tyre
from cutjoint.program.blocks import BindingTime, Block, Builder


@dataclass(kw_only=True)
class Forces:
    """Reported quantities by element and name."""

    quantities: dict[str, dict[str, Block]] = field(default_factory=dict)

    def add(self, b: Builder, element: str, quantities: dict[str, Block]) -> None:
        """The quantities of an element, each under its name."""
        self.quantities[element] = quantities
        for quantity, block in quantities.items():
            b.name(block, quantity, element)


def add_bodies(system: BodySystem, k: Kinematics, model: Model) -> None:
    """M_i and the weight and inertia forces of every body."""
    b = k.builder
    gravity = k.vector(model.gravity)
    by_name = {body.name: body for body in model.bodies}
    for name in k.motions:
        body = by_name[name]
        equation = "M = [m, -m c~; m c~, J - m c~ c~],  Q = [m (g - w x v_G); c x m (g - w x v_G) - w x J w]  (eqs. 24, 25)"
        with b.section("body", name, equation, body.span.place):
            system.M[name], system.Q[name] = _body(k, body, gravity)


def _body(k: Kinematics, body: Body, gravity: Block) -> tuple[Block, Block]:
    b = k.builder
    if body.is_massless:
        return b.zero(6, 6), b.zero(6)
    mass = k.translator.scalar(body.mass)
    c = b.name(k.point(body.name, body.centre_of_mass), "c", body.name)
    xx, yy, zz, xy, xz, yz = (k.translator.scalar(x) for x in body.inertia)
    tensor = b.mirror(b.stack([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    J = b.name(b.sandwich(k.frames[body.name].R, tensor), "J", body.name)
    moment = b.scale(mass, c)
    corner = b.neg(b.skew(moment))
    M = b.stack([
        [b.scale(mass, b.identity(3)), corner],
        [b.transpose(corner), b.mirror(b.sub(J, b.mul(b.skew(moment), b.skew(c))))],
    ])  # fmt: skip
    _, w = halves(b, k.frames[body.name].Z)
    pull = b.scale(mass, b.sub(gravity, b.cross(w, k.velocity(body.name, c))))
    torque = b.sub(b.cross(c, pull), b.cross(w, b.mul(J, w)))
    return b.mirror(M), b.stack([[pull], [torque]])


def add_forces(system: BodySystem, k: Kinematics, model: Model, scene: Scene) -> Forces:
    """The force elements that the scene has switched on."""
    forces = Forces()
    rules: Mapping[type[Interaction], Callable[..., dict[str, Block]]] = {
        LineForce: _stretch, AxisForce: _travel, Compliance: _compliance,
        Wrench: _load, OnCoordinate: _on_coordinate, RoadContact: _contact,
    }  # fmt: skip
    for force in model.forces:
        if is_active(force, scene):
            system.source = force.name
            how = force.interaction
            with k.builder.section("force", force.name, _EQUATIONS[type(how)], force.span.place):
                forces.add(k.builder, force.name, rules[type(how)](system, k, force, how))
    return forces


def add_guards(forces: Forces, k: Kinematics, model: Model, scene: Scene) -> dict[str, Block]:
    """The smallest margin of each guarded force; where its parts are joins the reported quantities."""
    margins = {}
    for guard in guards_of(model, scene):
        name, b = guard.force.name, k.builder
        with b.section("guard", name, "the law is zero while the margin is not negative", guard.force.span.place):
            values = _law_values(k, guard.force)
            if isinstance(guard.force, LawForce):
                forces.add(b, name, reported_variables(values))
            margins[name] = b.name(smallest_margin(b, k.translator, guard, values), "margin", name)
    return margins


def _law_values(k: Kinematics, force: Any) -> dict[Scalar, Block]:
    """The variables of a force's law: the position that it depends on, and its rate; a tyre's lateral force."""
    match force.interaction:
        case LineForce() as how:
            _, way, speed = _between_ends(k, force, how)
            return stretch(k.builder, way, speed)[1]
        case AxisForce() as how:
            return _along_axis(k, force, how)[2]
        case OnCoordinate():
            return _of_coordinate(k, force)
        case Wrench():
            return _load_values(k, force)[1]
        case RoadContact():
            return {SIDE: _contact_with_road(k, force)[1].quantities["Fy"]}
    raise AssertionError(force)


_EQUATIONS: Mapping[type[Interaction], str] = {
    LineForce: "n = (p_end - p_start)/length,  follower gets -law(length, rate) n",
    AxisForce: "travel = e . (p - p_origin),  follower gets law(travel, rate) e",
    Compliance: "x = E^T (p_f - p_b),  theta = half the sum of e_k x g_k in E;  follower gets E law(x), E (d theta/d turn)^T law(theta)",
    Wrench: "the force given by its components at its point",
    OnCoordinate: "tau = law(position, rate) of one coordinate",
    RoadContact: "Fz = k (R - dz)/sqrt(1 + slope^2);  Fy, Mz by the Calspan model",
}


def apply_at(system: BodySystem, k: Kinematics, body: str, point: Block, force: Block) -> Block:
    """A force at a point: its wrench [f; p x f] joins Q and is returned."""
    b = k.builder
    wrench = b.stack([[force], [b.cross(point, force)]])
    system.add_force(body, wrench)
    return wrench


def _apply_pair(system: BodySystem, k: Kinematics, ends: tuple[str, str], point: Block, pull: Block) -> Block:
    """A force on the follower at a point, whose wrench is returned, and its reaction on the base on the same line."""
    b, (base, follower) = k.builder, ends
    wrench = apply_at(system, k, follower, point, pull)
    step = k.pole_step(base, follower)
    if k.frames[base].root == k.frames[follower].root:
        system.add_force(base, b.neg(wrench))
    else:
        apply_at(system, k, base, b.add(point, step), b.neg(pull))
    return wrench


def _twist_pair(system: BodySystem, k: Kinematics, ends: tuple[str, str], torque: Block) -> Block:
    """A torque on the follower, whose wrench is returned, and its reaction on the base."""
    b, (base, follower) = k.builder, ends
    wrench = b.stack([[b.zero(3)], [torque]])
    system.add_force(follower, wrench)
    system.add_force(base, b.stack([[b.zero(3)], [b.neg(torque)]]))
    return wrench


def _between_ends(k: Kinematics, force: Force, how: LineForce) -> tuple[Block, Block, Block]:
    """The follower's point, the way to it from the base's, and the way's rate."""
    base, follower = _bodies(how.start, how.end, force)
    end, start = k.point(follower, how.end.of(force)), k.point(base, how.start.of(force))
    way = k.between(follower, end, base, start)
    return end, way, k.builder.sub(k.velocity(follower, end), k.velocity(base, start))


def _stretch(system: BodySystem, k: Kinematics, force: LawForce, how: LineForce) -> dict[str, Block]:
    end, way, speed = _between_ends(k, force, how)
    pull, quantities = line_force(k.builder, k.translator, force.law, way, speed)
    _apply_pair(system, k, _bodies(how.start, how.end, force), end, pull)
    return quantities


def _bodies(base: Place, follower: Place, force: Force) -> tuple[str, str]:
    return base.body(force), follower.body(force)


def _along_axis(k: Kinematics, force: Force, how: AxisForce) -> tuple[Block, Block, dict[Scalar, Block]]:
    """The axis, the follower's point, and the variables of the law."""
    ends = _bodies(how.origin, how.point, force)
    axis, point, measured = travel(k, ends, (how.origin.of(force), how.point.of(force)), how.axis.of(force))
    assert measured.position is not None
    return axis, point, {TRAVEL: measured.position, RATE: measured.rate}


def _travel(system: BodySystem, k: Kinematics, force: LawForce, how: AxisForce) -> dict[str, Block]:
    axis, point, values = _along_axis(k, force, how)
    law = law_of(k.translator, force.law, values, TRAVEL)
    _apply_pair(system, k, _bodies(how.origin, how.point, force), point, k.builder.scale(law["force"], axis))
    return {**law, **reported_variables(values)}


def _compliance(system: BodySystem, k: Kinematics, force: Force, how: Compliance) -> dict[str, Block]:
    b, ends = k.builder, _bodies(how.base, how.follower, force)
    base, follower = ends
    axes = k.translator.matrix(sympy.Matrix([list(axis) for axis in how.frame.of(force)]).T)
    E, G = (b.mul(k.frames[body].R, axes) for body in ends)
    point, to_base = k.point(follower, how.follower.of(force)), b.transpose(E)
    way = k.between(follower, point, base, k.point(base, how.base.of(force)))
    on_base = b.add(point, k.pole_step(base, follower))
    speed = b.sub(k.velocity(follower, point), k.velocity(base, on_base))
    spin = b.sub(halves(b, k.frames[follower].Z)[1], halves(b, k.frames[base].Z)[1])
    rotation, by_turn = _small_rotation(b, b.mul(to_base, G))
    places = (b.mul(to_base, way), rotation)
    rates = (b.mul(to_base, speed), b.mul(by_turn, b.mul(to_base, spin)))
    pull, torque, quantities = six_laws(b, k.translator, force.expressions, places, rates, by_turn)
    _apply_pair(system, k, ends, point, b.mul(E, pull))
    _twist_pair(system, k, ends, b.mul(E, torque))
    return quantities


def _small_rotation(b: Builder, S: Block) -> tuple[Block, Block]:
    """Half the sum of e_k x S e_k, and its Jacobian (tr(S) 1 - S)/2 by the angular velocity of S."""
    half, (x, y, z) = b.number(0.5), (b.element(S, i, i) for i in range(3))
    pairs = ((2, 1), (0, 2), (1, 0))
    rotation = b.column([b.mul(half, b.sub(b.element(S, i, j), b.element(S, j, i))) for i, j in pairs])
    trace = b.add(b.add(x, y), z)
    return rotation, b.scale(half, b.sub(b.scale(trace, b.identity(3)), S))


def _load_values(k: Kinematics, force: BodyLoad) -> tuple[Block, dict[Scalar, Block]]:
    """The load's point, and the variables of its components."""
    b, frame = k.builder, k.frames[force.body]
    point = k.point(force.body, force.point) if force.point is not None else frame.r
    place, speed = k.absolute(force.body, point), k.velocity(force.body, point)
    spin = halves(b, frame.Z)[1]
    if force.in_body:
        speed, spin = (b.mul(b.transpose(frame.R), vector) for vector in (speed, spin))
    return point, dict(zip(PLACE, [b.element(x, i) for x in (place, speed, spin) for i in range(3)], strict=True))


def _load(system: BodySystem, k: Kinematics, force: BodyLoad, how: Wrench) -> dict[str, Block]:
    b, frame = k.builder, k.frames[force.body]
    point, values = _load_values(k, force)
    translator = k.translator.with_values(values)
    components = b.column([translator.scalar(c) for c in force.components])
    if force.moving_only:
        components = b.scale(b.symbol("motion", 1, BindingTime.STEP), components)
    vector = b.mul(frame.R, components) if force.in_body else components
    if force.point is None:
        system.add_force(force.body, b.stack([[b.zero(3)], [vector]]))
    else:
        apply_at(system, k, force.body, point, vector)
    return {name: b.element(components, i) for i, name in enumerate(force.quantities)}


def _of_coordinate(k: Kinematics, force: JointForce) -> dict[Scalar, Block]:
    """The variables of the law."""
    measured = measure(k, force.joint, force.coordinate)
    return {RATE: measured.rate} if measured.position is None else {POSITION: measured.position, RATE: measured.rate}


def _on_coordinate(system: BodySystem, k: Kinematics, force: JointForce, how: OnCoordinate) -> dict[str, Block]:
    law = law_of(k.translator, force.law, _of_coordinate(k, force), POSITION)
    motion = tree_motion(k, force.joint)
    if motion is None:
        wrench = _apply_at_cut_joint(system, k, force, law["force"])
        add_to(k.builder, system.cut_joint_wrenches, force.joint, wrench)
    elif motion.chart is not None:  # a force does not move a guided joint
        index = COORDINATES[motion.tree_joint.joint.kind].index(force.coordinate)
        speeds = range(len(motion.chart.speed_names))
        column = k.builder.column([law["force"] if i == index else k.builder.zero(1) for i in speeds])
        add_to(k.builder, system.joint_forces, motion.tree_joint.child, column)
    return law


def _apply_at_cut_joint(system: BodySystem, k: Kinematics, force: JointForce, value: Block) -> Block:
    """A force along the coordinate of a cut joint, or a torque about its axis, on both of its bodies: the wrench on the follower."""
    b, cut = k.builder, next(c for c in k.topology.cuts if c.name == force.joint)
    if force.coordinate in cut.element.angles:
        return _twist_pair(system, k, (cut.base, cut.follower), b.scale(value, k.direction(cut.base, cut.axes[0])))
    axis = k.direction(cut.base, slide_axis(cut, force.coordinate))
    return _apply_pair(system, k, (cut.base, cut.follower), k.point(cut.follower, cut.at), b.scale(value, axis))


def _contact_with_road(k: Kinematics, force: Tyre) -> tuple[Block, Contact]:
    """The wheel's centre, and its contact with the road."""
    b = k.builder
    centre, axis = k.point(force.body, force.centre), k.direction(force.body, force.axis)
    _, w = halves(b, k.frames[force.body].Z)
    wheel = Wheel(
        centre=k.absolute(force.body, centre), velocity=k.velocity(force.body, centre), axis=axis, axis_rate=b.cross(w, axis)
    )
    return centre, tyre_force(b, k.translator, force, wheel)


def _contact(system: BodySystem, k: Kinematics, force: Tyre, how: RoadContact) -> dict[str, Block]:
    b, (centre, contact) = k.builder, _contact_with_road(k, force)
    torque = b.add(b.cross(b.add(centre, contact.arm), contact.force), contact.moment)
    system.add_force(force.body, b.stack([[contact.force], [torque]]))
    return contact.quantities
