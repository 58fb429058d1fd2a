"""The two sides of a symmetric model: which elements of the pairs are kept."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from cutjoint.elements.force import Point
from cutjoint.model.evaluate import evaluate
from cutjoint.model.records import Body, Force, Joint, Scalar, Vector
from cutjoint.reduce.half.images import Images
from cutjoint.reduce.half.pairs import Pairs
from cutjoint.reduce.half.plane import AsymmetryError, Plane


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
