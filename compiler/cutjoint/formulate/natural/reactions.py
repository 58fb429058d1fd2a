"""Joint reactions in natural coordinates.

A joint with equations on the way between its points pulls with -(dPhi/dway)^T lambda.  One that only shares a point is told by one of its
bodies: by the multipliers that hold it to the point, or by M qdd + Phi_q^T lambda - Q of all that moves with it, see `parting.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cutjoint.formulate.natural.constraints import Constraint, multipliers
from cutjoint.formulate.natural.forces import Element
from cutjoint.formulate.natural.mass import mass_matrix
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Use, is_nought
from cutjoint.formulate.natural.parting import Bearer, find_bearer, share
from cutjoint.model.records import Model, Reaction, Scalar
from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class ReactionMaker:
    """Knows what pulls at a joint."""

    motions: NodeMotions
    model: Model
    constraints: Sequence[Constraint]
    elements: Mapping[str, Element]

    def pull(self, reaction: Reaction) -> Block:
        """The force (3, 1) of a reaction's joint on its follower.

        Raises:
            ModelError: natural coordinates do not tell it.
        """
        b = self.motions.builder
        joint = next(j for j in self.model.joints if j.name == reaction.joint)
        own = [self._pulled(c, c.by_way) for c in self.constraints if c.element == joint.name and c.by_way is not None]
        if own:
            return b.neg(b.total(own))
        bearer = find_bearer(self.motions.layout, self.model, reaction, joint)
        force = self._holding(bearer) if bearer.held else self._moved(bearer)
        return force if bearer.sign > 0 else b.neg(force)

    def _pulled(self, constraint: Constraint, gradient: Block) -> Block:
        b = self.motions.builder
        return b.mul(b.transpose(gradient), multipliers(b, constraint))

    def _holding(self, bearer: Bearer) -> Block:
        """The multipliers of a node less the group's own combination."""
        rows = [
            self._pulled(c, gradient) for c in self.constraints if c.element == bearer.group
            for use, gradient in c.by_use if use.form == {bearer.node: 1} and use.sign > 0 and gradient.shape[1] == 3
        ]  # fmt: skip
        return self.motions.builder.total(rows) if rows else self.motions.builder.zero(3)

    def _moved(self, bearer: Bearer) -> Block:
        """M qdd + Phi_q^T lambda - Q in the displacement of a node that its group moves alone."""
        m, b = self.motions, self.motions.builder
        terms = self._inertia(bearer)
        for c in self.constraints:
            for use, gradient in c.by_use:
                if gradient.shape[1] == 3:
                    terms += self._weighted(share((use,), bearer), self._pulled(c, gradient))
        for body in self.model.bodies:
            if body.mass != 0:
                weight = b.scale(m.translator.scalar(body.mass), m.vector(self.model.gravity))
                centre = m.layout.use(body.name, m.layout.point(body.name, body.centre_of_mass))
                terms += self._weighted(share((centre,), bearer), b.neg(weight))
        for element in self.elements.values():
            for action in element.actions:
                if action.force.shape == (3, 1):
                    terms += self._weighted(share((m.layout.use(action.body, action.form),), bearer), b.neg(action.force))
        return b.total(terms) if terms else b.zero(3)

    def _inertia(self, bearer: Bearer) -> list[Block]:
        m, terms = self.motions, []
        bodies = {body.name: body for body in self.model.bodies}
        for group in m.layout.groups.values():
            for (i, j), mass in mass_matrix(group, [bodies[name] for name in group.bodies]).items():
                terms += self._weighted(share((Use(1, group.name, {i: 1}),), bearer), m.times(mass, m.node(j).a))
        return terms

    def _weighted(self, part: Scalar, block: Block) -> list[Block]:
        return [] if is_nought(part) else [self.motions.times(part, block)]
