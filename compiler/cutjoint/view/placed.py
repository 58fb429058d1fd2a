"""A mechanism at the times of a drawing: where points and directions of its bodies are then."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.analysis.body_poses import BodyPose
from cutjoint.elements.force import Point
from cutjoint.export.laws import Numbers
from cutjoint.model.records import Force, Model, Scene, Vector
from cutjoint.view.records import Array
from cutjoint.view.sizes import Sizes, point_of


@dataclass(frozen=True, kw_only=True)
class Placed:
    """A model in a scene, its numbers and sizes, and the ``poses`` of all bodies, of the ground too."""

    model: Model
    scene: Scene
    numbers: Numbers
    sizes: Sizes
    poses: Mapping[str, BodyPose]

    def place(self, body: str, point: Vector) -> Array:
        """The place of a body's point over time, (times, 3)."""
        return self.poses[body].place(point_of(self.numbers, point))

    def point(self, force: Force, point: Point) -> Array:
        """The place over time of a point at which a force acts, (times, 3)."""
        return self.place(point.body(force), point.of(force))

    def turn(self, body: str, direction: Vector) -> Array:
        """The direction over time of a vector fixed in a body, (times, 3)."""
        return self.poses[body].turn(point_of(self.numbers, direction))
