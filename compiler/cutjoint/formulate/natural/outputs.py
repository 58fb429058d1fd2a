"""Reported quantities in natural coordinates: those of motion and of forces, and reactions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cutjoint.formulate.natural.assembly import mass_matrix
from cutjoint.formulate.natural.constraints import Constraint, multipliers
from cutjoint.formulate.natural.forces import Element
from cutjoint.formulate.natural.free_bodies import FreeBody, find_free_body, require_force, share, slide_forces
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Use, is_zero
from cutjoint.formulate.natural.quantities import NaturalQuantities
from cutjoint.formulate.quantities import reading, reported_symbol
from cutjoint.model.expressions.quantities import reaction_component
from cutjoint.model.records import Joint, Model, Output, Reaction, RodForce, Scalar
from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class ReactionMaker:
    """The reactions of joints."""

    motions: NodeMotions
    model: Model
    constraints: Sequence[Constraint]
    elements: Mapping[str, Element]

    def reaction_force(self, reaction: Reaction, quantity: str) -> Block:
        """The force (3, 1) of a reaction's joint on its follower.

        Raises:
            ModelError: natural coordinates do not determine it, or the quantity is one of a moment.
        """
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

        Raises:
            ModelError: a reaction that points and vectors alone do not determine.
        """
        name = output.element
        for reaction in self.model.reactions:
            if reaction.name == name:
                return self._rods(reaction) if isinstance(reaction, RodForce) else self._reaction(reaction, output.quantity)
        if any(gear.name == name for gear in self.model.gears):
            return self.motions.builder.neg(multipliers(self.motions.builder, next(c for c in self.constraints if c.element == name)))
        if (symbol := reported_symbol(self.model, name)) is not None:
            return reading(self.motions.builder, self.motions.translator, self.model, self.quantity).scalar(symbol)
        return super().quantity(output)

    def _reaction(self, reaction: Reaction, quantity: str) -> Block:
        maker = ReactionMaker(motions=self.motions, model=self.model, constraints=self.constraints, elements=self.elements)
        reaction_force, (_, direction) = maker.reaction_force(reaction, quantity), reaction_component(reaction, quantity)
        return self.motions.builder.dot(self.motions.direction(reaction.body, direction).x, reaction_force)

    def _rods(self, sensor: RodForce) -> Block:
        """The residual of a distance is in m: its multiplier is the tension."""
        b, of = self.motions.builder, {c.element: c for c in self.constraints}
        forces = [b.scale(self.motions.translator.scalar(weight), multipliers(b, of[rod])) for rod, weight in sensor.weights]
        return b.neg(b.total(forces))
