"""Springs, rods, wheels and the road, which move between bodies or as none does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cutjoint.elements.force import AxisForce, Compliance, LineForce, RoadContact
from cutjoint.formulate.forces import is_active
from cutjoint.model.records import Force
from cutjoint.run.roads import Piece, profile_pieces
from cutjoint.view import meshes
from cutjoint.view.colours import JOINT, ROAD, RUBBER, STEEL
from cutjoint.view.motions import along, one_side, product, quaternions_of, rotation_to
from cutjoint.view.placed import Placed
from cutjoint.view.records import Array, Mesh, Node, Part
from cutjoint.view.sizes import point_of

#: A wheel that turns further than this from one row to the next, rad, is drawn without its turning, which nobody could follow.
_LARGEST_TURN = 2.0


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
            match force.interaction:
                case LineForce() as how:
                    start, end = self.point(force, how.start), self.point(force, how.end)
                    yield self._drawn_out(force.name, meshes.coil(self.sizes.spring), start, end)
                case AxisForce() as how:
                    yield self._axial(force, how)
                case Compliance() as how:
                    ring = meshes.revolved([(0.8, -0.5), (1.3, -0.5), (1.3, 0.5), (0.8, 0.5), (0.8, -0.5)])
                    mesh = Mesh(points=1.2 * self.sizes.joint * ring.points, normals=ring.normals, faces=ring.faces)
                    turned = mesh.moved(rotation_to(point_of(self.numbers, how.frame.of(force)[2])), np.zeros(3))
                    rotation = quaternions_of(self.poses[how.frame.body(force)].rotation)
                    yield self._node(force.name, (Part(mesh=turned, colour=JOINT),), self.point(force, how.base), rotation)
                case RoadContact() as how:
                    radius = self.numbers.number(force.radius)
                    wheels.append((radius, self.point(force, how.centre)))
                    yield self._wheel(force, how, radius, wheels[-1][1])
        for joint in self.model.joints:
            if joint.to is not None:
                start, end = self.place(joint.base, joint.at), self.place(joint.follower, joint.to)
                yield self._drawn_out(joint.name, meshes.cylinder(self.sizes.bar, 1.0).moved(np.eye(3), np.array([0, 0, 0.5])), start, end)
        if wheels:
            yield self._road(wheels)

    def _node(self, name: str, parts: tuple[Part, ...], translation: Array, rotation: Array, scale: Array | None = None) -> Node:
        still = np.ones((1, 3)) if scale is None else scale
        return Node(name=name, parts=parts, translation=translation, rotation=rotation, scale=still, about={"element": name})

    def _drawn_out(self, name: str, mesh: Mesh, start: Array, end: Array, axis: Array | None = None) -> Node:
        """A mesh of unit length along z between two points (times, 3); one has a length and an ``axis`` where these coincide, too."""
        way = end - start
        length = np.maximum(np.linalg.norm(way, axis=1), self.sizes.shortest)
        scale = np.stack([np.ones_like(length), np.ones_like(length), length], axis=1)
        seen = np.where(np.linalg.norm(way, axis=1, keepdims=True) > 1e-9 * self.sizes.extent, way, self.up if axis is None else axis)
        return self._node(name, (Part(mesh=mesh, colour=STEEL, roughness=0.4),), start, along(seen), scale)

    def _axial(self, force: Force, how: AxisForce) -> Node:
        """A spring along the force's line, as long as its travel."""
        point, origin = self.point(force, how.point), self.point(force, how.origin)
        axis = self.turn(how.axis.body(force), how.axis.of(force))
        travel = np.sum((point - origin) * axis, axis=1, keepdims=True)
        return self._drawn_out(force.name, meshes.coil(self.sizes.spring), point - travel * axis, point, axis)

    def _wheel(self, force: Force, how: RoadContact, radius: float, centre: Array) -> Node:
        """A wheel that turns as far as it goes, which no coordinate of the model says."""
        axis, pose = point_of(self.numbers, how.axis.of(force)), self.poses[how.axis.body(force)]
        ahead = np.cross(pose.turn(axis), self.up)
        ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-12)
        turns = np.sum(np.diff(centre, axis=0) * (ahead[1:] + ahead[:-1]) / 2, axis=1) / radius
        angle = np.concatenate([[0.0], np.cumsum(turns)]) if np.abs(turns).max(initial=0.0) < _LARGEST_TURN else np.zeros(len(centre))
        quaternion = np.concatenate([np.sin(angle / 2)[:, np.newaxis] * axis, np.cos(angle / 2)[:, np.newaxis]], axis=1)
        rotation = product(quaternions_of(pose.rotation), quaternion)
        turned = rotation_to(axis)
        parts = (
            Part(mesh=meshes.tyre(radius).moved(turned, np.zeros(3)), colour=RUBBER, roughness=0.9),
            Part(mesh=meshes.rim(radius).moved(turned, np.zeros(3)), colour=STEEL, roughness=0.4),
        )
        return self._node(force.name, parts, centre, one_side(rotation))

    def _road(self, wheels: list[tuple[float, Array]]) -> Node:
        """Both tracks under the way of all wheels, each with its radius, in strips of a metre."""
        way = np.concatenate([centre for _, centre in wheels])
        margin = 4 * max(radius for radius, _ in wheels)
        x0, x1 = np.floor(way[:, 0].min() - margin), np.ceil(way[:, 0].max() + margin)
        road, parts = self.scene.road, []
        tracks = [(road.left, 0.0, max(way[:, 1].max(), 0.0) + margin / 2), (road.right, min(way[:, 1].min(), 0.0) - margin / 2, 0.0)]
        for segments, right, left in tracks:
            x, z = _course(profile_pieces(segments, road.start), float(x0), float(x1))
            cells = np.floor((x[1:] + x[:-1]) / 2).astype(int) % 2
            whole = meshes.strip(x, z, left, right)
            for shade, colour in enumerate(ROAD):
                kept = np.concatenate([cells == shade, cells == shade])
                if kept.any():
                    mesh = Mesh(points=whole.points, normals=whole.normals, faces=whole.faces[kept])
                    parts.append(Part(mesh=mesh, colour=colour, roughness=1.0))
        return Node(name="road", parts=tuple(parts), translation=np.zeros((1, 3)), about={"road": True})


def _course(pieces: list[Piece], first: float, last: float) -> tuple[Array, Array]:
    """Places along a road and its heights there, both sides of a step."""
    begins = [piece.begin for piece in pieces]
    x, z = [], []
    for index, piece in enumerate(pieces):
        start = first if index == 0 else begins[index]
        end = begins[index + 1] if index + 1 < len(begins) else last
        start, end = max(start, first), min(end, last)
        if end <= start:
            continue
        marks = np.unique(np.concatenate([[start, end], np.arange(np.ceil(start), end, 1.0), _bends(piece, start, end)]))
        x += marks.tolist()
        z += [piece.height(mark) for mark in marks]
    points = np.array([x, z])
    moves = np.concatenate([[True], np.abs(np.diff(points)).max(axis=0) > 1e-9])
    return points[0, moves], points[1, moves]


def _bends(piece: Piece, start: float, end: float) -> Array:
    return np.linspace(start, end, 40) if piece.kind == "cosine" else np.zeros(0)
