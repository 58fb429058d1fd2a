"""Joint reactions in natural coordinates.

A joint with equations on the way between its points pulls with -(dPhi/dway)^T lambda; one that a body holds to a node which its basis
does not have, with the multipliers of that.  A joint that only shares a point is parted in thought: where one of its bodies alone moves the
point, the work of all masses, equations and forces that move along is the joint's force on that body, M qdd + Phi_q^T lambda - Q of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cutjoint.formulate.natural.constraints import Constraint, multipliers
from cutjoint.formulate.natural.forces import Element
from cutjoint.formulate.natural.layout import Group
from cutjoint.formulate.natural.mass import mass_matrix
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, is_nought
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Joint, JointKind, Model, Reaction, Scalar
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
            ModelError: several joints share the point, or the bodies are one.
        """
        joint = next(j for j in self.model.joints if j.name == reaction.joint)
        own = [c for c in self.constraints if c.element == joint.name and c.by_way is not None]
        if own:
            return self._total([self._pulled(c, c.by_way, -1) for c in own if c.by_way is not None])
        if joint.kind is not JointKind.FIXED:
            for body, sign in ((joint.follower, 1), (joint.base, -1)):
                pull = self._on(body, joint, sign)
                if pull is not None:
                    return pull
        problem = Problem(
            span=reaction.span, element=f"reaction '{reaction.name}'",
            message=f"natural coordinates do not tell the force of joint '{joint.name}': it is fixed, or another joint shares its point",
            hint="use --method recursive, or leave this output out",
        )  # fmt: skip
        raise ModelError([problem])

    def _on(self, body: str, joint: Joint, sign: int) -> Block | None:
        """The joint's force on one of its bodies times a sign; None where that body does not tell it."""
        layout, b = self.motions.layout, self.motions.builder
        group = layout.groups.get(layout.group_of[body])
        node = layout.find(body, NodeKind.POINT, joint.at)
        if group is None or node is None:
            return None
        held = [c for c in self.constraints if c.element == group.name and c.names[0].startswith(f"{node.name}.") and len(c.names) == 3]
        if node in group.surplus and held:
            return self._pulled(held[0], b.identity(3), sign)
        if node not in group.basis or not self._meets_alone(joint, group) or self._is_held_twice(node):
            return None
        force = self._moved(group, node)
        return force if sign > 0 else b.neg(force)

    def _pulled(self, constraint: Constraint, gradient: Block | None, sign: int) -> Block:
        b = self.motions.builder
        assert gradient is not None
        force = b.mul(b.transpose(gradient), multipliers(b, constraint))
        return force if sign > 0 else b.neg(force)

    def _total(self, blocks: Sequence[Block]) -> Block:
        return self.motions.builder.total(blocks) if blocks else self.motions.builder.zero(3)

    def _meets_alone(self, joint: Joint, group: Group) -> bool:
        """Whether no other joint shares the group's node at the joint's point."""
        layout = self.motions.layout
        node = layout.find(group.bodies[0], NodeKind.POINT, joint.at)
        sharing = (JointKind.SPHERICAL, JointKind.REVOLUTE, JointKind.UNIVERSAL)
        others = (j for j in self.model.joints if j is not joint and j.kind in sharing)
        bodies = (body for j in others for body in (j.base, j.follower) if layout.find(body, NodeKind.POINT, j.at) is node)
        return all(layout.group_of[body] != group.name for body in bodies)

    def _is_held_twice(self, node: Node) -> bool:
        """Whether those that carry a point share another one: the force along the line between is then not determined."""
        carriers = self.motions.layout.carriers
        others = (n for n in self.motions.layout.nodes if n.kind is NodeKind.POINT and n is not node)
        return any(len(carriers[n] & carriers[node]) > 1 for n in others)

    def _moved(self, group: Group, node: Node) -> Block:
        """M qdd + Phi_q^T lambda - Q of all that moves with a node of a group's basis when this group alone moves it."""
        m, b, layout = self.motions, self.motions.builder, self.motions.layout
        share = _Share(group.name, node, layout.group_of)
        terms = []
        bodies = {body.name: body for body in self.model.bodies}
        for other in layout.groups.values():
            for (i, j), mass in mass_matrix(other, [bodies[name] for name in other.bodies]).items():
                terms += self._weighted(share.of_node(i, other.name), m.times(mass, m.node(j).a))
        for c in self.constraints:
            for use, gradient in c.by_use:
                if gradient.shape[1] == 3:
                    part = b.mul(b.transpose(gradient), multipliers(b, c))
                    terms += self._weighted(share.of(use.form, use.body), part)
        for body in self.model.bodies:
            if body.mass != 0:
                weight = b.scale(m.translator.scalar(body.mass), m.vector(self.model.gravity))
                terms += self._weighted(share.of(layout.point(body.name, body.centre_of_mass), body.name), b.neg(weight))
        for element in self.elements.values():
            for action in element.actions:
                if action.force.shape == (3, 1):
                    terms += self._weighted(share.of(action.form, action.body), b.neg(action.force))
        return self._total(terms)

    def _weighted(self, share: Scalar, block: Block) -> list[Block]:
        return [] if is_nought(share) else [self.motions.times(share, block)]


@dataclass(frozen=True)
class _Share:
    """How far things move when one group alone moves a node of its basis by one."""

    group: str
    node: Node
    group_of: Mapping[str, str]

    def of(self, form: Form, body: str) -> Scalar:
        """A form as a body has it."""
        return sum((c * self.of_node(node, self.group_of[body]) for node, c in form.items()), 0.0)

    def of_node(self, node: Node, group: str) -> Scalar:
        """A node as a group has it; a combination moves as its own group's nodes do."""
        if node is self.node:
            return 1.0 if group == self.group else 0.0
        if node.parts is None:
            return 0.0
        return self.of(node.parts, node.body)
