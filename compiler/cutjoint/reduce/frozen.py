"""Joints that are frozen together: the carriers of their bodies, the places of these, and obstacles."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutjoint.model.records import GROUND, Body, Force, Joint, Model, Reaction, Scene
from cutjoint.reduce.records import Note, bodies_of
from cutjoint.reduce.sampling import Poses

#: A body that has moved by less when the scene starts stands where it was drawn (m and rad).
_SAME = 1e-9


@dataclass(frozen=True, kw_only=True)
class Frozen:
    """Joints that are frozen together."""

    model: Model
    poses: Mapping[str, Poses]
    joints: tuple[Joint, ...]

    @property
    def carriers(self) -> Mapping[str, str]:
        """For each body the one that it becomes a part of, or itself: the ground, or the first in the file."""
        order = {name: i for i, name in enumerate((GROUND, *(b.name for b in self.model.bodies)))}
        carrier = {name: name for name in order}
        for joint in self.joints:
            first, last = sorted((carrier[joint.base], carrier[joint.follower]), key=order.__getitem__)
            carrier = {name: first if b == last else b for name, b in carrier.items()}
        return carrier

    def shift(self, body: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The turn (3, 3) and the way (3,) from where the body is drawn to where it is at the start, as seen from its carrier."""
        seen = self.poses[body].seen_from(self.poses[self.carriers[body]])
        return seen.R[0], seen.r[0]

    def is_moved(self, body: str) -> bool:
        """Return whether the body is away from the place at which it is drawn."""
        turn, way = self.shift(body)
        return bool(max(np.abs(turn - np.eye(3)).max(), np.abs(way).max()) > _SAME)

    def problem(self, scene: Scene) -> tuple[Note, set[str]] | None:
        """The joints that cannot be frozen, and the reason."""
        carrier = self.carriers
        if all(carrier[b.name] == GROUND for b in self.model.bodies):
            return self._stays(self.joints[0], "nothing would move"), {j.name for j in self.joints}
        inner = [j for j in self.model.joints if carrier[j.base] == carrier[j.follower]]
        for joint in inner:
            if reason := _need(self.model, scene, joint):
                return self._stays(joint, reason), self._way_around(joint)
        for element in (*self.model.joints, *self.model.forces, *self.model.reactions):
            for body in sorted(_fixed_in(element, {j.name for j in inner}) - {GROUND}):
                if carrier[body] != body and self.is_moved(body):
                    return self._body_stays(body, f"'{element.name}' is drawn where '{body}' is not at the start")
        for output in (o for o in scene.outputs if carrier.get(o.element, o.element) == GROUND):
            return self._body_stays(output.element, f"the output '{output.column}' asks for it")
        for output in (o for o in scene.outputs if o.quantity in _ANGLES and carrier.get(o.element, o.element) != o.element):
            if self.is_moved(output.element):
                return self._body_stays(output.element, f"the output '{output.column}' asks for its attitude")
        return None

    def _stays(self, element: Joint | Body, reason: str) -> Note:
        return Note(element=element.name, words=f"is not frozen: {reason}", span=element.span)

    def _body_stays(self, body: str, reason: str) -> tuple[Note, set[str]]:
        note = self._stays(next(b for b in self.model.bodies if b.name == body), reason)
        return note, {j.name for j in self.joints if body in (j.base, j.follower)}

    def _way_around(self, joint: Joint) -> set[str]:
        """The joints that hold the two bodies of a joint together: itself, or one way between them."""
        if joint in self.joints:
            return {joint.name}
        ways: dict[str, set[str]] = {joint.base: set()}
        while joint.follower not in ways:
            for j in self.joints:
                for one, other in ((j.base, j.follower), (j.follower, j.base)):
                    if one in ways:
                        ways.setdefault(other, ways[one] | {j.name})
        return ways[joint.follower]


_ANGLES = ("roll", "pitch", "yaw")


def _need(model: Model, scene: Scene, joint: Joint) -> str:
    """The reason that a joint between frozen bodies is needed, "" if it is not."""
    forces = {f.name for f in model.forces if f.joint_of == joint.name}
    sensors = {r.name for r in model.reactions if getattr(r, "joint", "") == joint.name}
    asked = next((o.column for o in scene.outputs if o.element in forces | sensors | {joint.name}), "")
    return f"the output '{asked}' asks for it" if asked else ""


def _fixed_in(element: Any, inner: Collection[str]) -> set[str]:
    """The bodies in which an element that stays has parts that cannot be moved in one of them alone."""
    match element:
        case Joint():
            return set() if element.name in inner else bodies_of(element)
        case Reaction():
            return set() if element.joint in inner else bodies_of(element)
        case Force():
            return set(element.bodies) if element.has_frame else set()
    return bodies_of(element)
