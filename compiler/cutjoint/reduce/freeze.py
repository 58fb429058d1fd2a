"""Idle joints frozen: bodies that hardly move against each other in a scene become one where the scene starts.  An approximation."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.elements.force import Point
from cutjoint.model.errors import ModelError
from cutjoint.model.records import GROUND, Body, Force, Joint, Marker, Model, Scalar, Scene, Vector
from cutjoint.reduce.frozen import Frozen
from cutjoint.reduce.records import Note, Outcome, hand_over
from cutjoint.reduce.sampling import Poses, find_poses, numbers
from cutjoint.reduce.weld import at_centre, merged
from cutjoint.run.errors import RunError
from cutjoint.run.simulator import SimulatorError

#: A joint is idle that moves by less than a scene's tolerance, else than this (m and rad).
IDLE = 1e-3


def freeze_idle(model: Model, scene: Scene) -> Outcome:
    """The pass: joints that move by less than IDLE in a run of the model are welded as they are at its start."""
    outcome = Outcome(model=model, scene=scene)
    try:
        poses = find_poses(model, scene)
    except (ModelError, RunError, SimulatorError):
        return outcome
    if poses is None:
        return outcome
    moves = {j.name: _movement(model, j, poses) for j in model.joints if not j.element.is_free}
    limit = IDLE if scene.tolerance is None else scene.tolerance
    idle = {name for name, moved in moves.items() if moved <= limit}
    left: list[Note] = []
    while any(j.name in idle and j.guide is None and j.element.speeds for j in model.joints):  # what is fixed anyway is for an exact pass
        frozen = Frozen(model=model, poses=poses, joints=tuple(j for j in model.joints if j.name in idle))
        problem = frozen.problem(scene)
        if problem is None:
            return replace(_freeze(outcome, frozen, moves), left=tuple(dict.fromkeys(left)))
        note, around = problem
        left.append(note)
        idle -= around
    return replace(outcome, left=tuple(dict.fromkeys(left)))


def _movement(model: Model, joint: Joint, poses: Mapping[str, Poses]) -> float:
    """The movement of a joint's follower as seen from its base, m or rad."""
    return poses[joint.follower].seen_from(poses[joint.base]).change(numbers(joint.at, model))


def _freeze(outcome: Outcome, frozen: Frozen, moves: Mapping[str, float]) -> Outcome:
    model, scene, carrier = outcome.model, outcome.scene, frozen.carriers
    gone = [b for b in model.bodies if carrier[b.name] != b.name]
    inner = {j.name for j in model.joints if carrier[j.base] == carrier[j.follower]}
    for body in gone:
        model, scene = at_centre(model, scene, body)
    for name in dict.fromkeys(carrier[b.name] for b in gone if carrier[b.name] != GROUND):
        model, scene = at_centre(model, scene, next(b for b in model.bodies if b.name == name))
    asked = {o.element for o in scene.outputs}
    forces = tuple(f for f in model.forces if f.name in asked or not _is_inner(f, carrier, inner))
    reactions = tuple(r for r in model.reactions if getattr(r, "joint", "") not in inner)
    model = replace(model, forces=forces, reactions=reactions, joints=tuple(j for j in model.joints if j.name not in inner))
    for body in gone:
        model = _give_over(model, body, frozen)
        outputs = tuple(replace(o, element=carrier[body.name], stands_for=o.column) if o.element == body.name else o for o in scene.outputs)
        scene = replace(scene, outputs=outputs)
    if scene.pose == "equilibrium":
        scene = replace(scene, positions={**_places(model, frozen.poses), **scene.positions})
    positions, rates = (
        {key: value for key, value in states.items() if key.rpartition(".")[0] not in inner} for states in (scene.positions, scene.rates)
    )
    notes = tuple(
        Note(element=j.name, words=f"is frozen: it moves by {moves[j.name]:.1e} m or rad", span=j.span)
        for j in outcome.model.joints if j.name in inner
    )  # fmt: skip
    return replace(outcome, model=model, scene=replace(scene, positions=positions, rates=rates), done=notes)


def _places(model: Model, poses: Mapping[str, Poses]) -> dict[str, Scalar]:
    """The starting places of free bodies, near which frozen ones find their equilibrium: they may be off the road where they are drawn."""
    places: dict[str, Scalar] = {}
    for joint in (j for j in model.joints if j.element.is_free and j.base == GROUND):
        at, pose = numbers(joint.at, model), poses[joint.follower]
        for name, value in zip("xyz", pose.r[0] + pose.R[0] @ at - at, strict=True):
            places[f"{joint.name}.{name}"] = sympy.Float(value)
    return places


def _is_inner(force: Force, carrier: Mapping[str, str], inner: Collection[str]) -> bool:
    """Return whether a force acts between parts of one body."""
    return force.joint_of in inner or (len(force.bodies) == 2 and len({carrier[body] for body in force.bodies}) == 1)


def _give_over(model: Model, body: Body, frozen: Frozen) -> Model:
    """The model with a body's mass and all that stands on it on its carrier."""
    to, turn, way = frozen.carriers[body.name], *frozen.shift(body.name)
    if frozen.is_moved(body.name):
        forces = tuple(_moved_force(f, body.name, turn, way) for f in model.forces)
        markers = tuple(_moved_marker(m, body.name, turn, way) for m in model.markers)
        model, body = replace(model, forces=forces, markers=markers), _moved_body(body, turn, way)
    if to != GROUND:
        model = replace(model, bodies=tuple(merged(b, body) if b.name == to else b for b in model.bodies))
    return hand_over(model, body.name, to)


def _placed(point: Vector, turn: NDArray[np.float64], way: NDArray[np.float64]) -> Vector:
    x, y, z = sympy.Matrix(turn) * sympy.Matrix(point) + sympy.Matrix(way)
    return x, y, z


def _moved_body(body: Body, turn: NDArray[np.float64], way: NDArray[np.float64]) -> Body:
    xx, yy, zz, xy, xz, yz = body.inertia
    R = sympy.Matrix(turn)
    J = R * sympy.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) * R.T
    inertia = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return replace(body, centre_of_mass=_placed(body.centre_of_mass, turn, way), inertia=inertia)


def _moved_marker(marker: Marker, body: str, turn: NDArray[np.float64], way: NDArray[np.float64]) -> Marker:
    return replace(marker, point=_placed(marker.point, turn, way)) if marker.body == body else marker


def _moved_force(force: Force, body: str, turn: NDArray[np.float64], way: NDArray[np.float64]) -> Force:
    """A force with its points and directions in a body where that is at the start."""
    placed: dict[str, Any] = {}
    for place in force.places:
        if place.body(force) == body and not force.has_frame:
            placed[place.field] = _placed(place.of(force), turn, way if isinstance(place, Point) else np.zeros(3))
    return replace(force, **placed)
