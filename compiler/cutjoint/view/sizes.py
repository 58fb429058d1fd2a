"""The sizes of drawn parts, by the extent of the mechanism in its design position, and its places and directions over time."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from cutjoint.analysis.body_poses import BodyPose
from cutjoint.elements.interaction import Point, Visual, Wheel
from cutjoint.formulate.forces import is_active
from cutjoint.model.records import Force, Model, Scene, Shape, ShapeKind, Vector
from cutjoint.run.run_file import Evaluator
from cutjoint.view.records import Array


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """The ``extent`` of a mechanism, the radii of bars, joints and coils, and the length of a coil between points that are one, m."""

    extent: float
    bar: float
    joint: float
    spring: float
    shortest: float


def point_of(numbers: Evaluator, point: Vector) -> Array:
    """A point or direction of the design position as numbers (3,)."""
    return np.array([numbers(x) for x in point])


def force_points(force: Force) -> Iterator[tuple[str, Vector]]:
    """The attachment points of a force, each with its body; a load has none."""
    if force.interaction.holds_bodies:
        yield from ((place.body(force), place.of(force)) for place in force.places if isinstance(place, Point))


def named_visuals(force: Force) -> Iterator[tuple[str, Visual]]:
    """The shapes of a force: the first has its name, others a number too."""
    for number, visual in enumerate(force.interaction.visuals(), start=1):
        yield (force.name if number == 1 else f"{force.name} {number}"), visual


def attached_points(model: Model, scene: Scene) -> Iterator[tuple[str, Vector]]:
    """The points in which joints and forces hold bodies, each with its body; a free joint holds nothing."""
    for joint in model.joints:
        if not joint.element.is_free:
            yield from ((joint.base, joint.at), (joint.follower, joint.to or joint.at))
    for force in model.forces:
        if is_active(force, scene):
            yield from force_points(force)


def find_sizes(model: Model, scene: Scene, numbers: Evaluator) -> Sizes:
    """The sizes for a model: its extent is that of all points in the design position, and of the shapes around them."""
    corners = [point_of(numbers, body.centre_of_mass) for body in model.bodies]
    corners += [point_of(numbers, point) for _, point in attached_points(model, scene)]
    for body in model.bodies:
        corners += [corner for shape in body.shapes for corner in _corners(numbers, shape)]
    for force in model.forces:
        for wheel in (visual for visual in force.interaction.visuals() if isinstance(visual, Wheel)):
            centre, radius = point_of(numbers, wheel.at.of(force)), numbers(force.radius)
            corners += [centre - radius, centre + radius]
    extent = float(np.linalg.norm(np.ptp(np.array(corners), axis=0))) if corners else 0.0
    extent = extent if extent > 0 else 1.0
    # the shortest coil as `templates/view/page/sliders.js` has it
    return Sizes(extent=extent, bar=0.011 * extent, joint=0.019 * extent, spring=0.026 * extent, shortest=0.013 * extent)


def _corners(numbers: Evaluator, shape: Shape) -> Iterator[Array]:
    """Corners of a box around a shape; one that is larger is of no harm."""
    centre = point_of(numbers, shape.points[0])
    if shape.kind is ShapeKind.BOX:
        sides = np.abs(np.array([point_of(numbers, axis) for axis in shape.axes])).T @ [numbers(s) for s in shape.sizes] / 2
    elif shape.kind is ShapeKind.CYLINDER:
        radius, length = (numbers(s) for s in shape.sizes)
        axis = np.abs(point_of(numbers, shape.axes[0]))
        sides = length / 2 * axis + radius * np.sqrt(np.maximum(0.0, 1 - axis**2))
    else:
        sides = np.full(3, numbers(shape.sizes[0]) if shape.sizes else 0.0)
        for point in shape.points[1:]:
            yield point_of(numbers, point)
    yield from (centre - sides, centre + sides)


@dataclass(frozen=True, kw_only=True)
class Placed:
    """A model in a scene, its numbers and sizes, and the ``poses`` of all bodies, of the ground too."""

    model: Model
    scene: Scene
    numbers: Evaluator
    sizes: Sizes
    poses: Mapping[str, BodyPose]

    def place(self, body: str, point: Vector) -> Array:
        """The place of a body's point over time, (times, 3)."""
        return self.poses[body].place(point_of(self.numbers, point))

    def point(self, force: Force, point: Point) -> Array:
        """The place over time of a point at which a force acts, (times, 3)."""
        return self.place(point.body(force), point.of(force))

    def rotate(self, body: str, direction: Vector) -> Array:
        """The direction over time of a vector fixed in a body, (times, 3)."""
        return self.poses[body].rotate(point_of(self.numbers, direction))
