"""The poses of all bodies over time, by interpretation of the tree's kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.formulate.inputs import INPUTS
from cutjoint.formulate.recursive.poses import PoseEquations
from cutjoint.formulate.scene_inputs import LAW_TIME
from cutjoint.program.interpret import interpret_blocks

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class BodyPose:
    """A body at some times: its point p of the design position is at ``rotation`` (times, 3, 3) p + ``shift`` (times, 3), m."""

    rotation: Array
    shift: Array

    def place(self, point: Array) -> Array:
        """Where a point (3,) of the design position is, (times, 3)."""
        return np.asarray(self.rotation @ point + self.shift)

    def turn(self, direction: Array) -> Array:
        """Where a direction (3,) of the design position points, (times, 3)."""
        return np.asarray(self.rotation @ direction)


def find_poses(equations: PoseEquations, t: Array, q: Array, parameters: Mapping[str, float]) -> Mapping[str, BodyPose]:
    """The poses of all bodies at times ``t`` (times,), s, with coordinates ``q`` (times, coordinates) and open ``parameters``, SI units."""
    values = np.array([parameters[p.name] for p in equations.parameters])
    laws = interpret_blocks(equations.laws, {LAW_TIME: t[:, np.newaxis], "parameters": values}, {})
    given = [np.broadcast_to(laws[law][..., 0], (t.size, 1)) for law in equations.laws]
    inputs = {
        "t": t[:, np.newaxis],
        "parameters": values,
        "motion": np.zeros(1),
        INPUTS: np.concatenate([np.zeros((t.size, 0)), *given], axis=1),
        **{f"q:{c.joint}": q[:, c.q : c.q + len(c.coordinate_names)] for c in equations.charts},
    }
    found = interpret_blocks([*equations.rotations.values(), *equations.shifts.values()], inputs, {})
    return {
        body: BodyPose(
            rotation=np.broadcast_to(found[R], (t.size, 3, 3)), shift=np.broadcast_to(found[equations.shifts[body]], (t.size, 3, 1))[..., 0]
        )
        for body, R in equations.rotations.items()
    }
