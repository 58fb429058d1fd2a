"""The condition of the equations of loops in the design position."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cutjoint.model.records import Joint
from cutjoint.topology.elimination import degrees
from cutjoint.topology.geometry import Array, JointGeometry
from cutjoint.topology.records import TreeJoint
from cutjoint.topology.spanning_tree import loops_of

#: A singular value below this share of the largest counts as zero.
TOLERANCE = 1e-9


def loop_condition(geometry: JointGeometry, tree: Sequence[TreeJoint], cuts: Sequence[Joint], cut: Joint) -> float:
    """The condition of the equations of a cut joint's loop and of the loops that share a joint with it: the largest singular value by the
    smallest that is not zero."""
    around = loops_of(tree, cuts)
    mine = {t.joint.name for t in around[cut.name]}
    near = [(other, around[other.name]) for other in cuts if any(t.joint.name in mine for t in around[other.name])]
    jacobian = design_jacobian(geometry, near)
    values = np.linalg.svd(jacobian, compute_uv=False) if jacobian.size else np.zeros(0)
    positive = values[values > TOLERANCE * values.max(initial=0.0)]
    return float(positive[0] / positive[-1]) if positive.size else 1.0


def design_jacobian(geometry: JointGeometry, loops: Sequence[tuple[Joint, Sequence[TreeJoint]]]) -> Array:
    """d rate / d v of cut joints with the tree joints around their loops; the columns are those joints' speeds as they are met."""
    columns: dict[str, slice] = {}
    end = 0
    for t in (t for _, around in loops for t in around):
        if t.joint.name not in columns:
            columns[t.joint.name] = slice(end, end + degrees(t.joint))
            end += degrees(t.joint)
    rows = [np.zeros((0, end))]
    for cut, around in loops:
        held = geometry.held(cut)
        rows.append(np.zeros((held.shape[0], end)))
        for sign, t in _along(cut, around):
            rows[-1][:, columns[t.joint.name]] = sign * held @ geometry.freed(t)
    return np.concatenate(rows)


def _along(cut: Joint, around: Sequence[TreeJoint]) -> list[tuple[float, TreeJoint]]:
    """The joints from follower to base with the sign of their twist in that of the follower beside the base."""
    body, signed = cut.follower, []
    for t in around:
        inwards = t.child == body
        signed.append((1.0 if inwards else -1.0, t))
        body = t.parent if inwards else t.child
    return signed
