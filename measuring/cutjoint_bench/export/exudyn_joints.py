"""Joints -> constraints of Exudyn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cutjoint.elements.joint import (
    AXIAL_FRAME,
    DESIGN_FRAME,
    IN_PLANE,
    ON_LINE,
    PERPENDICULAR,
    Condition,
    Direction,
    JointElement,
    SameAttitude,
    SameDirection,
    SameDistance,
    SamePoint,
    Translation,
)
from cutjoint.model.errors import Problem
from cutjoint.model.records import Model, Scene
from cutjoint_bench.export.chains import Frame, frame, triple
from cutjoint_bench.export.independence import Row, independent_rows
from cutjoint_bench.export.laws import Array
from cutjoint_bench.export.records import Mechanism, PeerJoint

#: The slides along and turns about a joint's frame that a condition locks; the joint's axis is the frame's third.
_LOCKED_BY: Mapping[Condition, tuple[int, ...]] = {
    SamePoint(): (1, 1, 1, 0, 0, 0),
    ON_LINE: (1, 1, 0, 0, 0, 0),
    IN_PLANE: (0, 0, 1, 0, 0, 0),
    SameDistance(): (0, 0, 1, 0, 0, 0),
    PERPENDICULAR: (0, 0, 0, 1, 0, 0),
    SameDirection(Direction.AXIS): (0, 0, 0, 1, 1, 0),
    SameAttitude(AXIAL_FRAME): (0, 0, 0, 1, 1, 1),
    SameAttitude(DESIGN_FRAME): (0, 0, 0, 1, 1, 1),
}


def locked(element: JointElement) -> tuple[int, ...]:
    """Directions of a joint's frame that its kind locks, 1 for each."""
    return tuple(map(max, zip((0,) * 6, *(_LOCKED_BY[c] for c in element.conditions), strict=True)))


#: The locked motions of a frame, in words.
_WORDS = ("across 1", "across 2", "along", "turn 1", "turn 2", "turn 3")


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """A joint with the frame that base and follower carry at the start, a row for each axis.
    Also what of the base's axes is locked."""

    joint: PeerJoint
    axes: Frame
    locked: tuple[int, ...]

    @property
    def rows(self) -> list[Row]:
        """Its equations."""
        joint = self.joint
        return [
            Row(base=joint.base, follower=joint.follower, direction=self.axes[i % 3], point=joint.follower_point if i < 3 else None)
            for i, lock in enumerate(self.locked) if lock
        ]  # fmt: skip

    def keep(self, kept: Sequence[bool]) -> Constraint:
        """The constraint with only those of its equations that are ``kept``."""
        remaining = iter(kept)
        return replace(self, locked=tuple(int(lock and next(remaining)) for lock in self.locked))

    @property
    def words(self) -> str:
        """Locked directions, in words."""
        return ", ".join(word for word, lock in zip(_WORDS, self.locked, strict=True) if lock)


def constrain(joint: PeerJoint) -> Constraint:
    """The constraint of a joint."""
    if PERPENDICULAR in joint.element.conditions:
        # its equation: the base's second axis and the follower's third one are across each other
        first, second = np.array(joint.base_axes[0]), np.array(joint.follower_axes[1])
        axes = triple(np.cross(first, second)), triple(first), triple(second)
        return Constraint(joint=joint, axes=axes, locked=locked(joint.element))
    return Constraint(joint=joint, axes=frame(_axis(joint)), locked=locked(joint.element))


def _axis(joint: PeerJoint) -> Array:
    """A joint's axis, or the line between its points; any for a ball."""
    if SameDistance() in joint.element.conditions:
        return np.subtract(joint.follower_point, joint.base_point)
    return np.array(joint.base_axes[0] if joint.base_axes else (0.0, 0.0, 1.0))


def independent_cuts(model: Model, scene: Scene, mechanism: Mechanism) -> tuple[list[Constraint], list[Constraint]]:
    """The cut joints with their independent rows, and with the rows that are left out because they follow from the rest."""
    cuts = [constrain(cut) for cut in mechanism.cuts]
    rows = [row for cut in cuts for row in cut.rows]
    chosen = set(independent_rows(model, scene, mechanism, rows))
    flags = iter(i in chosen for i in range(len(rows)))
    kept_flags = [[next(flags) for _ in cut.rows] for cut in cuts]
    kept = [cut.keep(flags) for cut, flags in zip(cuts, kept_flags, strict=True)]
    left = [cut.keep([not flag for flag in flags]) for cut, flags in zip(cuts, kept_flags, strict=True)]
    return [cut for cut in kept if any(cut.locked)], [cut for cut in left if any(cut.locked)]


def joint_problems(mechanism: Mechanism) -> list[Problem]:
    """Joints that Exudyn does not have."""
    problems = []
    for joint in (*mechanism.tree, *mechanism.cuts):
        if not all(condition in _LOCKED_BY for condition in joint.element.conditions):
            problems.append(_problem(joint, f"Exudyn has no joint of kind {joint.kind}", "write a revolute or a cylindrical joint"))
        elif joint.guide and joint.element.chain != (Translation("displacement", Direction.AXIS),):
            message = f"a joint of kind {joint.kind} that time moves is not exported to Exudyn"
            problems.append(_problem(joint, message, "guide a prismatic joint, or give its input a constant value"))
    return problems


def _problem(joint: PeerJoint, message: str, hint: str) -> Problem:
    return Problem(span=joint.span, element=f"joint '{joint.name}'", message=message, hint=hint)
