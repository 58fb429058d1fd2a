"""Joint reactions in natural coordinates.

A joint with equations on the way between its points pulls with -(dPhi/dway)^T lambda, and pushes with the forces on its displacements.
The force of one that only shares a point is found from one of its bodies (`free_bodies.py`): by the multipliers that hold the body to the
point, or by M qdd + Phi_q^T lambda - Q of all that moves with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cutjoint.formulate.natural.constraints import Constraint, multipliers
from cutjoint.formulate.natural.forces import Element
from cutjoint.formulate.natural.free_bodies import FreeBody, find_free_body, require_force, share, slide_forces
from cutjoint.formulate.natural.mass import mass_matrix
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Use, is_nought
from cutjoint.model.records import Joint, Model, Reaction, Scalar
from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class ReactionMaker:
    """Knows what pulls at a joint."""

    motions: NodeMotions
    model: Model
    constraints: Sequence[Constraint]
    elements: Mapping[str, Element]

    def pull(self, reaction: Reaction, quantity: str) -> Block:
        """The force (3, 1) of a reaction's joint on its follower.

        Raises:
            ModelError: natural coordinates do not determine it, or the quantity is one of a moment.
        """
        b = self.motions.builder
        joint = next(j for j in self.model.joints if j.name == reaction.joint)
        require_force(self.model, reaction, joint, quantity)
        pulled = [self._pulled(c, c.by_way) for c in self.constraints if c.element == joint.name and c.by_way is not None]
        if pulled:
            return b.sub(self._pushed(joint), b.total(pulled))
        free_body = find_free_body(self.motions.layout, self.model, reaction, joint)
        force = self._holding(free_body) if free_body.held else self._moved(free_body)
        return force if free_body.sign > 0 else b.neg(force)

    def _pushed(self, joint: Joint) -> Block:
        """The sum of the forces on the joint's displacements, as they act on the follower, (3, 1)."""
        b, total = self.motions.builder, self.motions.builder.zero(3)
        for force, sign in slide_forces(self.motions.layout, self.model, joint):
            if force.name in self.elements:
                push = self.elements[force.name].actions[0].force
                total = b.add(total, push if sign > 0 else b.neg(push))
        return total

    def _pulled(self, constraint: Constraint, gradient: Block) -> Block:
        b = self.motions.builder
        return b.mul(b.transpose(gradient), multipliers(b, constraint))

    def _holding(self, free_body: FreeBody) -> Block:
        """The multipliers of a node less the group's own combination."""
        rows = [
            self._pulled(c, gradient) for c in self.constraints if c.element == free_body.group
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
                    terms += self._weighted(share((use,), free_body), self._pulled(c, gradient))
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
        return [] if is_nought(part) else [self.motions.times(part, block)]
