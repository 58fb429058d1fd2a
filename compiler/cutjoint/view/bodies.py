"""Drawn bodies: their meshes or shapes, else bars between their attachment points."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cutjoint.elements.terms import JointKind
from cutjoint.export.laws import Numbers
from cutjoint.model.records import GROUND, Body, Joint, Model, Scene, Shape, ShapeKind
from cutjoint.view import meshes
from cutjoint.view.mesh_files import load_meshes
from cutjoint.view.motions import rotation_to
from cutjoint.view.records import JOINT, Array, Colour, Mesh, Part, colours_of, read_colour
from cutjoint.view.sizes import Sizes, attached_points, point_of

#: A centre of mass within this distance of a bar, in radii, lies in it.
_WITHIN = 1.5
#: A body with at least so many attachment points, such as a chassis, is drawn as their convex hull.
_MANY = 6
_LONG = {JointKind.PRISMATIC, JointKind.CYLINDRICAL, JointKind.POINT_ON_LINE}
_TURNING = {JointKind.REVOLUTE, JointKind.SCREW, JointKind.UNIVERSAL}


@dataclass(frozen=True, kw_only=True)
class BodyParts:
    """The drawn parts of bodies and joints, in the design position, by the body that moves them."""

    model: Model
    scene: Scene
    numbers: Numbers
    sizes: Sizes

    def all(self) -> Mapping[str, tuple[Part, ...]]:
        """The parts of each body, the ground first."""
        parts: dict[str, list[Part]] = {GROUND: []}
        colours, held = colours_of([body.name for body in self.model.bodies]), self._attachments()
        for body in self.model.bodies:
            parts[body.name] = list(self._body(body, held.get(body.name, []), colours[body.name]))
        for joint in self.model.joints:
            parts[joint.base] += [Part(mesh=mesh, colour=JOINT) for mesh in self._joint(joint)]
        return {name: tuple(shapes) for name, shapes in parts.items()}

    def _attachments(self) -> dict[str, list[Array]]:
        """The distinct attachment points of each body."""
        held: dict[str, list[Array]] = {}
        for body, point in attached_points(self.model, self.scene):
            place, shapes = point_of(self.numbers, point), held.setdefault(body, [])
            if not any(np.linalg.norm(place - other) < 1e-3 * self.sizes.extent for other in shapes):
                shapes.append(place)
        return held

    def _body(self, body: Body, held: Sequence[Array], colour: Colour) -> Iterator[Part]:
        solid = load_meshes(body, self.numbers) or [mesh for shape in body.shapes if not shape.hole for mesh in self._shape(shape)]
        solid = solid or ([] if len(held) < _MANY else meshes.hull(np.array(held), 2 * self.sizes.bar))
        bars = [] if solid else list(self._bars(point_of(self.numbers, body.centre_of_mass), held, is_massless=body.is_massless))
        colours = [visual.colour for visual in body.visuals if visual.colour]
        yield Part(mesh=meshes.joined(solid or bars), colour=read_colour(colours[0]) if colours else colour)

    def _bars(self, centre: Array, held: Sequence[Array], *, is_massless: bool) -> Iterator[Mesh]:
        """Bars from the centre of mass to all points; one bar between two points if it contains the centre or there is none."""
        r = self.sizes.bar
        if len(held) == 2 and (is_massless or _distance(centre, *held) < _WITHIN * r):
            yield meshes.between(held[0], held[1], r)
            if not is_massless:
                yield meshes.sphere(1.6 * r).moved(np.eye(3), centre)
            return
        if is_massless and held:
            centre = np.mean(held, axis=0)
        for point in held:
            if np.linalg.norm(point - centre) > r:
                yield meshes.between(centre, point, r)
        yield meshes.sphere(1.6 * r if len(held) > 1 else 3 * r).moved(np.eye(3), centre)

    def _shape(self, shape: Shape) -> Iterator[Mesh]:
        places = [point_of(self.numbers, point) for point in shape.points]
        sizes = [self.numbers.number(size) for size in shape.sizes]
        axes = [point_of(self.numbers, axis) for axis in shape.axes]
        match shape.kind:
            case ShapeKind.BOX:
                a, b, c = sizes
                x, y = axes[:2]  # mirrored axes are left-handed; a box is symmetric about the third
                yield meshes.box(a, b, c).moved(np.stack([x, y, np.cross(x, y)], axis=1), places[0])
            case ShapeKind.CYLINDER:
                yield meshes.cylinder(sizes[0], sizes[1], 40).moved(rotation_to(axes[0]), places[0])
            case ShapeKind.SPHERE:
                yield meshes.sphere(sizes[0]).moved(np.eye(3), places[0])
            case ShapeKind.ROD:
                yield meshes.between(places[0], places[1], self.sizes.bar)
            case ShapeKind.POINT:
                yield meshes.sphere(2.2 * self.sizes.bar).moved(np.eye(3), places[0])

    def _joint(self, joint: Joint) -> Iterator[Mesh]:
        """A pin for a rotation about an axis, a bar for a displacement along one, a ball for other joints."""
        r, at = self.sizes.joint, point_of(self.numbers, joint.at)
        axes = [point_of(self.numbers, axis) for axis in joint.axes]
        if joint.element.is_free:
            return
        if joint.kind in _TURNING and axes:
            for axis in axes:
                yield meshes.cylinder(0.8 * r, 2.6 * r).moved(rotation_to(axis), at)
        elif joint.kind in _LONG and axes:
            yield meshes.box(1.5 * r, 1.5 * r, 5 * r).moved(rotation_to(axes[0]), at)
        elif joint.element.is_rigid:
            yield meshes.box(1.6 * r, 1.6 * r, 1.6 * r).moved(np.eye(3), at)
        else:
            yield meshes.sphere(r).moved(np.eye(3), at)


def _distance(point: Array, start: Array, end: Array) -> float:
    """The distance of a point from a line between two points."""
    way = end - start
    share = np.clip((point - start) @ way / (way @ way), 0.0, 1.0)
    return float(np.linalg.norm(point - start - share * way))
