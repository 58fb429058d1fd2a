"""Which body tells a joint's force, and what moves along when it alone moves the joint's point.

A joint without equations of its own only shares a point.  It is parted in thought: one of its bodies moves the point, the others stay.
What the masses, equations and forces that move along do in that displacement is the joint's force on the body.
"""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, Uses
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Joint, Model, Reaction, Scalar


@dataclass(frozen=True, kw_only=True)
class Bearer:
    """A group that tells a joint's force, at ``node``; ``sign`` is 1 of the follower's, -1 of the base's.

    ``held`` says that the group's equations hold its own combination to the node, else the node is of its basis.
    """

    group: str
    node: Node
    sign: int
    held: bool


def find_bearer(layout: Layout, model: Model, reaction: Reaction, joint: Joint) -> Bearer:
    """Who tells the force of a joint that only shares a point.

    Raises:
        ModelError: no body does: it is fixed, or another joint shares the point, or a further point of both bodies.
    """
    for body, sign in ((joint.follower, 1), (joint.base, -1)) if joint.element.shares_point else ():
        group, node = layout.groups.get(layout.group_of[body]), layout.find(body, NodeKind.POINT, joint.at)
        if group is None or node is None:
            continue
        if node in group.surplus:
            return Bearer(group=group.name, node=node, sign=sign, held=True)
        if node in group.basis and _meets_alone(layout, model, joint, node, group.name) and not _is_held_twice(layout, node):
            return Bearer(group=group.name, node=node, sign=sign, held=False)
    problem = Problem(
        span=reaction.span, element=f"reaction '{reaction.name}'",
        message=f"natural coordinates do not tell the force of joint '{joint.name}': it is fixed, or another joint shares its point",
        hint="use --method recursive, or leave this output out",
    )  # fmt: skip
    raise ModelError([problem])


def _meets_alone(layout: Layout, model: Model, joint: Joint, node: Node, group: str) -> bool:
    """Whether no other joint shares the node with the group."""
    others = (j for j in model.joints if j is not joint and j.element.shares_point)
    bodies = (body for j in others for body in (j.base, j.follower) if layout.find(body, NodeKind.POINT, j.at) is node)
    return all(layout.group_of[body] != group for body in bodies)


def _is_held_twice(layout: Layout, node: Node) -> bool:
    """Whether those that carry a point share another one: the force along the line between is then not determined."""
    others = (n for n in layout.nodes if n.kind is NodeKind.POINT and n is not node)
    return any(len(layout.carriers[n] & layout.carriers[node]) > 1 for n in others)


def share(uses: Uses, bearer: Bearer) -> Scalar:
    """How much a sum moves when the bearer's group alone moves its node by one.

    What is laid out after the group on combinations of its basis moves along.
    """
    return sum((use.sign * _share(use.group, use.form, bearer) for use in uses), 0.0)


def _share(user: str, form: Form, bearer: Bearer) -> Scalar:
    moved: Scalar = 0.0
    for node, coefficient in form.items():
        if node is bearer.node:
            moved += coefficient if user == bearer.group else 0.0
        elif node.parts is not None:
            moved += coefficient * _share(node.body, node.parts, bearer)
    return moved
