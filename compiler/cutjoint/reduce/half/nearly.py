"""Scenes that are nearly symmetric, or nearly in a plane, taken as if they were: approximations.

What is nearly the image of something else, or of itself, gives way to what is half way between the two; the exact pass does the rest.
What a scene prescribes, guides and inputs, is not touched.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

from cutjoint.model.elements import Elements
from cutjoint.model.evaluate import evaluate
from cutjoint.model.mirror import mirror_elements
from cutjoint.model.records import Joint, Model, Road, RoadSegment, Scalar, Scene
from cutjoint.reduce.half.images import Images, require_images
from cutjoint.reduce.half.means import NEAR, AveragedModel, Nearness, mean, mean_axes, nearness
from cutjoint.reduce.half.pairs import find_pairs, settle
from cutjoint.reduce.half.plane import AsymmetryError, Plane
from cutjoint.reduce.half.symmetry import halve
from cutjoint.reduce.planar import flatten, held_bodies, own_images
from cutjoint.reduce.records import Note, Outcome


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
        changed = tuple(_notes(model, between, plane, scene, found))
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
        changed = tuple(_notes(model, between, plane, scene, found))
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


def _notes(model: Model, between: Model, plane: Plane, scene: Scene, found: Outcome) -> Iterator[Note]:
    """Notes of everything that was not symmetric: elements, and the scene's gravity and road."""
    old, new = (chain[Any](m.bodies, m.joints, m.forces) for m in (model, between))
    for element, changed in zip(old, new, strict=True):
        if element != changed:
            yield Note(element=element.name, words=f"is taken as symmetric about the plane {plane}", span=element.span)
    if model.gravity != between.gravity:
        yield Note(element=model.name, words=f"is taken to have gravity in the plane {plane}", span=model.span)
    if found.done and (scene.road.left, scene.road.right) != (found.scene.road.left, found.scene.road.right):
        yield Note(element=scene.name, words="has the mean of its road's two tracks", span=scene.span)
