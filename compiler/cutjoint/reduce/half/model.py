"""The half of a symmetric model: one of each pair, and half of what lies in the plane."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from cutjoint.model.mirror import reflected_law
from cutjoint.model.records import (
    COORDINATES,
    GROUND,
    Force,
    JointForce,
    Marker,
    Model,
    Reaction,
    RodForce,
    Scene,
)  # fmt: skip
from cutjoint.reduce.half.images import Images
from cutjoint.reduce.half.in_plane import InPlane, restrict
from cutjoint.reduce.half.plane import AsymmetryError, Plane
from cutjoint.reduce.half.sides import halve_body


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
