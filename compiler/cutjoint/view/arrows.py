"""Forces and reactions as arrows, as far as the scene's outputs have them whole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from cutjoint.elements.force import AxisForce, Compliance, LineForce, RoadContact, Wrench
from cutjoint.model.records import Force, Reaction
from cutjoint.view import meshes
from cutjoint.view.colours import FORCE, REACTION
from cutjoint.view.motions import along
from cutjoint.view.placed import Placed
from cutjoint.view.records import Array, Node, Part
from cutjoint.view.sizes import point_of

#: The longest arrow of all, as a share of the mechanism's extent.
_LONGEST = 0.3
#: The smallest share of the longest arrow that is drawn; a mesh of no size has no normals.
_SMALLEST = 1e-6
_COMPONENTS = ("Fx", "Fy", "Fz")


@dataclass(frozen=True, kw_only=True)
class Arrows(Placed):
    """The arrows of a run: ``columns`` (times,) by element and quantity; ``up`` (3,) is against gravity."""

    columns: Mapping[tuple[str, str], Array]
    up: Array

    def all(self) -> tuple[Node, ...]:
        """A node for each force and reaction, its arrow as long beside the longest of all as its force is."""
        found = [*self._forces(), *self._reactions()]
        largest = max((float(np.linalg.norm(push, axis=1).max()) for _, _, _, push in found), default=0.0)
        return tuple(self._arrow(*each, largest) for each in found) if largest > 0 else ()

    def _arrow(self, name: str, is_reaction: bool, place: Array, push: Array, largest: float) -> Node:
        length = _LONGEST * self.sizes.extent
        size = np.maximum(np.linalg.norm(push, axis=1) / largest, _SMALLEST)
        seen = np.where(np.linalg.norm(push, axis=1, keepdims=True) > _SMALLEST * largest, push, [0.0, 0.0, 1.0])
        part = Part(mesh=meshes.arrow(length), colour=REACTION if is_reaction else FORCE)
        return Node(
            name=f"{'reaction' if is_reaction else 'force'} {name}", parts=(part,), translation=place, rotation=along(seen),
            scale=np.repeat(size[:, np.newaxis], 3, axis=1), about={"arrow": name, "newton": largest, "length": length},
        )  # fmt: skip

    def _forces(self) -> Iterator[tuple[str, bool, Array, Array]]:
        for force in self.model.forces:
            if (found := self._push(force)) is not None:
                yield force.name, False, *found

    def _push(self, force: Force) -> tuple[Array, Array] | None:
        """The point at which a force acts on its follower or body, and the force (times, 3), N; None where outputs do not have it."""
        match force.interaction:
            case LineForce() as how if (tension := self._column(force.name, "force")) is not None:
                end = self.point(force, how.end)
                way = self.point(force, how.start) - end
                return end, tension * way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
            case AxisForce() as how if (push := self._column(force.name, "force")) is not None:
                return self.point(force, how.point), push * self.turn(how.axis.body(force), how.axis.of(force))
            case Compliance() as how if (parts := self._triple(force.name)) is not None:
                axes = np.stack([self.turn(how.frame.body(force), axis) for axis in how.frame.of(force)], axis=-1)
                return self.point(force, how.follower), _turned(axes, parts)
            case Wrench(point=point) if point.of(force) is not None and (parts := self._triple(force.name)) is not None:
                return self.point(force, point), _turned(self.poses[point.body(force)].rotation, parts) if force.has_frame else parts
            case RoadContact() as how if (load := self._column(force.name, "Fz")) is not None:
                radius = self.numbers.number(force.radius)
                return self.point(force, how.centre) - radius * self.up, load * self.up
        return None

    def _reactions(self) -> Iterator[tuple[str, bool, Array, Array]]:
        """The forces of joints on their followers."""
        joints = {joint.name: joint for joint in self.model.joints}
        for reaction in self.model.reactions:
            if not isinstance(reaction, Reaction):
                continue
            joint, axes = joints[reaction.joint], self.poses[reaction.body].rotation
            place = self.place(joint.follower, joint.to or joint.at)
            if reaction.direction is not None:
                if (push := self._column(reaction.name, "force")) is not None:
                    yield reaction.name, True, place, push * (axes @ point_of(self.numbers, reaction.direction))
            elif (parts := self._triple(reaction.name)) is not None:
                yield reaction.name, True, place, _turned(axes, parts)

    def _column(self, element: str, quantity: str) -> Array | None:
        """A quantity over time, (times, 1); None where it is no output, or has no value at some time."""
        values = self.columns.get((element, quantity))
        return None if values is None or not np.isfinite(values).all() else values[:, np.newaxis]

    def _triple(self, element: str) -> Array | None:
        parts = [self._column(element, quantity) for quantity in _COMPONENTS]
        known = [part for part in parts if part is not None]
        return np.concatenate(known, axis=1) if len(known) == len(parts) else None


def _turned(rotations: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("tij,tj->ti", rotations, vectors))
