"""Springs, rods, wheels and the road in pictures; forces and reactions as arrows if the scene reports all their components."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cutjoint.elements.interaction import Arrow, Axis, Carrier, Coil, Frame, Point, Ring, Visual, Wheel
from cutjoint.formulate.forces import is_active
from cutjoint.model.records import Force, Reaction, Scalar
from cutjoint.run.road_field import Surface, surface_of
from cutjoint.run.roads import Piece, profile_pieces
from cutjoint.view import meshes
from cutjoint.view.motions import along, continuous, product, quaternions_of, rotation_to
from cutjoint.view.records import FORCE, ICE, JOINT, REACTION, ROAD, RUBBER, STEEL, Array, Mesh, Node, Part
from cutjoint.view.sizes import Placed, named_visuals, point_of

#: A wheel that rotates further than this between samples, rad, is drawn without rotation, which would alias.
_LARGEST_TURN = 2.0
#: The largest number of drawn cells of a track with a surface.
_MOST_CELLS = 20_000
#: The length of the longest arrow, as a share of the mechanism's extent.
_LONGEST = 0.3
#: The smallest drawn share of the longest arrow; a mesh without size has no normals.
_SMALLEST = 1e-6
_COMPONENTS = ("Fx", "Fy", "Fz")


@dataclass(frozen=True, kw_only=True)
class ForceNodes(Placed):
    """The nodes of forces, of joints that keep a distance, and of the road; ``up`` (3,) is against gravity."""

    up: Array

    def all(self) -> Iterator[Node]:
        """The nodes in the model's order."""
        wheels = []
        for force in self.model.forces:
            if not is_active(force, self.scene):
                continue
            for name, visual in named_visuals(force):
                yield replace(self._drawn(force, name, visual), about={"element": force.name})
                if isinstance(visual, Wheel):
                    wheels.append((self.numbers(force.radius), self.point(force, visual.at)))
        for joint in self.model.joints:
            if joint.to is not None:
                start, end = self.place(joint.base, joint.at), self.place(joint.follower, joint.to)
                yield self._stretched(joint.name, meshes.cylinder(self.sizes.bar, 1.0).moved(np.eye(3), np.array([0, 0, 0.5])), start, end)
        if wheels:
            yield self._road(wheels)

    def _drawn(self, force: Force, name: str, visual: Visual) -> Node:
        match visual:
            case Coil():
                return self._coil(force, name, visual)
            case Ring():
                return self._ring(force, name, visual)
            case Wheel():
                return self._wheel(force, name, visual)

    def _node(self, name: str, parts: tuple[Part, ...], translation: Array, rotation: Array, scale: Array | None = None) -> Node:
        still = np.ones((1, 3)) if scale is None else scale
        return Node(name=name, parts=parts, translation=translation, rotation=rotation, scale=still, about={"element": name})

    def _stretched(self, name: str, mesh: Mesh, start: Array, end: Array, axis: Array | None = None) -> Node:
        """A mesh of unit length along z between two points (times, 3); one has a length and an ``axis`` where these coincide, too."""
        way = end - start
        length = np.maximum(np.linalg.norm(way, axis=1), self.sizes.shortest)
        scale = np.stack([np.ones_like(length), np.ones_like(length), length], axis=1)
        seen = np.where(np.linalg.norm(way, axis=1, keepdims=True) > 1e-9 * self.sizes.extent, way, self.up if axis is None else axis)
        return self._node(name, (Part(mesh=mesh, colour=STEEL, roughness=0.4),), start, along(seen), scale)

    def _coil(self, force: Force, name: str, coil: Coil) -> Node:
        """A spring between its points, or along its axis and as long as the travel along that."""
        start, end, axis = self.point(force, coil.start), self.point(force, coil.end), None
        if coil.axis is not None:
            axis = self.rotate(coil.axis.body(force), coil.axis.of(force))
            start = end - np.sum((end - start) * axis, axis=1, keepdims=True) * axis
        return self._stretched(name, meshes.coil(self.sizes.spring), start, end, axis)

    def _ring(self, force: Force, name: str, visual: Ring) -> Node:
        """A ring that rotates with its frame's body."""
        ring = meshes.revolved([(0.8, -0.5), (1.3, -0.5), (1.3, 0.5), (0.8, 0.5), (0.8, -0.5)])
        mesh = Mesh(points=1.2 * self.sizes.joint * ring.points, faces=ring.faces)
        rotated = mesh.moved(rotation_to(point_of(self.numbers, visual.frame.of(force)[2])), np.zeros(3))
        rotation = quaternions_of(self.poses[visual.frame.body(force)].rotation)
        return self._node(name, (Part(mesh=rotated, colour=JOINT),), self.point(force, visual.at), rotation)

    def _wheel(self, force: Force, name: str, wheel: Wheel) -> Node:
        """A wheel that rotates with its body, or rolls by its centre's displacement if no coordinate has its angle."""
        axis, pose = point_of(self.numbers, wheel.axis.of(force)), self.poses[wheel.axis.body(force)]
        radius, centre = self.numbers(force.radius), self.point(force, wheel.at)
        angle = np.zeros(len(centre)) if wheel.rotates else self._rolled(centre, pose.rotate(axis), radius)
        quaternion = np.concatenate([np.sin(angle / 2)[:, np.newaxis] * axis, np.cos(angle / 2)[:, np.newaxis]], axis=1)
        rotation = product(quaternions_of(pose.rotation), quaternion)
        rotated = rotation_to(axis)
        parts = (
            Part(mesh=meshes.tyre(radius).moved(rotated, np.zeros(3)), colour=RUBBER, roughness=0.9),
            Part(mesh=meshes.rim(radius).moved(rotated, np.zeros(3)), colour=STEEL, roughness=0.4),
        )
        return self._node(name, parts, centre, continuous(rotation))

    def _rolled(self, centre: Array, axis: Array, radius: float) -> Array:
        """The rolling angle of a wheel, rad, from the displacement of its centre; zero if it is too large between samples."""
        ahead = np.cross(axis, self.up)
        ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-12)
        turns = np.sum(np.diff(centre, axis=0) * (ahead[1:] + ahead[:-1]) / 2, axis=1) / radius
        return np.concatenate([[0.0], np.cumsum(turns)]) if np.abs(turns).max(initial=0.0) < _LARGEST_TURN else np.zeros(len(centre))

    def _road(self, wheels: list[tuple[float, Array]]) -> Node:
        """Both tracks under the way of all wheels, each with its radius, in strips of a metre."""
        way = np.concatenate([centre for _, centre in wheels])
        margin = 4 * max(radius for radius, _ in wheels)
        x0, x1 = np.floor(way[:, 0].min() - margin), np.ceil(way[:, 0].max() + margin)
        road, parts = self.scene.road, []
        tracks = [(road.left, 0.0, max(way[:, 1].max(), 0.0) + margin / 2), (road.right, min(way[:, 1].min(), 0.0) - margin / 2, 0.0)]
        for segments, right, left in tracks:
            x, z = _profile(profile_pieces(segments, road.start), float(x0), float(x1))
            surface = surface_of(road)
            whole = meshes.strip(x, z, left, right) if surface is None else _relief(surface, x, z, right, left)
            middle = whole.points[whole.faces].mean(axis=1)
            cells = np.floor(middle[:, 0]).astype(int) % 2
            if surface is not None:
                cells += [2 * (abs(surface.friction(float(a), float(b), 0, 0) - 1) > 0.05) for a, b, _ in middle]
            for shade, colour in enumerate((*ROAD, *ICE)):
                kept = cells == shade
                if kept.any():
                    used, faces = np.unique(whole.faces[kept], return_inverse=True)
                    parts.append(Part(mesh=Mesh(points=whole.points[used], faces=faces.reshape(-1, 3)), colour=colour, roughness=1.0))
        return Node(name="road", parts=tuple(parts), translation=np.zeros((1, 3)), about={"road": True})


def _relief(surface: Surface, x: Array, z: Array, right: float, left: float) -> Mesh:
    """A track of heights z (n,) over x (n,), from y = right to left, with its surface. The grid is a quarter of a metre wide or more."""
    step = max(0.25, float(np.sqrt((x[-1] - x[0]) * (left - right) / _MOST_CELLS)))
    along, across = (np.linspace(a, b, 1 + int(np.ceil((b - a) / step))) for a, b in ((x[0], x[-1]), (right, left)))
    heights = np.zeros((len(along), len(across))) if surface.field is None else surface.field.heights_on_grid(along, across)
    return meshes.relief(along, across, heights + np.interp(along, x, z)[:, np.newaxis])


def _profile(pieces: list[Piece], first: float, last: float) -> tuple[Array, Array]:
    """Positions along a road and its heights there, on both sides of a step."""
    starts = [piece.start for piece in pieces]
    x, z = [], []
    for index, piece in enumerate(pieces):
        start = first if index == 0 else starts[index]
        end = starts[index + 1] if index + 1 < len(starts) else last
        start, end = max(start, first), min(end, last)
        if end <= start:
            continue
        count = 40 if piece.kind == "cosine" else 2
        marks = np.union1d(np.linspace(start, end, count), np.arange(np.ceil(start), end, 1.0))
        x += marks.tolist()
        z += [piece.height(mark) for mark in marks]
    points = np.array([x, z])
    moves = np.concatenate([[True], np.abs(np.diff(points)).max(axis=0) > 1e-9])
    return points[0, moves], points[1, moves]


@dataclass(frozen=True, kw_only=True)
class Arrows(Placed):
    """The arrows of a run: ``columns`` (times,) by element and quantity; ``up`` (3,) is against gravity."""

    columns: Mapping[tuple[str, str], Array]
    up: Array

    def all(self) -> tuple[Node, ...]:
        """A node for each force and reaction; the lengths of arrows are proportional to the forces."""
        found = [*self._forces(), *self._reactions()]
        largest = max((float(np.linalg.norm(force, axis=1).max()) for _, _, _, force in found), default=0.0)
        return tuple(self._arrow(*each, largest) for each in found) if largest > 0 else ()

    def _arrow(self, name: str, is_reaction: bool, place: Array, force: Array, largest: float) -> Node:
        length = _LONGEST * self.sizes.extent
        size = np.maximum(np.linalg.norm(force, axis=1) / largest, _SMALLEST)
        seen = np.where(np.linalg.norm(force, axis=1, keepdims=True) > _SMALLEST * largest, force, [0.0, 0.0, 1.0])
        part = Part(mesh=meshes.arrow(length), colour=REACTION if is_reaction else FORCE)
        return Node(
            name=f"{'reaction' if is_reaction else 'force'} {name}", parts=(part,), translation=place, rotation=along(seen),
            scale=np.repeat(size[:, np.newaxis], 3, axis=1), about={"arrow": name, "newton": largest, "length": length},
        )  # fmt: skip

    def _forces(self) -> Iterator[tuple[str, bool, Array, Array]]:
        for force in self.model.forces:
            context = ForceVisual(arrows=self, force=force)
            if (found := force.interaction.arrow(force, context)) is not None:
                yield force.name, False, *found

    def _reactions(self) -> Iterator[tuple[str, bool, Array, Array]]:
        """The forces of joints on their followers."""
        joints = {joint.name: joint for joint in self.model.joints}
        for reaction in self.model.reactions:
            if not isinstance(reaction, Reaction):
                continue
            joint, axes = joints[reaction.joint], self.poses[reaction.body].rotation
            place = self.place(joint.follower, joint.to or joint.at)
            if reaction.direction is not None:
                if (force := self.column(reaction.name, "force")) is not None:
                    yield reaction.name, True, place, force * (axes @ point_of(self.numbers, reaction.direction))
            elif (parts := self.triple(reaction.name)) is not None:
                yield reaction.name, True, place, _rotated(axes, parts)

    def column(self, element: str, quantity: str) -> Array | None:
        """A quantity over time, (times, 1); None where it is no output, or has no value at some time."""
        values = self.columns.get((element, quantity))
        return None if values is None or not np.isfinite(values).all() else values[:, np.newaxis]

    def triple(self, element: str) -> Array | None:
        """The components of a force over time, (times, 3); None where one of them is missing."""
        parts = [self.column(element, quantity) for quantity in _COMPONENTS]
        known = [part for part in parts if part is not None]
        return np.concatenate(known, axis=1) if len(known) == len(parts) else None


@dataclass(frozen=True, kw_only=True)
class ForceVisual:
    """The arrow of a force, as its interaction says it."""

    arrows: Arrows
    force: Force

    def apply_force_pair(self, start: Point, end: Point, quantity: str) -> Arrow:
        """A tension on the end, towards the start."""
        place = self.arrows.point(self.force, end)
        way = self.arrows.point(self.force, start) - place
        return self._of(quantity, place, way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12))

    def apply_force_along(self, at: Point, axis: Axis, quantity: str) -> Arrow:
        """A force on a point along an axis."""
        return self._of(quantity, self.arrows.point(self.force, at), self.arrows.rotate(axis.body(self.force), axis.of(self.force)))

    def components(self, at: Point, axes: Frame | Carrier | None) -> Arrow:
        """Three components in a frame, in a body's axes or in global ones."""
        parts = self.arrows.triple(self.force.name)
        if parts is None:
            return None
        return self.arrows.point(self.force, at), parts if axes is None else _rotated(self._axes(axes), parts)

    def _axes(self, axes: Frame | Carrier) -> Array:
        if isinstance(axes, Carrier):
            return self.arrows.poses[getattr(self.force, axes)].rotation
        return np.stack([self.arrows.rotate(axes.body(self.force), axis) for axis in axes.of(self.force)], axis=-1)

    def lift(self, at: Point, below: Scalar, quantity: str) -> Arrow:
        """A force up, below a point."""
        up, depth = self.arrows.up, self.arrows.numbers(below)
        return self._of(quantity, self.arrows.point(self.force, at) - depth * up, up)

    def _of(self, quantity: str, place: Array, direction: Array) -> Arrow:
        size = self.arrows.column(self.force.name, quantity)
        return None if size is None else (place, size * direction)


def _rotated(rotations: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("tij,tj->ti", rotations, vectors))
