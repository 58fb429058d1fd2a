"""Bodies that never move against each other become one."""

from dataclasses import replace
from typing import Any

import sympy

from cutjoint.formulate.inputs import input_functions
from cutjoint.model.expressions.quantities import elements_of
from cutjoint.model.outcome import Note, Outcome, transfer_elements
from cutjoint.model.records import GROUND, Body, Joint, Marker, Model, Scene

_MOTION = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")


def weld_bodies(model: Model, scene: Scene) -> Outcome:
    """The pass: fixed joints, and joints whose guides keep them in the design position throughout the scene."""
    outcome, inputs = Outcome(model=model, scene=scene), input_functions(model, scene)
    for joint in model.joints:
        # a guide that is zero at all times is so for all values of the tunable parameters
        if joint.element.is_rigid or (joint.guide is not None and all(bool(law.subs(inputs).is_zero) for law in joint.guide)):
            for now in (j for j in outcome.model.joints if j.name == joint.name):
                outcome = _weld(outcome, now)
    return outcome


def _weld(outcome: Outcome, joint: Joint) -> Outcome:
    reason = _obstacle(outcome, joint)
    if reason:
        return replace(outcome, left=(*outcome.left, Note(element=joint.name, text=f"stays: {reason}", span=joint.span)))
    kept, gone = (joint.base, joint.follower) if joint.follower != GROUND else (joint.follower, joint.base)
    bodies = {body.name: body for body in outcome.model.bodies}
    model, scene = outcome.model, outcome.scene
    if kept != GROUND:
        model, scene = at_centre(model, scene, bodies[kept])
        whole = merged(bodies[kept], bodies[gone])
        model = replace(model, bodies=tuple(whole if b.name == kept else b for b in model.bodies))
    model, scene = at_centre(model, scene, bodies[gone])
    idle = {joint.name, *(other.name for other in _parallel_joints(model, joint))}
    model = transfer_elements(replace(model, joints=tuple(j for j in model.joints if j.name not in idle)), gone, kept)
    outputs = tuple(replace(o, element=kept, stands_for=o.column) if o.element == gone else o for o in scene.outputs)
    note = Note(element=joint.name, text=f"does not move: '{gone}' becomes a part of '{kept}'", span=joint.span)
    return replace(outcome, model=model, scene=replace(scene, outputs=outputs), done=(*outcome.done, note))


def _obstacle(outcome: Outcome, joint: Joint) -> str:
    """The reason that the joint is not welded, "" if there is none."""
    for other in _parallel_joints(outcome.model, joint):
        if reason := _need(outcome, other):
            return f"'{other.name}' joins the same bodies, and {reason}"
    if reason := _need(outcome, joint):
        return reason
    if GROUND in (joint.base, joint.follower):
        body = joint.follower if joint.base == GROUND else joint.base
        for name in (o.column for o in outcome.scene.outputs if o.element == body):
            return f"the output '{name}' needs '{body}', which would be the ground"
    return ""


def _parallel_joints(model: Model, joint: Joint) -> tuple[Joint, ...]:
    """The other joints of the same two bodies, which cannot move if that one does not."""
    bodies = {joint.base, joint.follower}
    return tuple(other for other in model.joints if other.name != joint.name and {other.base, other.follower} == bodies)


def _need(outcome: Outcome, joint: Joint) -> str:
    """The reason that the joint itself is needed, "" if it is not."""
    for name in (o.column for o in outcome.scene.outputs if o.element == joint.name):
        return f"the output '{name}' needs it"
    for entry in (*outcome.scene.positions, *outcome.scene.rates):
        if entry.rpartition(".")[0] == joint.name:
            return f"the scene gives '{entry}'"
    for gear in outcome.model.gears:
        if joint.name in gear.joints:
            return f"the gear '{gear.name}' couples it"
    for force in outcome.model.forces:
        if force.joint_of == joint.name:
            return f"the force '{force.name}' acts on it"
    for reaction in outcome.model.reactions:
        if getattr(reaction, "joint", "") == joint.name:
            return f"'{reaction.name}' is its reaction"
    return ""


def at_centre(model: Model, scene: Scene, body: Body) -> tuple[Model, Scene]:
    """Reported motion of the body's own centre of mass becomes that of a marker there."""
    requested = [o for o in scene.outputs if o.element == body.name and o.quantity in _MOTION]
    if not requested:
        return model, scene
    used = elements_of(model)
    name = f"{body.name}.centre"
    while name in used:
        name += "_"
    marker = Marker(name=name, body=body.name, point=body.centre_of_mass, span=body.span)
    outputs = tuple(replace(o, element=name, stands_for=o.column) if o in requested else o for o in scene.outputs)
    return replace(model, markers=(*model.markers, marker)), replace(scene, outputs=outputs)


def merged(a: Body, b: Body) -> Body:
    """The sum of two masses, their common centre, and the inertia about it (Steiner)."""
    drawn: dict[str, Any] = {"shapes": (*a.shapes, *b.shapes), "visuals": (*a.visuals, *b.visuals)}
    if b.is_massless:
        return replace(a, **drawn)
    if a.is_massless:
        return replace(b, name=a.name, span=a.span, **drawn)
    mass = a.mass + b.mass
    centre = a.centre_of_mass
    if b.mass != 0:
        centre = tuple((a.mass * p + b.mass * q) / mass for p, q in zip(a.centre_of_mass, b.centre_of_mass, strict=True))
    J = sympy.zeros(3, 3)
    for body in (a, b):
        xx, yy, zz, xy, xz, yz = body.inertia
        d = sympy.Matrix(body.centre_of_mass) - sympy.Matrix(centre)
        J += sympy.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + body.mass * (d.dot(d) * sympy.eye(3) - d * d.T)
    inertia = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return replace(a, mass=mass, centre_of_mass=centre, inertia=inertia, **drawn)
