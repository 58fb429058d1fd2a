"""Idle joints frozen: bodies that hardly move against each other in a scene become one where the scene starts.  An approximation.

Joints are frozen together; carriers of their bodies, the places of these, and obstacles are found first.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.elements.interaction import Point
from cutjoint.model.errors import ModelError
from cutjoint.model.outcome import Note, Outcome, bodies_of, transfer_elements
from cutjoint.model.records import GROUND, Body, Force, Joint, Model, Reaction, Scalar, Scene, Vector
from cutjoint.package.errors import RunError
from cutjoint.reduce.sampling import Poses, find_poses, numbers
from cutjoint.reduce.weld import at_centre, merged
from cutjoint.run.simulator import SimulatorError
from cutjoint.topology.records import grouped

IDLE = 1e-3  #: a joint is idle that moves by less than a scene's tolerance, else than this (m and rad)
_SAME = 1e-9  #: a body that has moved by less at the scene's start is in its design position (m and rad)
_ANGLES = ("roll", "pitch", "yaw")


def freeze_idle(model: Model, scene: Scene) -> Outcome:
    """The pass: joints that move by less than IDLE in a run of the model are welded as they are at its start."""
    outcome = Outcome(model=model, scene=scene)
    try:
        poses = find_poses(model, scene)
    except (ModelError, RunError, SimulatorError):
        return outcome
    if poses is None:
        return outcome
    joints = [j for j in model.joints if not j.element.is_free]
    moves = {j.name: poses[j.follower].seen_from(poses[j.base]).change(numbers(j.at, model)) for j in joints}  # m, rad
    limit = IDLE if scene.accuracy is None else scene.accuracy
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


def _freeze(outcome: Outcome, frozen: "Frozen", moves: Mapping[str, float]) -> Outcome:
    model, scene, carrier = outcome.model, outcome.scene, frozen.carriers
    gone = [b for b in model.bodies if carrier[b.name] != b.name]
    inner = {j.name for j in model.joints if carrier[j.base] == carrier[j.follower]}
    for body in gone:
        model, scene = at_centre(model, scene, body)
    for name in dict.fromkeys(carrier[b.name] for b in gone if carrier[b.name] != GROUND):
        model, scene = at_centre(model, scene, next(b for b in model.bodies if b.name == name))
    requested = {o.element for o in scene.outputs}
    forces = tuple(f for f in model.forces if f.name in requested or not _is_inner(f, carrier, inner))
    reactions = tuple(r for r in model.reactions if getattr(r, "joint", "") not in inner)
    model = replace(model, forces=forces, reactions=reactions, joints=tuple(j for j in model.joints if j.name not in inner))
    for body in gone:  # its mass and all that stands on it go to its carrier
        to, rotation, shift = frozen.carriers[body.name], *frozen.shift(body.name)
        if frozen.is_moved(body.name):
            forces = tuple(_moved_force(f, body.name, rotation, shift) for f in model.forces)
            markers = tuple(
                replace(m, point=_moved_point(m.point, rotation, shift)) if m.body == body.name else m for m in model.markers
            )
            model, body = replace(model, forces=forces, markers=markers), _moved_body(body, rotation, shift)
        if to != GROUND:
            model = replace(model, bodies=tuple(merged(b, body) if b.name == to else b for b in model.bodies))
        model = transfer_elements(model, body.name, to)
        outputs = tuple(replace(o, element=carrier[body.name], stands_for=o.column) if o.element == body.name else o for o in scene.outputs)
        scene = replace(scene, outputs=outputs)
    if scene.pose == "equilibrium":
        scene = replace(scene, positions={**_places(model, frozen.poses), **scene.positions})
    positions, rates = (
        {key: value for key, value in states.items() if key.rpartition(".")[0] not in inner} for states in (scene.positions, scene.rates)
    )
    notes = tuple(
        Note(element=j.name, text=f"is frozen: it moves by {moves[j.name]:.1e} m or rad", span=j.span)
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


def _moved_point(point: Vector, rotation: NDArray[np.float64], shift: NDArray[np.float64]) -> Vector:
    x, y, z = sympy.Matrix(rotation) * sympy.Matrix(point) + sympy.Matrix(shift)
    return x, y, z


def _moved_body(body: Body, rotation: NDArray[np.float64], shift: NDArray[np.float64]) -> Body:
    xx, yy, zz, xy, xz, yz = body.inertia
    R = sympy.Matrix(rotation)
    J = R * sympy.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) * R.T
    inertia = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return replace(body, centre_of_mass=_moved_point(body.centre_of_mass, rotation, shift), inertia=inertia)


def _moved_force(force: Force, body: str, rotation: NDArray[np.float64], shift: NDArray[np.float64]) -> Force:
    """A force with its points and directions in a body where that is at the start."""
    placed: dict[str, Any] = {}
    for place in force.places:
        if place.body(force) == body and not force.has_frame:
            placed[place.field] = _moved_point(place.of(force), rotation, shift if isinstance(place, Point) else np.zeros(3))
    return replace(force, **placed)


@dataclass(frozen=True, kw_only=True)
class Frozen:
    """Joints that are frozen together."""

    model: Model
    poses: Mapping[str, Poses]
    joints: tuple[Joint, ...]

    @property
    def carriers(self) -> Mapping[str, str]:
        """For each body the one that it is merged into, or itself: the ground, or the first in the file."""
        return grouped((GROUND, *(b.name for b in self.model.bodies)), ((joint.base, joint.follower) for joint in self.joints))

    def shift(self, body: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The rotation (3, 3) and displacement (3,) of the body from its design pose to the start, in the frame of its carrier."""
        seen = self.poses[body].seen_from(self.poses[self.carriers[body]])
        return seen.R[0], seen.r[0]

    def is_moved(self, body: str) -> bool:
        """Return whether the body is away from its design position."""
        rotation, shift = self.shift(body)
        return bool(max(np.abs(rotation - np.eye(3)).max(), np.abs(shift).max()) > _SAME)

    def problem(self, scene: Scene) -> tuple[Note, set[str]] | None:
        """The joints that cannot be frozen, and the reason."""
        carrier = self.carriers
        if all(carrier[b.name] == GROUND for b in self.model.bodies):
            return self._stays(self.joints[0], "nothing would move"), {j.name for j in self.joints}
        inner = [j for j in self.model.joints if carrier[j.base] == carrier[j.follower]]
        for joint in inner:
            if reason := _need(self.model, scene, joint):
                return self._stays(joint, reason), self._path_around(joint)
        for element in (*self.model.joints, *self.model.forces, *self.model.reactions):
            for body in sorted(_fixed_in(element, {j.name for j in inner}) - {GROUND}):
                if carrier[body] != body and self.is_moved(body):
                    return self._body_stays(body, f"'{element.name}' is drawn where '{body}' is not at the start")
        for output in (o for o in scene.outputs if carrier.get(o.element, o.element) == GROUND):
            return self._body_stays(output.element, f"the output '{output.column}' needs it")
        for output in (o for o in scene.outputs if o.quantity in _ANGLES and carrier.get(o.element, o.element) != o.element):
            if self.is_moved(output.element):
                return self._body_stays(output.element, f"the output '{output.column}' needs its attitude")
        return None

    def _stays(self, element: Joint | Body, reason: str) -> Note:
        return Note(element=element.name, text=f"is not frozen: {reason}", span=element.span)

    def _body_stays(self, body: str, reason: str) -> tuple[Note, set[str]]:
        note = self._stays(next(b for b in self.model.bodies if b.name == body), reason)
        return note, {j.name for j in self.joints if body in (j.base, j.follower)}

    def _path_around(self, joint: Joint) -> set[str]:
        """The joints that connect the bodies of a joint: itself, or one path between them."""
        if joint in self.joints:
            return {joint.name}
        paths: dict[str, set[str]] = {joint.base: set()}
        while joint.follower not in paths:
            for j in self.joints:
                for one, other in ((j.base, j.follower), (j.follower, j.base)):
                    if one in paths:
                        paths.setdefault(other, paths[one] | {j.name})
        return paths[joint.follower]


def _need(model: Model, scene: Scene, joint: Joint) -> str:
    """The reason that a joint between frozen bodies is needed, "" if it is not."""
    forces = {f.name for f in model.forces if f.joint_of == joint.name}
    sensors = {r.name for r in model.reactions if getattr(r, "joint", "") == joint.name}
    requested = next((o.column for o in scene.outputs if o.element in forces | sensors | {joint.name}), "")
    return f"the output '{requested}' needs it" if requested else ""


def _fixed_in(element: Any, inner: Collection[str]) -> set[str]:
    """The bodies in which a remaining element has parts that cannot be moved individually."""
    match element:
        case Joint():
            return set() if element.name in inner else bodies_of(element)
        case Reaction():
            return set() if element.joint in inner else bodies_of(element)
        case Force():
            return set(element.bodies) if element.has_frame else set()
    return bodies_of(element)
