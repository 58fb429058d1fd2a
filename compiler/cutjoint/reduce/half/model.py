"""The half of a symmetric model: one of each pair, and half of what lies in the plane.

A model has two sides: of each pair, the elements of one are kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from cutjoint.elements.interaction import Point
from cutjoint.model.evaluate import evaluate
from cutjoint.model.mirror import reflected_law
from cutjoint.model.records import (
    COORDINATES,
    GROUND,
    Body,
    Force,
    Joint,
    JointForce,
    Marker,
    Model,
    Reaction,
    RodForce,
    Scalar,
    Scene,
    Vector,
)
from cutjoint.reduce.half.images import Images, Pairs
from cutjoint.reduce.half.plane import AsymmetryError, InPlane, Plane, restrict


@dataclass(frozen=True, kw_only=True)
class Half:
    """The cut of a whole model in two halves.

    ``removed`` are the names of the other side's elements, ``gone`` also those of forces on coordinates that rest; ``in_plane`` has the
    motions of the tree joints between bodies in the plane.  Of a ``flat`` model nothing is left out or halved: all of it is in the plane.
    """

    model: Model
    plane: Plane
    images: Images
    removed: frozenset[str]
    gone: frozenset[str]
    in_plane: Mapping[str, InPlane]
    flat: bool = False

    def is_own(self, name: str) -> bool:
        """Return whether a body, joint or force is its own image, so that only half of it is in the half."""
        return not self.flat and any(images.get(name) == name for images in (self.images.bodies, self.images.joints, self.images.forces))

    def kept_joint(self, name: str) -> str:
        """A joint that is kept: the one of that name, or its image."""
        return self.images.joints[name] if name in self.removed else name

    def kept_force(self, name: str) -> str:
        """The force of the half that stands for a force of the whole; one that is switched off may have no image."""
        return self.images.forces.get(name, name) if name in self.removed else name


def cut_in_half(model: Model, plane: Plane, images: Images, removed: frozenset[str]) -> Half:
    """Decide what becomes of the joints in the plane and of the forces on their coordinates.

    Raises:
        AsymmetryError: a joint cannot be restricted to motions in the plane.
    """
    inside = {GROUND} | {name for name, image in images.bodies.items() if name == image}
    joints = [j for j in model.joints if {j.base, j.follower} <= inside and j.name not in removed]
    in_plane = {j.name: restrict(j, plane) for j in joints if j.cut is not True}
    for joint in joints:
        rests = joint.name in in_plane and not set(COORDINATES[joint.kind]) <= in_plane[joint.name].kept.keys()
        if joint.guide is not None and rests and images.joints[joint.name] != joint.name:
            raise AsymmetryError(joint.name, f"has a guide that moves it out of the plane {plane}", joint.span)
    gone = removed | idle_forces(model, in_plane)
    return Half(model=model, plane=plane, images=images, removed=removed, gone=gone, in_plane=in_plane)


def idle_forces(model: Model, in_plane: Mapping[str, InPlane]) -> frozenset[str]:
    """The forces on coordinates that would leave the plane."""
    forces = (f for f in model.forces if f.joint_of in in_plane)
    return frozenset(f.name for f in forces if f.coordinate_of not in in_plane[f.joint_of].kept)


def half_model(half: Half, scene: Scene) -> Model:
    """The model of the half, with its ``scene`` alone.

    Raises:
        AsymmetryError: the half does not have a reaction.
    """
    model = half.model
    kept = [b for b in model.bodies if b.name not in half.removed]
    return replace(
        model,
        bodies=tuple(halve_body(b) if half.is_own(b.name) else b for b in kept),
        joints=tuple(half.in_plane[j.name].joint if j.name in half.in_plane else j for j in model.joints if j.name not in half.removed),
        forces=tuple(_forces(half)), reactions=tuple(_reaction(half, r) for r in model.reactions),
        markers=tuple(_marker(half, m) for m in model.markers), scenes={scene.name: scene},
    )  # fmt: skip


def _forces(half: Half) -> Iterator[Force]:
    for force in half.model.forces:
        if force.name in half.gone:
            continue
        halved = force.halved() if half.is_own(force.name) else force
        if isinstance(halved, JointForce) and halved.joint in half.in_plane:
            name, sign = half.in_plane[halved.joint].kept[halved.coordinate]
            halved = replace(halved, coordinate=name, law=reflected_law(halved.law, sign))
        yield halved


def _reaction(half: Half, reaction: Reaction | RodForce) -> Reaction | RodForce:
    """A reaction as it is; that of a joint that is left out is that of the joint's image, along the image of its direction."""
    if half.flat:
        return reaction
    if isinstance(reaction, RodForce):
        raise AsymmetryError(reaction.name, "is measured by distances that already stand for a link", reaction.span)
    is_removed = reaction.joint in half.removed
    if not is_removed and reaction.body not in half.removed:
        return reaction
    if not is_removed and not half.is_own(reaction.joint):
        raise AsymmetryError(reaction.name, "has its direction on the other side", reaction.span)
    joint = half.images.joints[reaction.joint] if is_removed else reaction.joint
    direction = None if reaction.direction is None else half.plane.mirror.vector(reaction.direction)
    return replace(reaction, joint=joint, body=half.images.bodies[reaction.body], direction=direction)


def _marker(half: Half, marker: Marker) -> Marker:
    """A marker as it is; one on a body that is left out moves over to the image."""
    if marker.body not in half.removed:
        return marker
    return replace(marker, body=half.images.bodies[marker.body], point=half.plane.mirror.vector(marker.point))


def halve_body(body: Body) -> Body:
    """A body with half its mass and inertia."""
    xx, yy, zz, xy, xz, yz = (i / 2 for i in body.inertia)
    return replace(body, mass=body.mass / 2, inertia=(xx, yy, zz, xy, xz, yz))


def join_sides(pairs: Pairs) -> tuple[frozenset[str], ...]:
    """The groups of paired bodies that joints and forces hold together.

    Raises:
        AsymmetryError: an element holds a group and its image together.
    """
    groups = {name: frozenset({name}) for name, image in pairs.bodies.items() if name != image}
    forces = (f for f in pairs.elements.forces if f.active)
    joined: list[tuple[Joint | Force, tuple[str, ...]]] = [(j, (j.base, j.follower)) for j in pairs.elements.joints]
    for element, bodies in [*joined, *((f, f.bodies) for f in forces)]:
        held = frozenset[str]().union(*(groups[b] for b in bodies if b in groups))
        if any(pairs.bodies[b] in held for b in held):
            words = f"joins the two sides of the plane {pairs.plane} directly, which cannot be cut in half"
            raise AsymmetryError(element.name, words, element.span)
        groups |= dict.fromkeys(held, held)
    return tuple(dict.fromkeys(groups.values()))


@dataclass(frozen=True, kw_only=True)
class PlaneDistances:
    """Distances of elements from a plane, with signs: the sums of their points' coordinates at the parameters' ``values``, m."""

    plane: Plane
    values: Mapping[Scalar, float]

    def of(self, element: Joint | Force) -> float:
        """The distance of an element."""
        points: list[Vector] = _points(element)
        return sum(evaluate(p["xyz".index(self.plane.axis)], self.values) for p in points)

    def of_group(self, joints: Iterable[Joint], bodies: frozenset[str]) -> float:
        """The distance of the joints at bodies."""
        return sum(self.of(j) for j in joints if {j.base, j.follower} & bodies)


def _points(element: Joint | Force) -> list[Vector]:
    if isinstance(element, Joint):
        return [element.at] if element.to is None else [element.at, element.to]
    return [getattr(element, name) for name in dict.fromkeys(p.field for p in element.places if isinstance(p, Point))]


def find_removed(pairs: Pairs, images: Images, distances: PlaneDistances, groups: Iterable[frozenset[str]]) -> frozenset[str]:
    """The names of bodies, joints and forces of the side that is left out: the one with the smaller coordinates."""
    joints, forces = pairs.elements.joints, pairs.elements.forces
    removed: set[str] = set()
    for group in groups:
        image = frozenset(images.bodies[b] for b in group)
        if not (group | image) & removed:
            removed |= image if distances.of_group(joints, group) >= distances.of_group(joints, image) else group
    removed |= {j.name for j in joints if {j.base, j.follower} & removed}
    removed |= {f.name for f in forces if f.joint_of in removed or set(f.bodies) & removed}
    _remove_seconds(joints, images.joints, removed, distances)
    _remove_seconds(forces, images.forces, removed, distances)
    return frozenset(removed)


def _remove_seconds(elements: Iterable[Joint | Force], images: Mapping[str, str], removed: set[str], distances: PlaneDistances) -> None:
    """Remove the lower one of each pair that is still complete: both act on bodies in the plane."""
    by_name = {e.name: e for e in elements}
    for name, element in by_name.items():
        image = images.get(name, name)
        if image != name and not {name, image} & removed:
            removed.add(image if distances.of(element) >= distances.of(by_name[image]) else name)
