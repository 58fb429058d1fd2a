"""The poses of all bodies over time, by interpretation of the tree's kinematics or of natural coordinates."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.analysis.embedding.fits import refit
from cutjoint.formulate.inputs import INPUTS, LAW_TIME
from cutjoint.formulate.natural.poses import Span, SpanEquations
from cutjoint.formulate.recursive.embedding.dependent import fitted_inputs
from cutjoint.formulate.recursive.kinematics import PoseEquations
from cutjoint.program.blocks import Block
from cutjoint.program.interpret import interpret_blocks

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class BodyPose:
    """A body at some times: its point p (in the design position) is at ``rotation`` (times, 3, 3) p + ``shift`` (times, 3), m."""

    rotation: Array
    shift: Array

    def place(self, point: Array) -> Array:
        """The position of a point (3,) of the design position over time, (times, 3)."""
        return np.asarray(self.rotation @ point + self.shift)

    def rotate(self, direction: Array) -> Array:
        """The direction (3,) of the design position over time, (times, 3)."""
        return np.asarray(self.rotation @ direction)


def find_poses(equations: PoseEquations, t: Array, q: Array, parameters: Mapping[str, float]) -> Mapping[str, BodyPose]:
    """The poses of all bodies at times ``t`` (times,), s, with coordinates ``q`` (times, coordinates) and tunable ``parameters``, in SI."""
    inputs = _inputs(equations, t, q, parameters)
    found = interpret_blocks([*equations.rotations.values(), *equations.shifts.values()], {**inputs, "motion": np.zeros(1)}, {})
    return {
        body: BodyPose(
            rotation=np.broadcast_to(found[R], (t.size, 3, 3)), shift=np.broadcast_to(found[equations.shifts[body]], (t.size, 3, 1))[..., 0]
        )
        for body, R in equations.rotations.items()
    }


def _inputs(equations: PoseEquations, t: Array, q: Array, parameters: Mapping[str, float]) -> dict[str, Array]:
    values = np.array([parameters[p.name] for p in equations.parameters])
    laws = interpret_blocks(equations.laws, {LAW_TIME: t[:, np.newaxis], "parameters": values}, {})
    law_values = [np.broadcast_to(laws[law][..., 0], (t.size, 1)) for law in equations.laws]
    tunable = [a for a in equations.topology.model.embedded_loops if a.functions.open]
    fitted = (replace(a, functions=refit(equations.topology, a, parameters)) for a in tunable)
    return {
        "t": t[:, np.newaxis],
        "parameters": values,
        **fitted_inputs(fitted),
        INPUTS: np.concatenate([np.zeros((t.size, 0)), *law_values], axis=1),
        **{f"q:{c.joint}": q[:, c.q : c.q + len(c.coordinate_names)] for c in equations.charts},
    }


def find_dependent_joints(
    equations: PoseEquations, t: Array, q: Array, v: Array, parameters: Mapping[str, float]
) -> Mapping[str, tuple[Array, Array]]:  # fmt: skip
    """Coordinates (times, n) and speeds (times, k) of dependent joints, from those of the others; other arguments as of `find_poses`."""
    speeds = {f"v:{c.joint}": v[:, c.v : c.v + len(c.speed_names)] for c in equations.charts}
    inputs = {**_inputs(equations, t, q, parameters), **speeds, "motion": np.ones(1)}
    found = interpret_blocks([block for pair in equations.followers.values() for block in pair], inputs, {})
    return {
        joint: (np.broadcast_to(found[place], (t.size, *place.shape))[..., 0], np.broadcast_to(found[rate], (t.size, *rate.shape))[..., 0])
        for joint, (place, rate) in equations.followers.items()
    }


def find_spanned_poses(equations: SpanEquations, q: Array, parameters: Mapping[str, float]) -> Mapping[str, BodyPose]:
    """The poses of all bodies that move, from natural coordinates ``q`` (times, coordinates) and tunable ``parameters``, SI units.
    A body that two points span, such as a massless rod, has no attitude about its line; here it does not rotate about that line."""
    inputs = {"parameters": np.array([parameters[p.name] for p in equations.parameters])}
    first = 0
    for name, size in equations.coordinates:
        inputs[name] = q[:, first : first + size]
        first += size
    blocks = [block for span in equations.spans.values() for mark in (span.point, *span.arms) for block in (mark.design, mark.now)]
    found = interpret_blocks(blocks, inputs, {})
    values = {block: np.broadcast_to(found[block], (len(q), 3, 1))[..., 0] for block in blocks}
    return {body: _spanned_pose(span, values) for body, span in equations.spans.items()}


def _spanned_pose(span: Span, values: Mapping[Block, Array]) -> BodyPose:
    marks = (span.point, *span.arms)
    design, now = [values[m.design] for m in marks], [values[m.now] for m in marks]
    if len(span.arms) > 1:
        rotation = _nearest(np.stack(now[1:], axis=-1) @ np.stack(design[1:], axis=-1).swapaxes(-1, -2))
    else:
        rotation = _transformed(design[1][0], now[1]) if span.arms else np.broadcast_to(np.eye(3), (len(now[0]), 3, 3))
    return BodyPose(rotation=rotation, shift=now[0] - np.einsum("tij,tj->ti", rotation, design[0]))


def _nearest(products: Array) -> Array:
    """The rotations (times, 3, 3) nearest to the sums of now design^T over the arms (Kabsch, Acta Crystallographica A 32, 1976)."""
    left, _, right = np.linalg.svd(products)
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[:, np.newaxis]
    return np.asarray(left @ right)


def _transformed(design: Array, now: Array) -> Array:
    """Rotations (times, 3, 3) from a direction (3,) to those of ``now`` (times, 3), each by the smallest rotation from the one before."""
    rotation, before, rotations = np.eye(3), design / np.linalg.norm(design), []
    for direction in now / np.linalg.norm(now, axis=1, keepdims=True):
        rotation = _smallest_rotation(before, direction) @ rotation
        rotations.append(rotation)
        before = direction
    return np.array(rotations)


def _smallest_rotation(start: Array, end: Array) -> Array:
    """The rotation matrix (3, 3) from a unit vector to another, by Rodrigues' formula."""
    x, y, z = np.cross(start, end)
    skew, cosine = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), float(start @ end)
    if cosine < -1 + 1e-12:  # half a turn about any perpendicular direction
        across = np.cross(start, np.eye(3)[np.abs(start).argmin()])
        across /= np.linalg.norm(across)
        return np.asarray(2 * np.outer(across, across) - np.eye(3))
    return np.asarray(np.eye(3) + skew + skew @ skew / (1 + cosine))
