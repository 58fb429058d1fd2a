"""Mechanisms that no output can feel are dropped.

Bodies act on each other through joints, gears and forces, but not through the ground, nor through bodies whose motion is given by guides
alone.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from cutjoint.formulate.forces import is_active
from cutjoint.model.outcome import Note, Outcome, bodies_of
from cutjoint.model.records import GROUND, Body, Gear, JointForce, Model, Reaction, RodForce, Scene


def drop_unreached(model: Model, scene: Scene) -> Outcome:
    """The pass: keeps the bodies that are joined, directly or not, to one that an output is about."""
    given = _prescribed_motion(model)
    group = _groups(model, scene, given)
    asked = {o.element for o in scene.outputs}
    wanted = {group[b] for element in _elements(model) if element.name in asked for b in _felt(element, model) if b in group}
    if any(_is_carried(element, model, given) for element in model.reactions if element.name in asked):
        return Outcome(model=model, scene=scene)
    gone = {b for b in group if group[b] not in wanted} if wanted else set()
    return _without(model, scene, gone)


def _elements(model: Model) -> Iterable[Any]:
    return (*model.bodies, *model.joints, *model.gears, *model.forces, *model.reactions, *model.markers)


def _felt(element: Any, model: Model) -> set[str]:
    """The bodies on which an element's quantities depend."""
    joints = {joint.name: joint for joint in model.joints}
    match element:
        case Body():
            return {element.name}
        case JointForce() | Reaction():
            joint = joints[element.joint]
            return {joint.base, joint.follower} | bodies_of(element)
        case RodForce():
            return {body for rod, _ in element.pushes for body in (joints[rod].base, joints[rod].follower)}
        case Gear():
            return {body for name in element.joints for body in bodies_of(joints[name])}
    return bodies_of(element)


def _is_carried(reaction: Reaction | RodForce, model: Model, given: set[str]) -> bool:
    """Return whether a reaction is of a joint between bodies of given motion, which may carry all others."""
    return isinstance(reaction, Reaction) and next(bodies_of(j) for j in model.joints if j.name == reaction.joint) <= given


def _prescribed_motion(model: Model) -> set[str]:
    """The ground, and bodies that guides alone lead to."""
    given, grows = {GROUND}, True
    while grows:
        found = {
            other for j in model.joints if (j.guide is not None or not j.element.speeds) and not j.cut
            for one, other in ((j.base, j.follower), (j.follower, j.base)) if one in given and other not in given
        }  # fmt: skip
        grows = bool(found)
        given |= found
    return given


def _groups(model: Model, scene: Scene, given: set[str]) -> dict[str, str]:
    """The bodies that move, each with the name of those that it acts on."""
    group = {body.name: body.name for body in model.bodies if body.name not in given}
    links = [_felt(element, model) for element in (*model.joints, *model.gears)]
    links += [bodies_of(force) for force in model.forces if is_active(force, scene)]
    for ends in links:
        moving = sorted(ends & group.keys())
        for other in moving[1:]:
            first, last = group[moving[0]], group[other]
            group = {body: first if g == last else g for body, g in group.items()}
    return group


def _without(model: Model, scene: Scene, gone: set[str]) -> Outcome:
    if not gone:
        return Outcome(model=model, scene=scene)
    joints = tuple(j for j in model.joints if not bodies_of(j) & gone)
    names = {j.name for j in joints}
    forces = tuple(
        f for f in model.forces if not gone.intersection(f.bodies) and (not f.joint_of or f.joint_of in names)
    )  # fmt: skip
    reactions = tuple(r for r in model.reactions if isinstance(r, RodForce) or (r.joint in names and r.body not in gone))
    smaller = replace(
        model, bodies=tuple(b for b in model.bodies if b.name not in gone), joints=joints, forces=forces, reactions=reactions,
        gears=tuple(gear for gear in model.gears if names.issuperset(gear.joints)),
        markers=tuple(m for m in model.markers if m.body not in gone),
    )  # fmt: skip
    positions, rates = (
        {key: value for key, value in states.items() if key.rpartition(".")[0] in names} for states in (scene.positions, scene.rates)
    )
    notes = tuple(
        Note(element=body.name, words="is dropped: no output can feel it", span=body.span) for body in model.bodies if body.name in gone
    )
    return Outcome(model=smaller, scene=replace(scene, positions=positions, rates=rates), done=notes)
