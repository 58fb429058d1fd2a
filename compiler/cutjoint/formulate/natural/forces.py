"""Applied forces in natural coordinates, each with its tangents by the points and directions that it depends on.

A law over a scalar s(q), such as a length or a displacement along an axis, works on s: Q = law ds/dq.  A torque T on a body with the
perpendicular unit directions e_i works on them as half the sum of (T x e_i) . delta e_i.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import sympy

from cutjoint.elements.force import AxisForce, Compliance, Interaction, LineForce, OnCoordinate, Point, RoadContact, Wrench
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
from cutjoint.formulate.inputs import guide_rates
from cutjoint.formulate.natural.motion import Motion, NodeMotions
from cutjoint.formulate.natural.nodes import Form, difference
from cutjoint.formulate.tyre import Contact, Wheel, tyre_force
from cutjoint.kernels.directions import slide_axis
from cutjoint.model.geometry import GLOBAL_AXES
from cutjoint.model.records import GROUND, Body, BodyLoad, Force, Joint, JointForce, LawForce, Model, Scalar, Scene, Tyre, Vector
from cutjoint.program.blocks import BindingTime, Block
from cutjoint.program.differentiate import Differentiator


@dataclass(frozen=True, kw_only=True)
class Tangent:
    """The fall of an element's force on the form ``rows`` with the position (``stiffness``) and rate (``damping``) of ``columns``."""

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
    """A force element: its actions on forms, the forms ``by`` whose motion it depends on, and its reported quantities."""

    name: str
    actions: list[Action] = field(default_factory=list)
    by: list[tuple[Form, Motion]] = field(default_factory=list)
    quantities: dict[str, Block] = field(default_factory=dict)

    def tangents(self, motions: NodeMotions) -> Iterator[Tangent]:
        """The element's tangents, without blocks that are zero."""
        b = motions.builder
        leaves = {block for _, m in self.by for block in (m.x, m.v) if block.binding is BindingTime.ITERATION} | motions.states
        differentiator = Differentiator(b, leaves)
        by = {motion.x: (form, motion) for form, motion in reversed(self.by)}.values()
        for action in self.actions:
            jacobian = differentiator.jacobian(action.force)
            for columns, motion in by:
                if motion.x in jacobian or motion.v in jacobian:
                    zero = b.zero(action.force.shape[0], motion.x.shape[0])
                    stiffness, damping = (b.neg(jacobian.get(leaf, zero)) for leaf in (motion.x, motion.v))
                    yield Tangent(rows=action.form, columns=columns, stiffness=stiffness, damping=damping)


class ForceMaker:
    """Derives the force elements of a scene."""

    def __init__(self, motions: NodeMotions, model: Model, scene: Scene) -> None:
        self._b = motions.builder
        self._m = motions
        self._model = model
        self._scene = scene
        self._joints: Mapping[str, Joint] = {j.name: j for j in model.joints}

    def all(self) -> list[Element]:
        """The force elements that the scene has switched on."""
        rules: Mapping[type[Interaction], Callable[..., Element]] = {
            LineForce: self._stretch, AxisForce: self._travel_force, Compliance: self._compliance, Wrench: self._load,
            OnCoordinate: self._on_coordinate, RoadContact: self._contact,
        }  # fmt: skip
        elements = []
        for force in self._model.forces:
            if is_active(force, self._scene):
                how = force.interaction
                with self._b.section("force", force.name, _EQUATIONS[type(how)], force.span.place):
                    elements.append(self._labelled(rules[type(how)](force, how)))
        return elements

    def guarded(self) -> tuple[list[Element], dict[str, Block]]:
        """The forces that guards stand for, as elements that only report where their parts are; and their smallest margins."""
        elements, margins = [], {}
        for guard in guards_of(self._model, self._scene):
            name = guard.force.name
            with self._b.section("guard", name, "the law is zero while the margin is not negative", guard.force.span.place):
                values = self._law_values(guard.force)
                if isinstance(guard.force, LawForce):
                    elements.append(self._labelled(Element(name=name, quantities=reported_variables(values))))
                margin = smallest_margin(self._b, self._m.translator, guard, values)
                margins[name] = self._b.label(margin, f"margin_{name.replace('.', '_')}")
        return elements, margins

    def _labelled(self, element: Element) -> Element:
        """The element, each of its quantities under its name."""
        for quantity, block in element.quantities.items():
            self._b.label(block, f"{quantity}_{element.name.replace('.', '_')}")
        return element

    def _law_values(self, force: Any) -> dict[Scalar, Block]:
        """The variables of a force's law: the position that it depends on, and its rate; a tyre's lateral force."""
        match force.interaction:
            case LineForce() as how:
                _, way = self._way(_place(how.end, force), _place(how.start, force))
                return stretch(self._b, way.x, way.v)[1]
            case AxisForce() as how:
                return self._travel(*_axial(force, how), TRAVEL)
            case OnCoordinate():
                return self._coordinate(force)
            case Wrench():
                return self._load_values(force, *self._load_forms(force))
            case RoadContact():
                return {SIDE: self._contact_with_road(force)[2].quantities["Fy"]}
        raise AssertionError(force)

    def weight(self, body: Body) -> tuple[Form, Block]:
        """The weight of a body at its centre of mass."""
        pull = self._b.scale(self._m.translator.scalar(body.mass), self._m.vector(self._model.gravity))
        return self._m.layout.point(body.name, body.centre_of_mass), pull

    def _way(self, end: _Place, start: _Place) -> tuple[Form, Motion]:
        layout = self._m.layout
        form = difference(layout.point(*end), layout.point(*start))
        return form, self._m.of(form)

    def _pair(self, end: _Place, start: _Place, pull: Block) -> list[Action]:
        """A force on one point and its reaction on another."""
        layout = self._m.layout
        return [
            Action(body=end[0], form=layout.point(*end), force=pull),
            Action(body=start[0], form=layout.point(*start), force=self._b.neg(pull)),
        ]

    def _direction(self, body: str, axis: Vector) -> tuple[Form, Motion]:
        form = self._m.layout.direction(body, axis)
        return form, self._m.of(form)

    def _stretch(self, force: LawForce, how: LineForce) -> Element:
        end, start = _place(how.end, force), _place(how.start, force)
        form, way = self._way(end, start)
        pull, quantities = line_force(self._b, self._m.translator, force.law, way.x, way.v)
        return Element(name=force.name, actions=self._pair(end, start, pull), by=[(form, way)], quantities=quantities)

    def _along(self, name: str, end: _Place, start: _Place, axis: Vector, law: Scalar, position: Scalar) -> Element:
        """A law over the way between two points along an axis of the second's body."""
        b, (form, way), (direction, e) = self._b, self._way(end, start), self._direction(start[0], axis)
        values = self._travel(end, start, axis, position)
        by_law = law_of(self._m.translator, law, values, position)
        turn = Action(body=start[0], form=direction, force=b.scale(by_law["force"], way.x))
        actions = [*self._pair(end, start, b.scale(by_law["force"], e.x)), turn]
        return Element(name=name, actions=actions, by=[(form, way), (direction, e)], quantities={**by_law, **reported_variables(values)})

    def _travel(self, end: _Place, start: _Place, axis: Vector, position: Scalar) -> dict[Scalar, Block]:
        """The component of the way between two points along an axis of the second's body, as ``position``, and its rate."""
        b, (_, way), (_, e) = self._b, self._way(end, start), self._direction(start[0], axis)
        return {position: b.dot(e.x, way.x), RATE: b.add(b.dot(e.x, way.v), b.dot(e.v, way.x))}

    def _travel_force(self, force: LawForce, how: AxisForce) -> Element:
        return self._along(force.name, *_axial(force, how), force.law, TRAVEL)

    def _slide(self, joint: Joint, coordinate: str) -> tuple[_Place, _Place, Vector]:
        base, follower = self._m.layout.slide_ends(joint)
        return (follower, joint.at), (base, joint.at), slide_axis(joint, coordinate)

    def _is_angle(self, force: JointForce) -> bool:
        return force.coordinate in self._joints[force.joint].element.measures

    def _coordinate(self, force: JointForce) -> dict[Scalar, Block]:
        """A joint's coordinate and its rate."""
        joint = self._joints[force.joint]
        if joint.guide is not None:
            return self._guided(force, joint)
        if not self._is_angle(force):
            return self._travel(*self._slide(joint, force.coordinate), POSITION)
        motion = self._m.node(self._m.layout.angles[joint.name, force.coordinate])
        return {POSITION: motion.x, RATE: motion.v}

    def _on_coordinate(self, force: JointForce, how: OnCoordinate) -> Element:
        joint = self._joints[force.joint]
        if joint.guide is None and not self._is_angle(force):
            return self._along(force.name, *self._slide(joint, force.coordinate), force.law, POSITION)
        values = law_of(self._m.translator, force.law, self._coordinate(force), POSITION)
        if joint.guide is not None:  # a force does not move a guided joint
            return Element(name=force.name, quantities=values)
        node = self._m.layout.angles[joint.name, force.coordinate]
        action = Action(body=joint.follower, form={node: 1}, force=values["force"])
        return Element(name=force.name, actions=[action], by=[({node: 1}, self._m.node(node))], quantities=values)

    def _guided(self, force: JointForce, joint: Joint) -> dict[Scalar, Block]:
        """The coordinate on the guide's course."""
        assert joint.guide is not None
        guide = joint.guide[joint.element.coordinates.index(force.coordinate)]
        motion = self._b.symbol("motion", 1, BindingTime.STEP)
        position, rate, _ = (self._m.translator.scalar(e) for e in guide_rates(guide, self._model))
        return {POSITION: position, RATE: self._b.mul(motion, rate)}

    def _compliance(self, force: Force, how: Compliance) -> Element:
        b, end, start = self._b, _place(how.follower, force), _place(how.base, force)
        way = self._way(end, start)
        E, G = ([self._direction(body, axis) for axis in how.frame.of(force)] for body, _ in (start, end))
        S = [[b.dot(e.x, g.x) for _, g in G] for _, e in E]
        Sd = [[b.add(b.dot(e.x, g.v), b.dot(e.v, g.x)) for _, g in G] for _, e in E]
        turns, turn_rates = (b.column([self._half_difference(T, i, j) for i, j in _PAIRS]) for T in (S, Sd))
        places = (b.column([b.dot(e.x, way[1].x) for _, e in E]), turns)
        rates = (b.column([b.add(b.dot(e.x, way[1].v), b.dot(e.v, way[1].x)) for _, e in E]), turn_rates)
        trace = b.total([S[i][i] for i in range(3)])
        by_turn = b.scale(b.number(0.5), b.sub(b.scale(trace, b.identity(3)), b.stack(S)))
        pull, _, quantities = six_laws(b, self._m.translator, force.expressions, places, rates, by_turn)
        laws = six_laws(b, self._m.translator, force.expressions, places, rates, b.identity(3))[1]
        along = b.total([b.scale(b.element(pull, i), e.x) for i, (_, e) in enumerate(E)])
        actions = self._pair(end, start, along)
        actions += [Action(body=start[0], form=e, force=b.scale(b.element(pull, i), way[1].x)) for i, (e, _) in enumerate(E)]
        for k, (i, j) in enumerate(_PAIRS):
            half = b.mul(b.number(0.5), b.element(laws, k))
            for works, m, n in ((half, i, j), (b.neg(half), j, i)):
                actions.append(Action(body=start[0], form=E[m][0], force=b.scale(works, G[n][1].x)))
                actions.append(Action(body=end[0], form=G[n][0], force=b.scale(works, E[m][1].x)))
        return Element(name=force.name, actions=actions, by=[way, *E, *G], quantities=quantities)

    def _half_difference(self, S: list[list[Block]], i: int, j: int) -> Block:
        return self._b.mul(self._b.number(0.5), self._b.sub(S[i][j], S[j][i]))

    def _axes(self, body: str) -> list[tuple[Form, Motion]]:
        return [self._direction(body, axis) for axis in GLOBAL_AXES]

    def _torque(self, body: str, torque: Block) -> list[Action]:
        b = self._b
        half = b.scale(b.number(0.5), torque)
        return [Action(body=body, form=form, force=b.cross(half, e.x)) for form, e in self._axes(body)]

    def _load_forms(self, force: BodyLoad) -> tuple[tuple[Form, Motion] | None, list[tuple[Form, Motion]]]:
        """The load's point, and its body's axes where it needs them."""
        axes = self._axes(force.body) if force.needs_attitude else []
        return self._way((force.body, force.point), (GROUND, _ORIGIN)) if force.point is not None else None, axes

    def _load(self, force: BodyLoad, how: Wrench) -> Element:
        b = self._b
        at, axes = self._load_forms(force)
        translator = self._m.translator.with_values(self._load_values(force, at, axes))
        components = b.column([translator.scalar(c) for c in force.components])
        if force.moving_only:
            components = b.scale(b.symbol("motion", 1, BindingTime.STEP), components)
        vector = b.total([b.scale(b.element(components, i), e.x) for i, (_, e) in enumerate(axes)]) if force.in_body else components
        actions = [Action(body=force.body, form=at[0], force=vector)] if at else self._torque(force.body, vector)
        quantities = {name: b.element(components, i) for i, name in enumerate(force.quantities)}
        return Element(name=force.name, actions=actions, by=[*([at] if at else []), *axes], quantities=quantities)

    def _load_values(
        self, force: BodyLoad, at: tuple[Form, Motion] | None, axes: list[tuple[Form, Motion]]
    ) -> dict[Scalar, Block]:  # fmt: skip
        """The variables of the load's components: place and velocity of its point, or the angular velocity of its body."""
        b = self._b
        values: dict[Any, Block] = {}
        if at is not None:
            place = at[1]
            speed = b.column([b.dot(e.x, place.v) for _, e in axes]) if force.in_body else place.v
            values |= {PLACE[i]: b.element(place.x, i) for i in range(3)} | {PLACE[3 + i]: b.element(speed, i) for i in range(3)}
        else:
            forms = [form for form, _ in axes]
            spin = self._m.spin(force.body, (forms[0], forms[1], forms[2]))
            if force.in_body:
                spin = b.column([b.dot(e.x, spin) for _, e in axes])
            values |= {PLACE[6 + i]: b.element(spin, i) for i in range(3)}
        return values

    def _contact_with_road(self, force: Tyre) -> tuple[tuple[Form, Motion], tuple[Form, Motion], Contact]:
        """The wheel's centre and axis, and its contact with the road."""
        b = self._b
        centre, axis = self._way((force.body, force.centre), (GROUND, _ORIGIN)), self._direction(force.body, force.axis)
        wheel = Wheel(centre=centre[1].x, velocity=centre[1].v, axis=axis[1].x, axis_rate=axis[1].v)
        return centre, axis, tyre_force(b, self._m.translator, force, wheel)

    def _contact(self, force: Tyre, how: RoadContact) -> Element:
        b, (centre, axis, contact) = self._b, self._contact_with_road(force)
        torque = b.add(b.cross(contact.arm, contact.force), contact.moment)
        axes = self._axes(force.body)
        by = [centre, axis, *((f, m) for f, m in axes if m.x is not axis[1].x)]
        push = Action(body=force.body, form=centre[0], force=contact.force)
        return Element(name=force.name, actions=[push, *self._torque(force.body, torque)], by=by, quantities=contact.quantities)


_Place: TypeAlias = tuple[str, Vector]


def _place(point: Point, force: Force) -> _Place:
    return point.body(force), point.of(force)


def _axial(force: Force, how: AxisForce) -> tuple[_Place, _Place, Vector]:
    return _place(how.point, force), _place(how.origin, force), how.axis.of(force)


_ORIGIN: Vector = (sympy.Integer(0), sympy.Integer(0), sympy.Integer(0))
_PAIRS = ((2, 1), (0, 2), (1, 0))

_EQUATIONS: Mapping[type[Interaction], str] = {
    LineForce: "n = (p_end - p_start)/length,  Q = -law(length, rate) n on the way between the points",
    AxisForce: "travel = e . (p - p_origin),  Q = law(travel, rate) d travel/d q",
    Compliance: "x = E^T (p_f - p_b),  theta = half the sum of e_k x g_k in E,  Q = law d(x, theta)/d q",
    Wrench: "the force given by its components at its point, a torque as half the sum of T x e_i on the directions",
    OnCoordinate: "Q = law(position, rate) of one coordinate",
    RoadContact: "Fz = k (R - dz)/sqrt(1 + slope^2);  Fy, Mz by the Calspan model",
}
