"""Applied forces in natural coordinates, each with its tangents by the points and directions that it depends on.

A law over a scalar s(q), such as a length or a displacement along an axis, works on s: Q = law ds/dq.  A torque T on a body with the
perpendicular unit directions e_i works on them as half the sum of (T x e_i) . delta e_i.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import sympy

from cutjoint.elements.interaction import Axis, Carrier, Frame, Place, Point
from cutjoint.formulate.forces import Laws, Lazy, LazyRotation, forces_guarded, is_active, reported_variables, smallest_margin
from cutjoint.formulate.inputs import guide_rates
from cutjoint.formulate.natural.motion import Motion, NodeMotions
from cutjoint.formulate.natural.nodes import Form, difference
from cutjoint.formulate.natural.quantities import let_laws_read
from cutjoint.formulate.quantities import measured_forces
from cutjoint.kernels.joints import slide_axis
from cutjoint.model.elements.friction import refuse_friction
from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.expressions.dependencies import forces_in_order, seeing_forces
from cutjoint.model.records import GROUND, Body, Force, Joint, LawForce, Model, Output, Scene, Vector
from cutjoint.program.blocks import BindingTime, Block
from cutjoint.program.differentiate import Differentiator

_At: TypeAlias = tuple[str, Vector]
_ORIGIN: _At = (GROUND, (sympy.Integer(0), sympy.Integer(0), sympy.Integer(0)))
_PAIRS = ((2, 1), (0, 2), (1, 0))


@dataclass(frozen=True, kw_only=True)
class Tangent:
    """Minus the derivative of an element's force on the form ``rows`` by position (``stiffness``) and rate (``damping``) of ``columns``."""

    rows: Form
    columns: Form
    stiffness: Block
    damping: Block


@dataclass(frozen=True, kw_only=True)
class Action:
    """A generalised force on the displacement of a form of one body."""

    body: str
    form: Form
    force: Block


@dataclass(kw_only=True)
class Element:
    """A force element: its actions on forms, its reported quantities, and the forms ``by`` whose motion it depends on. These are in the
    order of their first use, each by its body and its value. A law that ``sees`` other bodies may depend on any coordinate."""

    name: str
    sees: bool = False
    actions: list[Action] = field(default_factory=list)
    by: dict[tuple[str, Block], tuple[Form, Motion]] = field(default_factory=dict)
    quantities: Mapping[str, Block] = field(default_factory=dict)

    def tangents(self, motions: NodeMotions) -> Iterator[Tangent]:
        """The element's tangents, without blocks that are zero."""
        b = motions.builder
        seen = [({node: 1}, motions.node(node)) for node in motions.layout.coordinates] if self.sees else []
        displacements = [*self.by.values(), *seen]
        leaves = {block for _, m in displacements for block in (m.x, m.v) if block.binding is BindingTime.ITERATION} | motions.states
        differentiator = Differentiator(b, leaves)
        by = {motion.x: (form, motion) for form, motion in reversed(displacements)}.values()
        for action in self.actions:
            jacobian = differentiator.jacobian(action.force)
            for columns, motion in by:
                if motion.x in jacobian or motion.v in jacobian:
                    zero = b.zero(action.force.shape[0], motion.x.shape[0])
                    stiffness, damping = (b.neg(jacobian.get(leaf, zero)) for leaf in (motion.x, motion.v))
                    yield Tangent(rows=action.form, columns=columns, stiffness=stiffness, damping=damping)


class ForceMaker:
    """Derives the force elements of a scene; ``quantities`` are those of forces by their names, of those derived so far."""

    def __init__(self, motions: NodeMotions, model: Model, scene: Scene, outputs: tuple[Output, ...]) -> None:
        self._b = motions.builder
        self._m = motions
        self._model = model
        self._scene = scene
        self._outputs = outputs
        self.quantities: dict[str, Mapping[str, Block]] = {}

    def all(self) -> list[Element]:
        """The force elements that the scene has switched on, each after those whose quantities its law reads."""
        elements, seeing = list[Element](), seeing_forces(self._model)
        let_laws_read(self._m, self._model, self.quantities)
        for force, names in measured_forces(self._model, self._scene, self._outputs):
            values = force.interaction.values(force, self._mechanics(force, Element(name=force.name)))
            self.quantities[force.name] = {name: block for name, block in values.items() if name in names}
        for force in forces_in_order(self._model):
            if is_active(force, self._scene):
                how, element = force.interaction, Element(name=force.name, sees=force.name in seeing)
                with self._b.section("force", force.name, how.equation_of_points or how.equation, force.span.place):
                    element.quantities = self.quantities[force.name] = how.act(force, self._mechanics(force, element))
                    elements.append(self._labelled(element))
        return elements

    def _mechanics(self, force: Force, element: Element) -> "NodalMechanics":
        return NodalMechanics(
            b=self._b, translator=self._m.translator, motions=self._m, model=self._model, force=force, element=element,
            road=self._scene.road.parts,
        )

    def guarded(self) -> tuple[list[Element], dict[str, Block]]:
        """The guarded forces, as elements that only report the positions of their parts, and their smallest margins."""
        elements, margins = [], {}
        for guard in forces_guarded(self._model, self._scene):
            force, name = guard.force, guard.force.name
            with self._b.section("guard", name, "the law is zero while the margin is not negative", force.span.place):
                mechanics = self._mechanics(force, Element(name=name))
                values = force.interaction.values(force, mechanics)
                if isinstance(force, LawForce):
                    elements.append(self._labelled(Element(name=name, quantities=reported_variables(force, values))))
                margins[name] = self._b.label(smallest_margin(mechanics, guard, values), f"margin_{name.replace('.', '_')}")
        return elements, margins

    def _labelled(self, element: Element) -> Element:
        """The element, each of its quantities under its name."""
        for quantity, block in element.quantities.items():
            self._b.label(block, f"{quantity}_{element.name.replace('.', '_')}")
        return element

    def weight(self, body: Body) -> tuple[Form, Block]:
        """The weight of a body at its centre of mass."""
        force = self._b.scale(self._m.translator.scalar(body.mass), self._m.vector(self._model.gravity))
        return self._m.layout.point(body.name, body.centre_of_mass), force


@dataclass(frozen=True, kw_only=True)
class NodalMechanics(Laws):
    """The mechanics of a force on forms of points and directions: ``element`` gets its actions, and the forms that it uses."""

    motions: NodeMotions
    model: Model
    force: Force
    element: Element

    def _of(self, body: str, form: Form) -> tuple[Form, Motion]:
        """A form of a body on whose motion the force depends, and that motion."""
        motion = self.motions.of(form)
        return self.element.by.setdefault((body, motion.x), (form, motion))

    def _act(self, body: str, form: Form, force: Block) -> None:
        self.element.actions.append(Action(body=body, form=form, force=force))

    def _at(self, place: Place) -> _At:
        return place.body(self.force), place.of(self.force)

    def _body(self, carrier: Carrier) -> str:
        return str(getattr(self.force, carrier))

    def _displacement(self, start: _At, end: _At) -> tuple[Form, Motion]:
        point = self.motions.layout.point
        return self._of(end[0], difference(point(*end), point(*start)))

    def _directions(self, body: str, direction: Axis | Frame) -> list[tuple[Form, Motion]]:
        """A body-fixed direction, or the axes of a body-fixed frame."""
        axes = direction.of(self.force)
        return [self._direction(body, axis) for axis in (axes if isinstance(direction, Frame) else (axes,))]

    def _direction(self, body: str, axis: Vector) -> tuple[Form, Motion]:
        return self._of(body, self.motions.layout.direction(body, axis))

    def _axes(self, body: str) -> list[tuple[Form, Motion]]:
        return [self._direction(body, axis) for axis in GLOBAL_AXES]

    def point(self, at: Point) -> Motion:
        """The place of a point, and its velocity; axes that the force counts along are made before."""
        for axis in GLOBAL_AXES if self.force.has_frame else ():
            self.motions.direction(at.body(self.force), axis)
        return self._displacement(_ORIGIN, self._at(at))[1]

    def displacement(self, start: Point, end: Point) -> Motion:
        return self._displacement(self._at(start), self._at(end))[1]

    def direction(self, axis: Axis) -> Motion:
        return self._direction(*self._at(axis))[1]

    def spin(self, carrier: Carrier) -> Block:
        """The angular velocity of a body, by its directions."""
        x, y, z = (form for form, _ in self._axes(self._body(carrier)))
        return self.motions.spin(self._body(carrier), (x, y, z))

    def spin_and_relative_rate(self, carrier: Carrier) -> tuple[Block, Block]:
        """The angular velocity of the wheel, which has no rate relative to it."""
        return self.spin(carrier), self.b.zero(1)

    def in_body(self, carrier: Carrier, vector: Block) -> Block:
        """The products e_i . v."""
        return self.b.column([self.b.dot(e.x, vector) for _, e in self._axes(self._body(carrier))])

    def from_body(self, carrier: Carrier, components: Block) -> Block:
        """The sum of v_i e_i."""
        return self._sum(components, self._axes(self._body(carrier)))

    def _sum(self, components: Block, directions: Sequence[tuple[Form, Motion]]) -> Block:
        return self.b.total([self.b.scale(self.b.element(components, i), e.x) for i, (_, e) in enumerate(directions)])

    def along(self, start: Point, end: Point, direction: Axis | Frame) -> Lazy:
        """The displacement along directions, and its rate."""
        displacement = self.displacement(start, end)
        return self._along(displacement, self._directions(start.body(self.force), direction))

    def _along(self, displacement: Motion, directions: Sequence[tuple[Form, Motion]]) -> Lazy:
        b, E = self.b, [e for _, e in directions]
        return Lazy(
            place=lambda: b.column([b.dot(e.x, displacement.x) for e in E]),
            rate=lambda: b.column([b.add(b.dot(e.x, displacement.v), b.dot(e.v, displacement.x)) for e in E]),
        )

    def rotation(self, frame: Frame) -> LazyRotation:
        """Half the differences of S = E^T G, and their rates."""
        b, (base, follower) = self.b, frame.bodies(self.force)
        E, G = (self._directions(body, frame) for body in (base, follower))
        S = [[b.dot(e.x, g.x) for _, g in G] for _, e in E]
        Sd = [[b.add(b.dot(e.x, g.v), b.dot(e.v, g.x)) for _, g in G] for _, e in E]
        x, v = (b.column([b.mul(b.number(0.5), b.sub(T[i][j], T[j][i])) for i, j in _PAIRS]) for T in (S, Sd))

        def by_rotation() -> Block:
            trace = b.total([S[i][i] for i in range(3)])
            return b.scale(b.number(0.5), b.sub(b.scale(trace, b.identity(3)), b.stack(S)))

        return LazyRotation(place=lambda: x, rate=lambda: v, jacobian=by_rotation, rows=lambda: S)

    def apply_force_pair(self, start: Point, end: Point, force: Block) -> None:
        """A force on the end, its reaction on the start."""
        self._force_pair(self._at(start), self._at(end), force)

    def _force_pair(self, start: _At, end: _At, force: Block) -> None:
        layout = self.motions.layout
        self._act(end[0], layout.point(*end), force)
        self._act(start[0], layout.point(*start), self.b.neg(force))

    def apply_force_along(self, start: Point, end: Point, direction: Axis | Frame, force: Block) -> None:
        """A force on both points, and on the directions."""
        first, last, directions = self._at(start), self._at(end), self._directions(start.body(self.force), direction)
        if isinstance(direction, Axis):
            self._push_on_axis(first, last, directions[0], force)
            return
        b, (_, displacement) = self.b, self._displacement(first, last)
        self._force_pair(first, last, self._sum(force, directions))
        for i, (form, _) in enumerate(directions):
            self._act(first[0], form, b.scale(b.element(force, i), displacement.x))

    def _push_on_axis(self, start: _At, end: _At, axis: tuple[Form, Motion], force: Block) -> None:
        (form, e), (_, displacement) = axis, self._displacement(start, end)
        turn = self.b.scale(force, displacement.x)
        self._force_pair(start, end, self.b.scale(force, e.x))
        self._act(start[0], form, turn)

    def apply_force(self, at: Point, force: Block) -> None:
        self._act(at.body(self.force), self._displacement(_ORIGIN, self._at(at))[0], force)

    def apply_force_at_offset(self, at: Point, arm: Block, force: Block, moment: Block) -> None:
        """A force on the point, and the torque of its offset and of the moment."""
        self.apply_force(at, force)
        self.apply_torque(at.carrier, self.b.add(self.b.cross(arm, force), moment))

    def apply_torque(self, carrier: Carrier, torque: Block) -> None:
        """Half of T x e_i on each direction."""
        b, body = self.b, self._body(carrier)
        axes, half = self._axes(body), b.scale(b.number(0.5), torque)
        for form, e in axes:
            self._act(body, form, b.cross(half, e.x))

    def apply_frame_torque(self, frame: Frame, torque: Block) -> None:
        """The force on half the differences of S, by both bodies' directions."""
        b, (base, follower) = self.b, frame.bodies(self.force)
        E, G = (self._directions(body, frame) for body in (base, follower))
        for k, (i, j) in enumerate(_PAIRS):
            half = b.mul(b.number(0.5), b.element(torque, k))
            for works, m, n in ((half, i, j), (b.neg(half), j, i)):
                self._act(base, E[m][0], b.scale(works, G[n][1].x))
                self._act(follower, G[n][0], b.scale(works, E[m][1].x))

    # A joint's coordinate

    @property
    def _joint(self) -> Joint:
        return next(joint for joint in self.model.joints if joint.name == self.force.joint_of)

    @property
    def _is_angle(self) -> bool:
        return self.force.coordinate_of in self._joint.element.measures

    def _slide(self) -> tuple[_At, _At, tuple[Form, Motion]]:
        joint = self._joint
        base, follower = self.motions.layout.slide_ends(joint)
        start, end = (base, joint.at), (follower, joint.at)
        self._displacement(start, end)
        return start, end, self._direction(base, slide_axis(joint, self.force.coordinate_of))

    def _angle(self) -> tuple[Form, Motion]:
        return self._of(self._joint.follower, {self.motions.layout.angles[self._joint.name, self.force.coordinate_of]: 1})

    def coordinate(self) -> dict[str, Block]:
        """The coordinate of a guide, an angle's node, or a displacement."""
        if self._joint.guide is not None:
            return self._guided(self._joint)
        if self._is_angle:
            motion = self._angle()[1]
            return {"position": motion.x, "rate": motion.v}
        start, end, direction = self._slide()
        travel = self._along(self._displacement(start, end)[1], [direction])
        return {"position": travel.x, "rate": travel.v}

    def _guided(self, joint: Joint) -> dict[str, Block]:
        assert joint.guide is not None
        guide = joint.guide[joint.element.coordinates.index(self.force.coordinate_of)]
        position, rate, _ = (self.translator.scalar(e) for e in guide_rates(guide, self.model))
        return {"position": position, "rate": self.in_motion(rate)}

    def apply_joint_force(self, force: Block) -> None:
        """A force on an angle's node or along a displacement; it does not move a guided joint."""
        if self._joint.guide is not None:
            return
        if self._is_angle:
            self._act(self._joint.follower, self._angle()[0], force)
        else:
            self._push_on_axis(*self._slide(), force)

    def apply_joint_friction(self, law: Block) -> None:
        """Natural coordinates do not have the loads of joints. Raises ModelError: always."""
        raise refuse_friction(
            self.model, (self.force.name,), "equations of this kind do not support load-dependent friction",
            "use --method recursive or recursive-newton, or switch the force off in the scene: switches: {name: off}",
        )  # fmt: skip
