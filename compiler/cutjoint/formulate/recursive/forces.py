"""Body matrices, inertia forces and applied forces, as contributions to the body system (Cuadrado et al. 2000, eqs. 24-25).

Each element also yields its reported quantities, so that results and equilibrium tables have the values of the equations.
"""

from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeAlias

import sympy

from cutjoint.elements.forces.on_road import OnRoad
from cutjoint.elements.interaction import Axis, Carrier, Frame, Point
from cutjoint.elements.interactions.road_contact import WheelContact, meet_road
from cutjoint.formulate.forces import Laws, Lazy, LazyRotation, Measured, forces_guarded, is_active, reported_variables, smallest_margin
from cutjoint.formulate.quantities import measured_forces
from cutjoint.formulate.recursive.coordinates import measure, travel, tree_motion
from cutjoint.formulate.recursive.kinematics import Kinematics, Rotor, halves
from cutjoint.formulate.recursive.quantities import ContactFrame, Forces, let_laws_read
from cutjoint.formulate.recursive.recursion import BodySystem, add_to
from cutjoint.kernels.joints import slide_axis
from cutjoint.model.expressions.dependencies import forces_in_order
from cutjoint.model.records import COORDINATES, GROUND, Body, Force, Joint, LawForce, Model, Output, Scalar, Scene, Vector, Wheel
from cutjoint.program.blocks import Block

#: The moments and products of inertia of a body.
Inertia: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]


def add_bodies(system: BodySystem, k: Kinematics, model: Model) -> None:
    """M_i and the weight and inertia forces of every body; rotors contribute their spin only, as if otherwise fixed to their carriers."""
    b = k.builder
    by_name = {body.name: body for body in model.bodies}
    wheels = {force.body for force in model.forces if isinstance(force, Wheel)}
    for name in k.motions:
        body = by_name[name]
        equation = "M = [m, -m c~; m c~, J - m c~ c~],  Q = [m (g - w x v_G); c x m (g - w x v_G) - w x J w]  (eqs. 24, 25)"
        with b.section("body", name, equation, body.span.place):
            gravity = k.direction(GROUND, model.gravity)
            held = [by_name[wheel] for wheel, rotor in k.rotors.items() if rotor.carrier == name]
            joined = reduce(_joined, (replace(each, inertia=_across(each, k)) for each in held), body)
            system.M[name], system.Q[name] = _spinning(k, name) if name in k.rotors else of_body(k, joined, gravity, turns=name in wheels)
            if held or name in k.rotors:
                M, Q = of_body(k, body, gravity, turns=name in wheels)
                system.own[name] = M, b.sub(Q, system.Q[name])


def find_rotors(k: Kinematics, model: Model) -> dict[str, Rotor]:
    """The wheels that rotate about their axes of symmetry in bearings on other bodies, without any other joint."""
    found, b = dict[str, Rotor](), k.builder
    if any(force.by_load for force in model.forces):
        return found  # the load of a joint is that of all that it carries
    for body in model.bodies:
        t = k.motions[body.name].tree_joint
        wheels = [force for force in model.forces if isinstance(force, Wheel) and force.body == body.name]
        joint, symmetry = t.joint, _symmetry(body, t.joint) if wheels else None
        joined = [each for each in model.joints if body.name in (each.base, each.follower)]
        geared = any(joint.name in gear.joints for gear in model.gears)
        alone = len(joined) == 1 and not geared and not joint.guide and joint.armature == 0
        if symmetry is None or 0 in (symmetry[0], body.mass) or t.parent == GROUND or t.reversed or not alone:
            continue
        if all(wheel.axis == joint.axes[0] and _on_axis(wheel.centre, joint) for wheel in wheels):
            axis, along = k.direction(t.parent, joint.axes[0]), k.translator.scalar(symmetry[0])
            found[body.name] = Rotor(carrier=t.parent, axis=b.name(axis, "axis", body.name), inertia=along)
    return found


def _spinning(k: Kinematics, body: str) -> tuple[Block, Block]:
    """No mass, and the moment -I s w_P x a of the spin s of a rotor."""
    b, rotor = k.builder, k.rotors[body]
    _, w = halves(b, k.frames[rotor.carrier].Z)
    spin = b.add(b.dot(rotor.axis, w), k.motions[body].rate[0])
    turned = b.scale(b.mul(rotor.inertia, spin), b.cross(w, rotor.axis))
    return b.zero(6, 6), b.stack([[b.zero(3)], [b.neg(turned)]])


def _across(body: Body, k: Kinematics) -> Inertia:
    """The moments of inertia of a rotor without that about its axis."""
    joint = k.motions[body.name].tree_joint.joint
    symmetry = _symmetry(body, joint)
    assert symmetry is not None
    a = sympy.Matrix(joint.axes[0])
    return _entries(symmetry[1] * (sympy.eye(3) - a * a.T))


def _joined(one: Body, other: Body) -> Body:
    """Two bodies in one, which has the first one's name."""
    mass = one.mass + other.mass
    centre = tuple((one.mass * x + other.mass * y) / mass for x, y in zip(one.centre_of_mass, other.centre_of_mass, strict=True))
    apart = sympy.Matrix([y - x for x, y in zip(one.centre_of_mass, other.centre_of_mass, strict=True)])
    steiner = one.mass * other.mass / mass * ((apart.T * apart)[0] * sympy.eye(3) - apart * apart.T)
    inertia = tuple(x + y + z for x, y, z in zip(one.inertia, other.inertia, _entries(steiner), strict=True))
    return replace(one, mass=mass, centre_of_mass=centre, inertia=inertia)


def _entries(matrix: sympy.Matrix) -> Inertia:
    """xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = (matrix[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return xx, yy, zz, xy, xz, yz


def of_body(k: Kinematics, body: Body, gravity: Block, *, turns: bool) -> tuple[Block, Block]:
    """M_i and Q_i of a body by its weight and inertia."""
    b = k.builder
    if body.is_massless:
        return b.zero(6, 6), b.zero(6)
    mass = k.translator.scalar(body.mass)
    c = b.name(k.point(body.name, body.centre_of_mass), "c", body.name)
    xx, yy, zz, xy, xz, yz = (k.translator.scalar(x) for x in body.inertia)
    tensor = b.mirror(b.stack([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    rotor = _rotor(k, body) if turns else None
    J = b.name(b.sandwich(k.frames[body.name].R, tensor) if rotor is None else rotor, "J", body.name)
    moment = b.scale(mass, c)
    corner = b.neg(b.skew(moment))
    M = b.stack([[b.scale(mass, b.identity(3)), corner], [b.transpose(corner), b.mirror(b.sub(J, b.mul(b.skew(moment), b.skew(c))))]])
    _, w = halves(b, k.frames[body.name].Z)
    force = b.scale(mass, b.sub(gravity, b.cross(w, k.velocity(body.name, c))))
    torque = b.sub(b.cross(c, force), b.cross(w, b.mul(J, w)))
    return b.mirror(M), b.stack([[force], [torque]])


def _rotor(k: Kinematics, body: Body) -> Block | None:
    """J = J_r 1 + (J_a - J_r) a a^T, the inertia of a wheel that rotates about its axis of symmetry a.
    It is independent of the angle; None of any other body."""
    b, t = k.builder, k.motions[body.name].tree_joint
    symmetry = _symmetry(body, t.joint)
    if symmetry is None:
        return None
    along, across = symmetry
    a = k.direction(t.parent, t.joint.axes[0])
    radial, more = k.translator.scalar(across), k.translator.scalar(along - across)
    return b.mirror(b.add(b.scale(radial, b.identity(3)), b.mul(b.scale(more, a), b.transpose(a))))


def _symmetry(body: Body, joint: Joint) -> tuple[Scalar, Scalar] | None:
    """The moments of inertia of a body along and across the axis of a hinge that is its axis of symmetry; None of any other."""
    if joint.kind != "revolute" or not _on_axis(body.centre_of_mass, joint):
        return None
    axis, (xx, yy, zz, xy, xz, yz) = joint.axes[0], body.inertia
    inertia, column = sympy.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), sympy.Matrix(axis)
    along = (column.T * inertia * column)[0]
    across = (xx + yy + zz - along) / 2
    rest = inertia - across * sympy.eye(3) - (along - across) * column * column.T
    if any(entry != 0 and not (entry.is_number and abs(entry) <= 1e-15 * sympy.Max(along, across)) for entry in rest):
        return None
    return along, across


def _on_axis(point: Vector, joint: Joint) -> bool:
    axis, arm = joint.axes[0], [c - o for c, o in zip(point, joint.at, strict=True)]
    return all(arm[i] * axis[j] == arm[j] * axis[i] for i, j in ((0, 1), (1, 2), (2, 0)))


def add_forces(system: BodySystem, k: Kinematics, model: Model, scene: Scene, outputs: tuple[Output, ...]) -> Forces:
    """The active force elements; afterwards laws know the quantities that they may read."""
    forces = Forces()
    let_laws_read(k, model, forces)
    for force, names in measured_forces(model, scene, outputs):
        mechanics = WrenchMechanics(b=k.builder, translator=k.translator, system=system, k=k, force=force, road=scene.road.parts)
        values = force.interaction.values(force, mechanics)
        forces.quantities[force.name] = {name: block for name, block in values.items() if name in names}
    for force in forces_in_order(model):
        if is_active(force, scene):
            system.source = force.name
            with k.builder.section("force", force.name, force.interaction.equation, force.span.place):
                mechanics = WrenchMechanics(b=k.builder, translator=k.translator, system=system, k=k, force=force, road=scene.road.parts)
                forces.add(k.builder, force.name, force.interaction.act(force, mechanics))
    return forces


def add_guards(system: BodySystem, forces: Forces, k: Kinematics, model: Model, scene: Scene) -> dict[str, Block]:
    """The smallest margin of each guarded force; where its parts are joins the reported quantities."""
    margins = {}
    for guard in forces_guarded(model, scene):
        force, b = guard.force, k.builder
        with b.section("guard", force.name, "the law is zero while the margin is not negative", force.span.place):
            mechanics = WrenchMechanics(b=b, translator=k.translator, system=system, k=k, force=force, road=scene.road.parts)
            values = force.interaction.values(force, mechanics)
            if isinstance(force, LawForce):
                forces.add(b, force.name, reported_variables(force, values))
            margins[force.name] = b.name(smallest_margin(mechanics, guard, values), "margin", force.name)
    return margins


def find_contacts(system: BodySystem, k: Kinematics, model: Model, scene: Scene) -> dict[str, ContactFrame]:
    """The contacts of all wheels with the road."""
    found, b = {}, k.builder
    for force in (force for force in model.forces if isinstance(force, OnRoad)):
        m = WrenchMechanics(b=b, translator=k.translator, system=system, k=k, force=force, road=scene.road.parts)
        contact = force.interaction
        assert isinstance(contact, WheelContact)
        road = meet_road(m, force, m.point(contact.centre).x, m.direction(contact.axis).x)
        at = b.sub(k.point(force.body, force.centre), b.scale(road.distance(b), road.e_z))
        found[force.name] = ContactFrame(body=force.body, at=at, axes=b.stack([[road.e_x, road.e_y, road.n]]))
    return found


def apply_at(system: BodySystem, k: Kinematics, body: str, point: Block, force: Block) -> Block:
    """A force at a point: its wrench [f; p x f] joins Q and is returned."""
    b = k.builder
    wrench = b.stack([[force], [b.cross(point, force)]])
    system.add_force(body, wrench)
    return wrench


@dataclass(frozen=True, kw_only=True)
class WrenchMechanics(Laws):
    """The mechanics of a force on bodies: points from the poles, forces as wrenches at the poles."""

    system: BodySystem
    k: Kinematics
    force: Force

    def _of(self, body: str) -> str:
        """The body in which a wheel's centre and axis are fixed: the carrier of a rotor."""
        return self.k.rotors[body].carrier if isinstance(self.force, Wheel) and body in self.k.rotors else body

    def _point(self, at: Point) -> Block:
        return self.k.point(self._of(at.body(self.force)), at.of(self.force))

    def point(self, at: Point) -> Lazy:
        """The place of a point from the world's origin, and its velocity."""
        body, point = self._of(at.body(self.force)), self._point(at)
        return Lazy(place=lambda: self.k.absolute(body, point), rate=lambda: self.k.velocity(body, point))

    def displacement(self, start: Point, end: Point) -> Measured:
        (follower, last), (base, first) = ((at.body(self.force), self._point(at)) for at in (end, start))
        displacement = self.k.between(follower, last, base, first)
        return Measured(x=displacement, v=self.b.sub(self.k.velocity(follower, last), self.k.velocity(base, first)))

    def direction(self, axis: Axis) -> Lazy:
        """A direction, which rotates with its body."""
        body = self._of(axis.body(self.force))
        direction, spin = self.k.direction(body, axis.of(self.force)), self._spin(body)
        return Lazy(place=lambda: direction, rate=lambda: self.b.cross(spin, direction))

    def _body(self, carrier: Carrier) -> str:
        return str(getattr(self.force, carrier))

    def _spin(self, body: str) -> Block:
        return halves(self.b, self.k.frames[body].Z)[1]

    def spin(self, carrier: Carrier) -> Block:
        return self._spin(self._body(carrier))

    def spin_and_relative_rate(self, carrier: Carrier) -> tuple[Block, Block]:
        """The angular velocity of the wheel, or of a rotor's carrier and the rate of the bearing."""
        body = self._body(carrier)
        return self._spin(self._of(body)), self.b.zero(1) if self._of(body) == body else self.k.motions[body].rate[0]

    def in_body(self, carrier: Carrier, vector: Block) -> Block:
        """R^T v."""
        return self.b.mul(self.b.transpose(self.k.frames[self._body(carrier)].R), vector)

    def in_global(self, vector: Block) -> Block:
        return self.k.in_global(vector)

    def from_global(self, components: Block) -> Block:
        return self.k.from_global(components)

    def from_body(self, carrier: Carrier, components: Block) -> Block:
        """R v."""
        return self.b.mul(self.k.frames[self._body(carrier)].R, components)

    def _axes(self, frame: Frame) -> tuple[Block, Block]:
        """The axes of a frame in columns, as the bodies carry them."""
        axes = self.translator.matrix(sympy.Matrix([list(axis) for axis in frame.of(self.force)]).T)
        base, follower = (self.b.mul(self.k.frames[body].R, axes) for body in frame.bodies(self.force))
        return base, follower

    def along(self, start: Point, end: Point, direction: Axis | Frame) -> Measured | Lazy:
        """The displacement along directions; its rate is that of the bodies' points at the end."""
        b, k, base, follower = self.b, self.k, start.body(self.force), end.body(self.force)
        if isinstance(direction, Axis):
            measured = travel(k, (base, follower), (start.of(self.force), end.of(self.force)), direction.of(self.force))[2]
            assert measured.position is not None
            return Measured(x=measured.position, v=measured.rate)
        E, point = self._axes(direction)[0], self._point(end)
        to_base = b.transpose(E)
        displacement = k.between(follower, point, base, self._point(start))
        on_base = b.add(point, k.pole_step(base, follower))
        speed = b.sub(k.velocity(follower, point), k.velocity(base, on_base))
        return Lazy(place=lambda: b.mul(to_base, displacement), rate=lambda: b.mul(to_base, speed))

    def rotation(self, frame: Frame) -> LazyRotation:
        """Half the sum of e_k x S e_k, with S = E^T G."""
        b, (base, follower), (E, G) = self.b, frame.bodies(self.force), self._axes(frame)
        spin, to_base = b.sub(self._spin(follower), self._spin(base)), b.transpose(E)
        S = b.mul(to_base, G)
        half, (x, y, z) = b.number(0.5), (b.element(S, i, i) for i in range(3))
        turns = b.column([b.mul(half, b.sub(b.element(S, i, j), b.element(S, j, i))) for i, j in ((2, 1), (0, 2), (1, 0))])
        by_rotation = b.scale(half, b.sub(b.scale(b.add(b.add(x, y), z), b.identity(3)), S))
        return LazyRotation(
            place=lambda: turns, rate=lambda: b.mul(by_rotation, b.mul(to_base, spin)), jacobian=lambda: by_rotation,
            rows=lambda: [[b.element(S, i, j) for j in range(3)] for i in range(3)],
        )  # fmt: skip

    def coordinate(self) -> dict[str, Block]:
        """The coordinate as the tree or the cut joint has it."""
        measured = measure(self.k, self.force.joint_of, self.force.coordinate_of)
        return {"rate": measured.rate} if measured.position is None else {"position": measured.position, "rate": measured.rate}

    def apply_force_pair(self, start: Point, end: Point, force: Block) -> None:
        """Opposite wrenches of a force at the end."""
        self._force_pair((start.body(self.force), end.body(self.force)), self._point(end), force)

    def apply_force_along(self, start: Point, end: Point, direction: Axis | Frame, force: Block) -> None:
        """Opposite wrenches of a force at the end."""
        if isinstance(direction, Axis):
            self.apply_force_pair(start, end, self.b.scale(force, self.k.direction(start.body(self.force), direction.of(self.force))))
        else:
            self.apply_force_pair(start, end, self.b.mul(self._axes(direction)[0], force))

    def _force_pair(self, ends: tuple[str, str], point: Block, force: Block) -> Block:
        """A force on the follower at a point, whose wrench is returned, and its reaction on the base on the same line."""
        b, (base, follower) = self.b, ends
        wrench = apply_at(self.system, self.k, follower, point, force)
        step = self.k.pole_step(base, follower)
        if self.k.frames[base].root == self.k.frames[follower].root:
            self.system.add_force(base, b.neg(wrench))
        else:
            apply_at(self.system, self.k, base, b.add(point, step), b.neg(force))
        return wrench

    def apply_force(self, at: Point, force: Block) -> None:
        """The wrench of a force at a point."""
        apply_at(self.system, self.k, at.body(self.force), self._point(at), force)

    def apply_force_at_offset(self, at: Point, arm: Block, force: Block, moment: Block) -> None:
        """The wrench of a force at an offset from a point, and of a moment."""
        b = self.b
        torque = b.add(b.cross(b.add(self._point(at), arm), force), moment)
        self.system.add_force(at.body(self.force), b.stack([[force], [torque]]))

    def apply_torque(self, carrier: Carrier, torque: Block) -> None:
        self._turn(self._body(carrier), torque)

    def _turn(self, body: str, torque: Block) -> Block:
        wrench = self.b.stack([[self.b.zero(3)], [torque]])
        self.system.add_force(body, wrench)
        return wrench

    def apply_frame_torque(self, frame: Frame, torque: Block) -> None:
        """Opposite torques E (d theta/d turn)^T times the force on the rotations."""
        b, ends = self.b, frame.bodies(self.force)
        turned = b.mul(b.transpose(self.rotation(frame).by_rotation), torque)
        self._torque_pair(ends, b.mul(self._axes(frame)[0], turned))

    def _torque_pair(self, ends: tuple[str, str], torque: Block) -> Block:
        """A torque on the follower, whose wrench is returned, and its reaction on the base."""
        wrench = self._turn(ends[1], torque)
        self._turn(ends[0], self.b.neg(torque))
        return wrench

    def apply_joint_force(self, force: Block) -> None:
        """A force on an unknown of a tree joint, or on both bodies of a cut joint; it does not move a guided joint."""
        joint, coordinate, b = self.force.joint_of, self.force.coordinate_of, self.b
        motion = tree_motion(self.k, joint)
        if motion is None:
            add_to(b, self.system.cut_joint_wrenches, joint, self._push_cut_joint(force))
        elif motion.chart is not None or motion.derivative is not None:
            index = COORDINATES[motion.tree_joint.joint.kind].index(coordinate)
            column = b.column([force if i == index else b.zero(1) for i in range(len(motion.rate))])
            add_to(b, self.system.joint_forces, motion.tree_joint.child, column)

    def apply_joint_friction(self, law: Block) -> None:
        """A force that waits for its load."""
        self.system.friction_laws[self.force.name] = self.b.name(law, "rubbing", self.force.name)

    def _push_cut_joint(self, value: Block) -> Block:
        """A force along the coordinate of a cut joint, or a torque about its axis, on both of its bodies: the wrench on the follower."""
        k, cut = self.k, next(c for c in (*self.k.topology.cuts, *self.k.topology.embedded) if c.name == self.force.joint_of)
        ends = cut.base, cut.follower
        if self.force.coordinate_of in cut.element.angles:
            return self._torque_pair(ends, self.b.scale(value, k.direction(cut.base, cut.axes[0])))
        axis = k.direction(cut.base, slide_axis(cut, self.force.coordinate_of))
        return self._force_pair(ends, k.point(cut.follower, cut.at), self.b.scale(value, axis))
