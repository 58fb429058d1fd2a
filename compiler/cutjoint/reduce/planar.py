"""Planar mechanisms: joints are replaced by planar ones, and constraints of cut joints normal to the plane are dropped.

Joints that rotate about the plane's normal or slide normal to it confine bodies to the plane under any load.  Other bodies, such as a rod
between balls, stay there if they and everything attached to them are symmetric about the plane.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

import sympy

from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.outcome import Note, Outcome
from cutjoint.model.records import COORDINATES, GROUND, Binding, Joint, JointKind, Model, Scene, Vector
from cutjoint.reduce.in_plane import PlaneModel
from cutjoint.reduce.own_images import require_own_images
from cutjoint.reduce.plane import AsymmetryError, InPlane, Plane, is_zero, restrict
from cutjoint.topology.build import build_topology

#: Sine of the angle within which directions given in digits count as parallel.
_PARALLEL = 1e-12

_ROTATIONS = (JointKind.REVOLUTE, JointKind.PLANAR)


def drop_idle_equations(model: Model, scene: Scene) -> Outcome:
    """The pass: cut revolute joints of plane loops become points on their axes, where nobody asks for a reaction in the loop."""
    topology, outcome = build_topology(model), Outcome(model=model, scene=scene)
    values = {p.symbol: p.value for p in model.parameters if p.binding is Binding.CONST}
    joint_of = topology.joint_of
    for loop in topology.loops:
        cut = next(joint for joint in topology.cuts if joint.name == loop.cut)
        if cut.kind is not JointKind.REVOLUTE:
            continue
        others = [joint_of[body].joint for body in loop.bodies]
        odd = next((j for j in others if not _moves_across(j, cut.axes[0], values)), None)
        names = {cut.name, *(j.name for j in others)}
        sensor = next((r for r in model.reactions if getattr(r, "joint", "") in names), None)
        if odd is None and sensor is None:
            outcome = _freed(outcome, cut)
        else:
            why = f"'{odd.name}' leaves the plane" if odd is not None else f"'{sensor.name}' is a reaction in its loop"  # type: ignore[union-attr]
            note = Note(element=cut.name, text=f"keeps its five equations: {why}", span=cut.span)
            outcome = replace(outcome, left=(*outcome.left, note))
    return outcome


def _moves_across(joint: Joint, normal: Vector, values: dict[object, float]) -> bool:
    """Return whether a joint moves parallel to a plane of this normal: it rotates about the normal or slides across it."""
    if joint.kind is JointKind.FIXED:
        return True
    if joint.kind in _ROTATIONS:
        return all(abs(x) <= _PARALLEL for x in _numbers(sympy.Matrix(joint.axes[0]).cross(sympy.Matrix(normal)), values))
    return joint.kind is JointKind.PRISMATIC and abs(_numbers([_dot(joint.axes[0], normal)], values)[0]) <= _PARALLEL


def _dot(a: Vector, b: Vector) -> object:
    return sum((x * y for x, y in zip(a, b, strict=True)), sympy.Integer(0))


def _numbers(expressions: object, values: dict[object, float]) -> list[float]:
    return [evaluate(sympy.sympify(e), values) for e in expressions]  # type: ignore[attr-defined]


def _freed(outcome: Outcome, cut: Joint) -> Outcome:
    free = replace(cut, kind=JointKind.POINT_ON_LINE)
    model = replace(outcome.model, joints=tuple(free if j.name == cut.name else j for j in outcome.model.joints))
    note = Note(element=cut.name, text="needs two of its equations: its loop moves in a plane", span=cut.span)
    return replace(outcome, model=model, done=(*outcome.done, note))


def flatten(model: Model, scene: Scene) -> Outcome:
    """The pass: a mechanism that moves in planes parallel to y = 0, x = 0 or z = 0 gets planar coordinates.

    ``left`` says why one stays of which joints hold a body in a plane.
    """
    left: list[Note] = []
    for plane in (Plane(axis=axis) for axis in "yxz"):
        confined = confined_bodies(model.joints, plane)
        try:
            return _flatten(model, scene, plane, confined)
        except AsymmetryError as error:
            left += [replace(error.note, text=f"{error.note.text}: it may leave the plane")] if confined != {GROUND} else []
    return Outcome(model=model, scene=scene, left=tuple(left[:1]))


def confined_bodies(joints: Collection[Joint], plane: Plane) -> set[str]:
    """The ground, and the bodies that joints alone confine to the plane."""
    confined, grows = {GROUND}, True
    while grows:
        ends_of = [{j.base, j.follower} for j in joints if _holds(j, plane)]
        found = {body for pair in ends_of if pair & confined for body in pair - confined}
        grows = bool(found)
        confined |= found
    return confined


def _holds(joint: Joint, plane: Plane) -> bool:
    """Return whether a joint keeps the planes of its bodies parallel and at constant distance."""
    match joint.kind:
        case JointKind.FIXED:
            return True
        case JointKind.REVOLUTE | JointKind.PLANAR:
            return plane.along_normal(joint.axes[0])
        case JointKind.PRISMATIC:
            return plane.within(joint.axes[0])
    return False


def _flatten(model: Model, scene: Scene, plane: Plane, confined: Collection[str]) -> Outcome:
    """The model in a plane.

    Raises:
        AsymmetryError: something may leave it, or no joint kind stands for what is left of a joint.
    """
    loose = [b.name for b in model.bodies if b.name not in confined]
    if loose:
        require_own_images(model, scene, plane, loose)
    cuts = {joint.name for joint in build_topology(model).cuts}
    in_plane = {j.name: _restricted(j, plane) for j in model.joints if j.name not in cuts}
    made = PlaneModel(model=model, plane=plane, in_plane=in_plane)
    changed = made.scene(scene)
    flat = made.flat(changed)
    notes = tuple(_notes(model, in_plane, plane))
    if not notes:
        return Outcome(model=model, scene=scene)
    flat = replace(flat, joints=tuple(replace(j, cut=True) if j.name in cuts else j for j in flat.joints))
    return Outcome(model=flat, scene=changed, done=notes)


def _restricted(joint: Joint, plane: Plane) -> InPlane:
    """A joint of the tree with its motions in the plane; guides of the others must be zero."""
    found = restrict(joint, plane)
    for coordinate, guide in zip(COORDINATES[joint.kind], joint.guide or (), strict=False):
        if coordinate not in found.kept and not is_zero(guide):
            raise AsymmetryError(joint.name, f"has a guide of its {coordinate} that moves it out of the plane {plane}", joint.span)
    return found


def _notes(model: Model, in_plane: Mapping[str, InPlane], plane: Plane) -> Iterator[Note]:
    for joint in (j for j in model.joints if j.name in in_plane):
        kind = in_plane[joint.name].joint.kind
        if kind is not joint.kind:
            text = f"moves in the plane {plane} alone: a {kind} joint in place of a {joint.kind} one"
            yield Note(element=joint.name, text=text, span=joint.span)
