"""Mechanisms that no output can feel are dropped.

Bodies act on each other through joints, gears and forces, but not through the ground, nor through bodies whose motion is given by guides
alone.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

from cutjoint.formulate.forces import is_active
from cutjoint.model.outcome import Note, Outcome, bodies_of
from cutjoint.model.records import Body, Gear, JointForce, Model, Reaction, RodForce, Scene
from cutjoint.topology.records import grouped, reached


def drop_unreached(model: Model, scene: Scene) -> Outcome:
    """The pass: keeps the bodies that are joined, directly or not, to one that an output is about."""
    prescribed = reached((j.base, j.follower) for j in model.joints if (j.guide is not None or not j.element.speeds) and not j.cut)
    group = _groups(model, scene, prescribed)
    requested = {o.element for o in scene.outputs}
    elements = (*model.bodies, *model.joints, *model.gears, *model.forces, *model.reactions, *model.markers)
    wanted = {group[b] for element in elements if element.name in requested for b in _influences(element, model) if b in group}
    asked = {r.joint for r in model.reactions if isinstance(r, Reaction) and r.name in requested}
    if any(bodies_of(j) <= prescribed for j in model.joints if j.name in asked):  # such a joint may carry all others
        return Outcome(model=model, scene=scene)
    removed = {b for b in group if group[b] not in wanted} if wanted else set()
    return _without(model, scene, removed)


def _influences(element: Any, model: Model) -> set[str]:
    """The bodies on which an element's quantities depend."""
    joints = {joint.name: joint for joint in model.joints}
    match element:
        case Body():
            return {element.name}
        case JointForce() | Reaction():
            joint = joints[element.joint]
            return {joint.base, joint.follower} | bodies_of(element)
        case RodForce():
            return {body for rod, _ in element.weights for body in (joints[rod].base, joints[rod].follower)}
        case Gear():
            return {body for name in element.joints for body in bodies_of(joints[name])}
    return bodies_of(element)


def _groups(model: Model, scene: Scene, prescribed: set[str]) -> dict[str, str]:
    """The moving bodies, each with a name of the group of bodies that it interacts with."""
    bodies = [body.name for body in model.bodies if body.name not in prescribed]
    links = [_influences(element, model) for element in (*model.joints, *model.gears)]
    links += [bodies_of(force) for force in model.forces if is_active(force, scene)]
    return grouped(bodies, (pair for ends in links for pair in pairwise(sorted(ends.intersection(bodies)))))


def _without(model: Model, scene: Scene, removed: set[str]) -> Outcome:
    if not removed:
        return Outcome(model=model, scene=scene)
    joints = tuple(j for j in model.joints if not bodies_of(j) & removed)
    names = {j.name for j in joints}
    forces = tuple(f for f in model.forces if not removed.intersection(f.bodies) and (not f.joint_of or f.joint_of in names))
    reactions = tuple(r for r in model.reactions if isinstance(r, RodForce) or (r.joint in names and r.body not in removed))
    smaller = replace(
        model, bodies=tuple(b for b in model.bodies if b.name not in removed), joints=joints, forces=forces, reactions=reactions,
        gears=tuple(gear for gear in model.gears if names.issuperset(gear.joints)),
        markers=tuple(m for m in model.markers if m.body not in removed),
    )  # fmt: skip
    positions, rates = (
        {key: value for key, value in states.items() if key.rpartition(".")[0] in names} for states in (scene.positions, scene.rates)
    )
    notes = tuple(
        Note(element=body.name, text="is dropped: no output depends on it", span=body.span)
        for body in model.bodies if body.name in removed
    )  # fmt: skip
    return Outcome(model=smaller, scene=replace(scene, positions=positions, rates=rates), done=notes)
