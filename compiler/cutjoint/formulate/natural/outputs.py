"""Reported quantities in natural coordinates: those of motion and of forces, and reactions.

A joint without equations of its own only shares a point.  A virtual displacement cuts it: one of its bodies moves the point, the others
stay.  The virtual work of the masses, equations and forces that move with that body gives the joint's force on it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from cutjoint.formulate.natural.assembly import mass_matrix
from cutjoint.formulate.natural.constraints import Constraint, multipliers
from cutjoint.formulate.natural.forces import Element
from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, Use, Uses, is_zero
from cutjoint.formulate.natural.quantities import NaturalQuantities
from cutjoint.formulate.quantities import reading, reported_symbol, rod_force
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.expressions.quantities import reaction_component
from cutjoint.model.records import Force, Joint, Model, Output, Reaction, RodForce, Scalar
from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class FreeBody:
    """The group of bodies on one side of a joint, and the ``node`` at which the joint's force acts on it.
    ``sign`` is 1 for the follower's group and -1 for the base's. If ``is_surplus``, the group has equations that tie a combination of
    its basis to the node; otherwise the node is part of its basis."""

    group: str
    node: Node
    sign: int
    is_surplus: bool


def require_force(model: Model, reaction: Reaction, joint: Joint, quantity: str) -> None:
    """Refuse a quantity of a joint that points and unit vectors do not determine.
    Raises ModelError: a moment, or the force of a joint along whose displacement a gear acts."""
    ends = {end.joint: end.name for gear in model.gears for end in gear.coordinates}
    coordinate = ends.get(joint.name)
    is_moment, _ = reaction_component(reaction, quantity)
    if is_moment or (coordinate is not None and coordinate not in joint.element.measures):
        what = "moments of joints" if is_moment else f"the force of joint '{joint.name}', in which a gear acts"
        raise ModelError([_refusal(reaction, f"natural coordinates do not give {what}")])


def slide_forces(layout: Layout, model: Model, joint: Joint) -> Iterator[tuple[Force, int]]:
    """The forces on displacements of a joint that is not guided, and their signs on the follower."""
    joint_forces = (f for f in model.forces if f.joint_of == joint.name and joint.guide is None)
    for force in joint_forces:
        if force.coordinate_of not in joint.element.measures:
            yield force, 1 if layout.slide_ends(joint)[1] == joint.follower else -1


def _refusal(reaction: Reaction, message: str) -> Problem:
    hint = "use --method recursive or recursive-newton, or leave this output out"
    return Problem(reaction.span, f"reaction '{reaction.name}'", message, hint)


def find_free_body(layout: Layout, model: Model, reaction: Reaction, joint: Joint) -> FreeBody:
    """The free body for the reaction of a joint that only shares a point.
    Raises ModelError: there is none: the body is fixed, or another joint shares the point, or both bodies share a further point."""
    for body, sign in ((joint.follower, 1), (joint.base, -1)) if joint.element.shares_point else ():
        group, node = layout.groups.get(layout.group_of[body]), layout.find(body, NodeKind.POINT, joint.at)
        if group is None or node is None:
            continue
        if node in group.surplus:
            return FreeBody(group=group.name, node=node, sign=sign, is_surplus=True)
        if node in group.basis and _meets_alone(layout, model, joint, node, group.name) and not _is_constrained_twice(layout, node):
            return FreeBody(group=group.name, node=node, sign=sign, is_surplus=False)
    message = f"natural coordinates do not give the force of joint '{joint.name}': {_reason(joint)}"
    raise ModelError([_refusal(reaction, message)])


def _reason(joint: Joint) -> str:
    if joint.element.is_rigid:
        return "it is fixed, so that both bodies are one there"
    return "another joint shares its point, or both bodies share a second point" if joint.element.shares_point else "it constrains no point"


def _meets_alone(layout: Layout, model: Model, joint: Joint, node: Node, group: str) -> bool:
    """Return whether only this joint shares the node with the group."""
    others = (j for j in model.joints if j is not joint and j.element.shares_point)
    bodies = (body for j in others for body in (j.base, j.follower) if layout.find(body, NodeKind.POINT, j.at) is node)
    return all(layout.group_of[body] != group for body in bodies)


def _is_constrained_twice(layout: Layout, node: Node) -> bool:
    """Return whether the carriers of a point share another point: the force along the line between them is then not determined."""
    others = (n for n in layout.nodes if n.kind is NodeKind.POINT and n is not node)
    return any(len(layout.carriers[n] & layout.carriers[node]) > 1 for n in others)


def share(uses: Uses, free_body: FreeBody) -> Scalar:
    """The change of a sum for a unit displacement of the free body's node, all other bodies fixed.
    Nodes that are combinations of the group's basis move with it."""
    return sum((use.sign * _share(use.group, use.form, free_body) for use in uses), 0.0)


def _share(user: str, form: Form, free_body: FreeBody) -> Scalar:
    moved: Scalar = 0.0
    for node, coefficient in form.items():
        if node is free_body.node:
            moved += coefficient if user == free_body.group else 0.0
        elif node.parts is not None:
            moved += coefficient * _share(node.body, node.parts, free_body)
    return moved


@dataclass(frozen=True, kw_only=True)
class ReactionMaker:
    """The reactions of joints."""

    motions: NodeMotions
    model: Model
    constraints: Sequence[Constraint]
    elements: Mapping[str, Element]

    def reaction_force(self, reaction: Reaction, quantity: str) -> Block:
        """The force (3, 1) of a reaction's joint on its follower.
        Raises ModelError: natural coordinates do not determine it, or the quantity is one of a moment."""
        b = self.motions.builder
        joint = next(j for j in self.model.joints if j.name == reaction.joint)
        require_force(self.model, reaction, joint, quantity)
        own = [(c, c.by_displacement) for c in self.constraints if c.element == joint.name]
        forces = [self._constraint_force(c, gradient) for c, gradient in own if gradient is not None]
        if forces:
            return b.sub(self._spring_force(joint), b.total(forces))
        free_body = find_free_body(self.motions.layout, self.model, reaction, joint)
        force = self._holding(free_body) if free_body.is_surplus else self._moved(free_body)
        return force if free_body.sign > 0 else b.neg(force)

    def _spring_force(self, joint: Joint) -> Block:
        """The sum of the forces on the joint's displacements, as they act on the follower, (3, 1)."""
        b, total = self.motions.builder, self.motions.builder.zero(3)
        for force, sign in slide_forces(self.motions.layout, self.model, joint):
            if force.name in self.elements:
                applied = self.elements[force.name].actions[0].force
                total = b.add(total, applied if sign > 0 else b.neg(applied))
        return total

    def _constraint_force(self, constraint: Constraint, gradient: Block) -> Block:
        b = self.motions.builder
        return b.mul(b.transpose(gradient), multipliers(b, constraint))

    def _holding(self, free_body: FreeBody) -> Block:
        """The multipliers of a node less the group's own combination."""
        rows = [
            self._constraint_force(c, gradient) for c in self.constraints if c.element == free_body.group
            for use, gradient in c.by_use if use.form == {free_body.node: 1} and use.sign > 0 and gradient.shape[1] == 3
        ]  # fmt: skip
        return self.motions.builder.total(rows) if rows else self.motions.builder.zero(3)

    def _moved(self, free_body: FreeBody) -> Block:
        """M qdd + Phi_q^T lambda - Q in the displacement of a node that its group moves alone."""
        m, b = self.motions, self.motions.builder
        terms = self._inertia(free_body)
        for c in self.constraints:
            for use, gradient in c.by_use:
                if gradient.shape[1] == 3:
                    terms += self._weighted(share((use,), free_body), self._constraint_force(c, gradient))
        for body in self.model.bodies:
            if body.mass != 0:
                weight = b.scale(m.translator.scalar(body.mass), m.vector(self.model.gravity))
                centre = m.layout.use(body.name, m.layout.point(body.name, body.centre_of_mass))
                terms += self._weighted(share((centre,), free_body), b.neg(weight))
        for element in self.elements.values():
            for action in element.actions:
                if action.force.shape == (3, 1):
                    terms += self._weighted(share((m.layout.use(action.body, action.form),), free_body), b.neg(action.force))
        return b.total(terms) if terms else b.zero(3)

    def _inertia(self, free_body: FreeBody) -> list[Block]:
        m, terms = self.motions, []
        bodies = {body.name: body for body in self.model.bodies}
        for group in m.layout.groups.values():
            for (i, j), mass in mass_matrix(group, [bodies[name] for name in group.bodies]).items():
                terms += self._weighted(share((Use(1, group.name, {i: 1}),), free_body), m.times(mass, m.node(j).a))
        return terms

    def _weighted(self, part: Scalar, block: Block) -> list[Block]:
        return [] if is_zero(part) else [self.motions.times(part, block)]


@dataclass(frozen=True, kw_only=True)
class NaturalReporter(NaturalQuantities):
    """Knows every quantity of a system in natural coordinates."""

    elements: Mapping[str, Element]
    constraints: tuple[Constraint, ...]

    def quantity(self, output: Output) -> Block:
        """The block of one output; zero for the law of a force that the scene has switched off or that a guard stands for.
        Raises ModelError: a reaction that points and vectors alone do not determine."""
        name, b, translator = output.element, self.motions.builder, self.motions.translator
        reaction = next((r for r in self.model.reactions if r.name == name), None)
        if isinstance(reaction, RodForce):
            of = {c.element: c for c in self.constraints}
            return rod_force(b, translator, reaction, lambda rod: multipliers(b, of[rod]))
        if reaction is not None:
            maker = ReactionMaker(motions=self.motions, model=self.model, constraints=self.constraints, elements=self.elements)
            applied, (_, direction) = maker.reaction_force(reaction, output.quantity), reaction_component(reaction, output.quantity)
            return b.dot(self.motions.direction(reaction.body, direction).x, applied)
        if any(gear.name == name for gear in self.model.gears):
            return b.neg(multipliers(b, next(c for c in self.constraints if c.element == name)))
        if (symbol := reported_symbol(self.model, name)) is not None:
            return reading(b, translator, self.model, self.quantity).scalar(symbol)
        return super().quantity(output)
