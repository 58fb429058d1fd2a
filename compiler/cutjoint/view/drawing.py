"""From a model and the poses of its bodies to a drawing, and the camera of its page at the start.

Bodies are drawn by their meshes or shapes, else as bars between their attachment points.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cutjoint.elements.terms import JointKind
from cutjoint.model.records import GROUND, Body, Joint, Model, Scene, Shape, ShapeKind
from cutjoint.run.run_file import Evaluator
from cutjoint.view import meshes
from cutjoint.view.forces import Arrows, ForceNodes
from cutjoint.view.mesh_files import load_meshes
from cutjoint.view.motions import quaternions_of, rotated, rotation_to
from cutjoint.view.page import mark
from cutjoint.view.records import JOINT, Array, Colour, Drawing, Mesh, Node, Part, colours_of, read_colour
from cutjoint.view.sizes import Placed, Sizes, attached_points, point_of

#: A centre of mass within this distance of a bar, in radii, lies in it.
_WITHIN = 1.5
#: A body with at least so many attachment points, such as a chassis, is drawn as their convex hull.
_MANY = 6
_LONG = {JointKind.PRISMATIC, JointKind.CYLINDRICAL, JointKind.POINT_ON_LINE}
_TURNING = {JointKind.REVOLUTE, JointKind.SCREW, JointKind.UNIVERSAL}
#: The camera follows a body that moves further than this many extents of the mechanism; rotation about a pivot gives at most two.
_FAR = 3.0
#: The number of times at which a node's position is sampled.
_SAMPLES = 50


@dataclass(frozen=True, kw_only=True)
class BodyParts:
    """The drawn parts of bodies and joints, in the design position, by the body that moves them."""

    model: Model
    scene: Scene
    numbers: Evaluator
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
        held: dict[str, list[Array]] = {}
        for body, point in attached_points(self.model, self.scene):
            place, shapes = point_of(self.numbers, point), held.setdefault(body, [])
            if not any(np.linalg.norm(place - other) < 1e-3 * self.sizes.extent for other in shapes):
                shapes.append(place)
        return held

    def _body(self, body: Body, held: Sequence[Array], colour: Colour) -> Iterator[Part]:
        solid = load_meshes(body, self.numbers) or [mesh for shape in body.shapes if not shape.hole for mesh in self._shape(shape)]
        solid = solid or ([] if len(held) < _MANY else meshes.hull(np.array(held), 2 * self.sizes.bar))
        bars = [] if solid else list(self._bars(body, held))
        colours = [visual.colour for visual in body.visuals if visual.colour]
        yield Part(mesh=meshes.joined(solid or bars), colour=read_colour(colours[0]) if colours else colour)

    def _bars(self, body: Body, held: Sequence[Array]) -> Iterator[Mesh]:
        """Bars from the centre of mass to all points; one bar between two points if it contains the centre or there is none."""
        r, centre, is_massless = self.sizes.bar, point_of(self.numbers, body.centre_of_mass), body.is_massless
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
        own = [j for j in self.model.joints if body.name in (j.base, j.follower)]
        if len(held) == len(own) == 1 and not is_massless and np.linalg.norm(held[0] - centre) <= r:  # one joint alone turns it there
            turning = [j for j in own if j.kind in _TURNING and j.axes]
            yield from (meshes.disc(7 * r, 2 * r).moved(rotation_to(point_of(self.numbers, j.axes[-1])), centre) for j in turning)
        yield meshes.sphere(1.6 * r if len(held) > 1 or is_massless else 3 * r).moved(np.eye(3), centre)

    def _shape(self, shape: Shape) -> Iterator[Mesh]:
        places = [point_of(self.numbers, point) for point in shape.points]
        sizes = [self.numbers(size) for size in shape.sizes]
        axes = [point_of(self.numbers, axis) for axis in shape.axes]
        match shape.kind:
            case ShapeKind.BOX:
                a, b, c = sizes
                x, y = axes[:2]  # mirrored axes are left-handed; a box is symmetric about the third
                yield meshes.box(a, b, c).moved(np.stack([x, y, np.cross(x, y)], axis=1), places[0])
            case ShapeKind.CYLINDER:
                yield meshes.disc(sizes[0], sizes[1]).moved(rotation_to(axes[0]), places[0])
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
    way = end - start
    share = np.clip((point - start) @ way / (way @ way), 0.0, 1.0)
    return float(np.linalg.norm(point - start - share * way))


def draw(placed: Placed, t: Array, *, failed: str = "", columns: Mapping[tuple[str, str], Array] | None = None) -> Drawing:
    """The drawing of a mechanism at times ``t`` (times,), s, each body at its centre of mass; the element that ``failed`` is marked.

    Forces and reactions that ``columns`` (times,) by element and quantity have are arrows.
    """
    model, numbers = placed.model, placed.numbers
    up = up_of(numbers, model)
    parts = BodyParts(model=model, scene=placed.scene, numbers=numbers, sizes=placed.sizes).all()
    nodes = [Node(name=GROUND, parts=parts[GROUND], translation=np.zeros((1, 3)))]
    for body in model.bodies:
        centre, pose = point_of(numbers, body.centre_of_mass), placed.poses[body.name]
        own = tuple(replace(part, mesh=replace(part.mesh, points=part.mesh.points - centre)) for part in parts[body.name])
        place, turn = pose.place(centre), quaternions_of(pose.rotation)
        nodes.append(Node(name=body.name, parts=own, translation=place, rotation=turn, about={"body": body.name}))
    forces = ForceNodes(model=model, scene=placed.scene, numbers=numbers, sizes=placed.sizes, poses=placed.poses, up=up)
    arrows = Arrows(model=model, scene=placed.scene, numbers=numbers, sizes=placed.sizes, poses=placed.poses, up=up, columns=columns or {})
    return Drawing(name=model.name, t=t, nodes=(*nodes, *forces.all(), *mark(placed, failed), *arrows.all()), up=up)


def up_of(numbers: Evaluator, model: Model) -> Array:
    """The direction against gravity, (3,); z without gravity."""
    gravity = point_of(numbers, model.gravity)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])


def find_camera(placed: Placed, drawing: Drawing) -> dict[str, Any]:
    """The camera of a page at its start looks from the side if all rotation axes are parallel, else from ahead, the left and above.

    Its "direction" (3,) goes to the eye in the model's axes, "extent" is the mechanism's, "floor" the height of the ground along up, m;
    "road" is whether there is a road, "follow" the body that stays in the middle, "" for none.
    """
    model, sizes = placed.model, placed.sizes
    return {
        "direction": _direction(model, placed.numbers, drawing.up).tolist(), "extent": sizes.extent, "floor": _floor(sizes, drawing),
        "road": any(force.has_road for force in model.forces), "follow": _followed(placed),
    }  # fmt: skip


def _direction(model: Model, numbers: Evaluator, up: Array) -> Array:
    axes = [point_of(numbers, joint.axes[0]) for joint in model.joints if joint.axes and "rad" in joint.element.units.values()]
    level = rotation_to(up)  # axes of an upright observer
    across = axes[0] if axes else None
    if across is not None and all(np.linalg.norm(np.cross(across, axis)) < 1e-6 for axis in axes) and abs(across @ up) < 0.5:
        right = np.cross(up, across)
        side = across if right @ np.ones(3) > 0 else -across
        return np.asarray(side + 0.28 * up + 0.30 * np.cross(up, side))
    return np.asarray(level @ np.array([0.85, 1.0, 0.55]))


def _floor(sizes: Sizes, drawing: Drawing) -> float:
    """A height slightly below the lowest point at any time."""
    lowest = [_lowest(node, drawing.up) for node in drawing.nodes if node.parts and "arrow" not in node.about]
    return min(lowest, default=0.0) - 0.02 * sizes.extent


def _lowest(node: Node, up: Array) -> float:
    """The lowest point of a node at some of its times."""
    rows = max(len(node.translation), len(node.rotation), len(node.scale))
    kept = np.unique(np.linspace(0, rows - 1, _SAMPLES).astype(int))
    places, turns, scales = (track[np.minimum(kept, len(track) - 1)] for track in (node.translation, node.rotation, node.scale))
    seen_up = rotated(turns * [-1, -1, -1, 1], np.broadcast_to(up, (len(kept), 3))) * scales
    points = np.concatenate([part.mesh.points for part in node.parts])
    return float((places @ up + (points @ seen_up.T).min(axis=0)).min())


def _followed(placed: Placed) -> str:
    """The heaviest body if it moves far, else none."""
    if not placed.model.bodies:
        return ""
    body = max(placed.model.bodies, key=lambda b: placed.numbers(b.mass))
    way = placed.place(body.name, body.centre_of_mass)
    return body.name if np.ptp(way, axis=0).max() > _FAR * placed.sizes.extent else ""
