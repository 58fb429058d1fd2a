"""Scenes that are symmetric about a plane: half of the model does for the whole.

Where a reflection maps a model and all that a scene does to it onto itself, the motion is its own image.  Bodies in the plane move in
it, with half their mass and half the forces on them; of everything else, one side is enough, and the other side's columns are its own
but for signs.  The half has the whole one's motion to rounding, and cannot leave the plane where the whole one is unstable.
Only a start that the scene leaves open may differ: where loops close from positions or speeds that contradict them, the change is the
smallest one in the coordinates there are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from cutjoint.model.elements import Elements
from cutjoint.model.evaluate import evaluate
from cutjoint.model.mirror import mirror_elements
from cutjoint.model.outcome import Note, Outcome
from cutjoint.model.records import Body, Force, Joint, Model, Road, RoadSegment, Scalar, Scene
from cutjoint.reduce.half.images import Images, Pairs, find_pairs, require_images, settle
from cutjoint.reduce.half.means import NEAR, AveragedModel, Nearness, mean, mean_axes, nearness
from cutjoint.reduce.half.model import Half, PlaneDistances, cut_in_half, find_removed, half_model, join_sides
from cutjoint.reduce.half.plane import AsymmetryError, Plane, in_plane_words, require_gravity
from cutjoint.reduce.half.scene import half_scene
from cutjoint.reduce.planar import flatten, held_bodies, own_images


def halve(model: Model, scene: Scene) -> Outcome:
    """Cut a model in half that is symmetric in a scene about one of the planes y = 0, x = 0, z = 0.

    A pass.  It leaves a model without pairs of elements; ``left`` says why one with pairs is not cut.
    """
    left: list[Note] = []
    for plane in (Plane(axis=axis) for axis in "yxz"):
        elements = settle(model, scene)
        pairs = find_pairs(elements, plane)
        if not pairs.any:
            continue
        try:
            return _cut(model, scene, pairs)
        except AsymmetryError as error:
            left.append(error.note)
    return Outcome(model=model, scene=scene, left=tuple(left[:1]))


def _cut(model: Model, scene: Scene, pairs: Pairs) -> Outcome:
    """The half, or the reason why there is none.

    Raises:
        AsymmetryError: the scene is not symmetric, or what is left is not a model.
    """
    require_gravity(model, pairs.plane)
    groups = join_sides(pairs)
    images = require_images(pairs)
    distances = PlaneDistances(plane=pairs.plane, values={p.symbol: p.value for p in model.parameters})
    half = cut_in_half(model, pairs.plane, images, find_removed(pairs, images, distances, groups))
    changed = half_scene(half, scene)
    return Outcome(model=half_model(half, changed), scene=changed, done=tuple(_notes(half)))


def _notes(half: Half) -> Iterator[Note]:
    model = half.model
    groups: dict[str, Sequence[Body | Joint | Force]] = {"bodies": model.bodies, "joints": model.joints, "forces": model.forces}
    counts = [f"{sum(e.name in half.removed for e in group)} {name}" for name, group in groups.items()]
    words = f"is symmetric about the plane {half.plane}: {', '.join(counts)} are left out as images of others"
    yield Note(element=model.name, words=words, span=model.span)
    for joint in model.joints:
        kind = half.in_plane[joint.name].joint.kind if joint.name in half.in_plane else joint.kind
        if kind is not joint.kind:
            yield Note(element=joint.name, words=in_plane_words(half.plane, kind, joint.kind), span=joint.span)


def halve_nearly(model: Model, scene: Scene) -> Outcome:
    """The pass: a scene that is nearly its own image in a plane is cut in half, with the mean of both sides."""
    near, left = nearness(model), []
    for plane in (Plane(axis=axis) for axis in "yxz"):
        pairs = find_pairs(settle(model, scene), plane, near)
        if not pairs.any:
            continue
        try:
            images = require_images(pairs)
            between = AveragedModel(model=model, pairs=pairs, images=images).model_between()
            found = halve(between, _scene_between(scene, images, plane, near))
        except AsymmetryError as error:
            left.append(error.note)
            continue
        changed = tuple(_notes_of_nearly(model, between, plane, scene, found))
        if found.done:  # what needs no change is for the exact pass
            return replace(found, done=(*changed, *found.done)) if changed else Outcome(model=model, scene=scene)
        left += found.left
    return Outcome(model=model, scene=scene, left=tuple(left[:1]))


def flatten_nearly(model: Model, scene: Scene) -> Outcome:
    """The pass: a mechanism that nearly moves in a plane is put into it."""
    near = nearness(model)
    for plane in (Plane(axis=axis) for axis in "yxz"):
        straight = _straightened(model, plane, near)
        held = held_bodies(straight.joints, plane)
        loose = [b.name for b in model.bodies if b.name not in held]
        try:
            pairs, images = own_images(settle(straight, scene), plane, loose, near)
        except AsymmetryError:
            continue
        between = AveragedModel(model=straight, pairs=pairs, images=images).model_between()
        found = flatten(between, _scene_between(scene, images, plane, near))
        changed = tuple(_notes_of_nearly(model, between, plane, scene, found))
        if found.done and changed:
            return replace(found, done=(*changed, *found.done))
    return Outcome(model=model, scene=scene)


def _straightened(model: Model, plane: Plane, near: Nearness) -> Model:
    """The model with joints' axes that nearly stand across a plane, or in it, put there."""
    shown = mirror_elements(Elements((), model.joints, (), (), ()), plane.axis)
    joints = (_straight(joint, seen, near) for joint, seen in zip(model.joints, shown.joints, strict=True))
    return replace(model, joints=tuple(joints))


def _straight(joint: Joint, seen: Joint, near: Nearness) -> Joint:
    opposite = tuple(tuple(-c for c in axis) for axis in seen.axes)
    if not all(near(a, b) or near(a, c) for a, b, c in zip(joint.axes, seen.axes, opposite, strict=True)):
        return joint
    return replace(joint, axes=mean_axes(joint.axes, seen.axes))


def _scene_between(scene: Scene, images: Images, plane: Plane, near: Nearness) -> Scene:
    """The scene with the mean of its sides' starts and roads."""
    positions, rates = (_states_between(states, images, near) for states in (scene.positions, scene.rates))
    return replace(scene, positions=positions, rates=rates, road=_road_between(scene.road, near) if plane.axis == "y" else scene.road)


def _states_between(states: Mapping[str, Scalar], images: Images, near: Nearness) -> dict[str, Scalar]:
    """Coordinates or speeds half way to their images, where they are near; others are for the exact pass to refuse."""
    found: dict[str, Scalar] = {}
    reach = max((abs(evaluate(value, near.values)) for value in states.values()), default=0.0)
    for key, value in states.items():
        name, _, component = key.rpartition(".")
        image, signs = images.joints.get(name, name), images.signs.get(name, {})
        other = states.get(f"{image}.{component}")
        seen = value if other is None or component not in signs else signs[component] * other
        is_near = abs(evaluate(value - seen, near.values)) <= 2 * NEAR * reach
        found[key] = mean(value, seen) if is_near else value
    return found


def _road_between(road: Road, near: Nearness) -> Road:
    """A road whose tracks are near each other with the mean of both."""
    kinds, others = ([s.kind for s in track] for track in (road.left, road.right))
    if kinds != others or not all(_are_near(a, b, near) for a, b in zip(road.left, road.right, strict=True)):
        return road
    track = tuple(_segment_between(a, b) for a, b in zip(road.left, road.right, strict=True))
    return replace(road, left=track, right=track)


def _segment_between(a: RoadSegment, b: RoadSegment) -> RoadSegment:
    return replace(a, length=(a.length + b.length) / 2, rise=(a.rise + b.rise) / 2)


def _are_near(a: RoadSegment, b: RoadSegment, near: Nearness) -> bool:
    limit = NEAR * near.size
    return abs(a.length - b.length) <= limit and abs(a.rise - b.rise) <= limit


def _notes_of_nearly(model: Model, between: Model, plane: Plane, scene: Scene, found: Outcome) -> Iterator[Note]:
    """Notes of everything that was not symmetric: elements, and the scene's gravity and road."""
    old, new = (chain[Any](m.bodies, m.joints, m.forces) for m in (model, between))
    for element, changed in zip(old, new, strict=True):
        if element != changed:
            yield Note(element=element.name, words=f"is taken as symmetric about the plane {plane}", span=element.span)
    if model.gravity != between.gravity:
        yield Note(element=model.name, words=f"is taken to have gravity in the plane {plane}", span=model.span)
    if found.done and (scene.road.left, scene.road.right) != (found.scene.road.left, found.scene.road.right):
        yield Note(element=scene.name, words="has the mean of its road's two tracks", span=scene.span)
