"""The free body whose equations give the force of a joint that has no equations of its own but only shares a point.

The joint is cut by a virtual displacement: one of its bodies moves the point, the others stay.  The virtual work of the masses, equations
and forces that move with that body gives the joint's force on it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, Uses
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.expressions.quantities import reaction_component
from cutjoint.model.records import Force, Joint, Model, Reaction, Scalar


@dataclass(frozen=True, kw_only=True)
class FreeBody:
    """The group of bodies on one side of a joint, and the ``node`` at which the joint's force acts on it.

    ``sign`` is 1 for the follower's group and -1 for the base's. If ``is_surplus``, the group has equations that tie a combination of its
    basis to the node; otherwise the node is part of its basis.
    """

    group: str
    node: Node
    sign: int
    is_surplus: bool


def require_force(model: Model, reaction: Reaction, joint: Joint, quantity: str) -> None:
    """Refuse a quantity of a joint that points and unit vectors do not determine.

    Raises:
        ModelError: a moment, or the force of a joint along whose displacement a gear acts.
    """
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
    return Problem(
        span=reaction.span, element=f"reaction '{reaction.name}'", message=message,
        hint="use --method recursive or recursive-newton, or leave this output out",
    )  # fmt: skip


def find_free_body(layout: Layout, model: Model, reaction: Reaction, joint: Joint) -> FreeBody:
    """The free body for the reaction of a joint that only shares a point.

    Raises:
        ModelError: there is none: the body is fixed, or another joint shares the point, or both bodies share a further point.
    """
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

    Nodes that are combinations of the group's basis move with it.
    """
    return sum((use.sign * _share(use.group, use.form, free_body) for use in uses), 0.0)


def _share(user: str, form: Form, free_body: FreeBody) -> Scalar:
    moved: Scalar = 0.0
    for node, coefficient in form.items():
        if node is free_body.node:
            moved += coefficient if user == free_body.group else 0.0
        elif node.parts is not None:
            moved += coefficient * _share(node.body, node.parts, free_body)
    return moved
