"""Joint reactions in natural coordinates.

A joint that has equations of its own pulls with -Phi_q^T lambda.  A joint that only shares a point pulls there with what the body's own
inertia, shape and forces ask for there, M qdd + Phi_q^T lambda - Q of the body alone, if no other joint meets the body there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import sympy

from cutjoint.formulate.natural.assembly import NodalForce
from cutjoint.formulate.natural.constraints import Constraint, multipliers
from cutjoint.formulate.natural.forces import Element
from cutjoint.formulate.natural.layout import Group
from cutjoint.formulate.natural.mass import mass_matrix
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, combine
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Joint, Model, Reaction
from cutjoint.program.blocks import Block


def pull_on_follower(
    m: NodeMotions, model: Model, joint: Joint, constraints: Iterable[Constraint], elements: Mapping[str, Element], reaction: Reaction
) -> Block:
    """The force (3, 1) of a joint on its follower.

    Raises:
        ModelError: several joints share the point, or the point is none of the coordinates of a body.
    """
    layout = m.layout
    own = [c for c in constraints if c.element == joint.name]
    if own:
        end = layout.point(joint.follower, joint.to or joint.at)
        return _negative(m, _at(m, end, own))
    for body, sign in ((joint.follower, 1), (joint.base, -1)):
        group = layout.groups.get(layout.group_of[body])
        node = layout.find(body, NodeKind.POINT, joint.at)
        if group is not None and node in group.basis and _meets_alone(model, layout.group_of, joint, group):
            assert node is not None
            balance = _balance(m, model, group, constraints, elements)
            pull = balance.parts.get(node, m.builder.zero(3))
            return pull if sign > 0 else _negative(m, pull)
    problem = Problem(
        span=reaction.span, element=f"reaction '{reaction.name}'",
        message=f"natural coordinates do not tell the force of joint '{joint.name}': other joints meet its bodies at the same point",
        hint="use --method recursive, or leave this output out",
    )  # fmt: skip
    raise ModelError([problem])


def _negative(m: NodeMotions, block: Block) -> Block:
    return m.builder.neg(block)


def _meets_alone(model: Model, group_of: Mapping[str, str], joint: Joint, group: Group) -> bool:
    """Whether no other joint meets the group at the joint's point."""
    others = (j for j in model.joints if j is not joint and group.name in (group_of[j.base], group_of[j.follower]))
    return all(sympy.Matrix(j.at) != sympy.Matrix(joint.at) for j in others)


def _at(m: NodeMotions, form: Form, constraints: Iterable[Constraint]) -> Block:
    """Phi_q^T lambda by the displacement of a form that is one node or a combination with one point."""
    b, node = m.builder, next(n for n in form if n.kind is NodeKind.POINT)
    terms = [b.mul(b.transpose(c.gradient[node]), multipliers(b, c)) for c in constraints if node in c.gradient]
    return b.total(terms) if terms else b.zero(3)


def _balance(
    m: NodeMotions, model: Model, group: Group, constraints: Iterable[Constraint], elements: Mapping[str, Element]
) -> NodalForce:
    """M qdd + Phi_q^T lambda - Q of one group over its basis."""
    b = m.builder
    balance = NodalForce(motions=m)
    bodies = [body for body in model.bodies if body.name in group.bodies]
    for (i, j), mass in mass_matrix(group, bodies).items():
        balance.add("inertia", _one(i), m.times(mass, m.node(j).a))
    for constraint in constraints:
        if constraint.element == group.name:
            for node, gradient in constraint.gradient.items():
                balance.add(constraint.element, _one(node), b.mul(b.transpose(gradient), multipliers(b, constraint)))
    for body in bodies:
        if body.mass != 0:
            weight = b.scale(m.translator.scalar(body.mass), m.vector(model.gravity))
            _subtract(balance, group, m.layout.point(body.name, body.centre_of_mass), weight)
    for element in elements.values():
        for action in element.actions:
            if action.body in group.bodies:
                _subtract(balance, group, action.form, action.force)
    return balance


def _one(node: Node) -> Form:
    return {node: 1}


def _subtract(balance: NodalForce, group: Group, form: Form, force: Block) -> None:
    """Take off a force on a form of the group, over its basis."""
    over = combine(*((c, {n: 1} if n in group.basis else n.parts or {}) for n, c in form.items()))
    balance.add("reaction", over, balance.motions.builder.neg(force))
