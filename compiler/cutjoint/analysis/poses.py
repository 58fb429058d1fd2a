"""Poses that close the loops: the design position and others around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutjoint.analysis.closing import Array, close_loops, design_coordinates, evaluate_closures, retract
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.topology.conditioning import TOLERANCE

#: The number of wanted poses besides the design position, and of trials for one.
NEIGHBOURS = 4
_ATTEMPTS = 16
#: The first try steps this far (m, rad) in the coordinate that moves most; one that finds no pose halves the step, down to the smallest.
_STEP, _SMALLEST = 0.25, 0.015


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Coordinates, whether they close the loops, the cut joints' Jacobian there (equations, speeds), and its singular values."""

    q: Array
    closed: bool
    jacobian: Array
    singular_values: Array

    @property
    def rank(self) -> int:
        """Independent equations."""
        return int(np.sum(self.singular_values > TOLERANCE * self.singular_values.max(initial=0.0)))

    @property
    def condition(self) -> float:
        """The largest singular value by the smallest that is not zero; one where all are."""
        return float(self.singular_values[0] / self.singular_values[self.rank - 1]) if self.rank else 1.0

    @property
    def free(self) -> Array:
        """The speeds that the equations leave free, as columns."""
        m, n = self.jacobian.shape
        return np.linalg.svd(self.jacobian, full_matrices=m < n)[2][self.rank :].T if m and n else np.eye(n)


def explore(equations: RecursiveEquations) -> tuple[Pose, ...]:
    """The design position, closed again where guides have moved it, then up to four poses that random steps along free motions reach.

    The steps have a fixed seed.  A rigid mechanism has no other pose, and one that cannot be closed is left in its design position.
    """
    design = design_coordinates(equations)
    start = close_loops(equations, design)
    if start is None:
        return (_pose(design, evaluate_closures(equations, design)[1], closed=False),)
    poses = [_pose(*start)]
    free, rng, step = poses[0].free, np.random.default_rng(0), _STEP
    for _ in range(_ATTEMPTS if free.size else 0):
        way = free @ rng.standard_normal(free.shape[1])
        way /= np.abs(way).max()
        found = close_loops(equations, retract(equations, start[0], step * way), across=way)
        if found is None or not step / 8 < np.abs(found[0] - start[0]).max() < 8 * step:
            step = max(step / 2, _SMALLEST)
            continue
        poses.append(_pose(*found))
        if len(poses) > NEIGHBOURS:
            break
    return tuple(poses)


def _pose(q: Array, jacobian: Array, closed: bool = True) -> Pose:
    values = np.asarray(np.linalg.svd(jacobian, compute_uv=False) if jacobian.size else [], dtype=np.float64)
    return Pose(q=q, closed=closed, jacobian=jacobian, singular_values=values)
