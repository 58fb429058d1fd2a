"""Joints in the design position in numbers: twists of tree joints, constraints of cut joints, and their condition numbers."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TypeAlias

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.kernels import closures
from cutjoint.kernels.closures import derive_closure
from cutjoint.kernels.joints import QUATERNION, derive_joint, inner_point
from cutjoint.model.expressions.evaluate import evaluate as value_of
from cutjoint.model.records import Joint, Model, Scalar
from cutjoint.topology.measured import directed
from cutjoint.topology.records import TreeJoint, degrees
from cutjoint.topology.spanning_tree import loops_of

Array: TypeAlias = NDArray[np.float64]
TOLERANCE = 1e-9  #: a singular value below this share of the largest counts as zero


def evaluate(model: Model, expressions: Sequence[Scalar], values: Mapping[Scalar, Scalar] | None = None) -> Array:
    """Evaluate expressions over parameters and, if given, further symbols."""
    known = {p.symbol: sympy.Float(p.value) for p in model.parameters}
    return np.array([float(sympy.sympify(e).xreplace(values or {}).xreplace(known)) for e in expressions])


def extent(points: Iterable[Sequence[Scalar]], values: Mapping[Scalar, float]) -> float:
    """The diagonal (m) of the bounding box of points at given parameters; 1 if it is not a positive length."""
    places = np.array([[value_of(sympy.sympify(x), values) for x in point] for point in points]).reshape(-1, 3)
    found = float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 0.0
    return found if np.isfinite(found) and found > 0 else 1.0


def arm_of(model: Model) -> float:
    """The arm (m) of equations between directions: a power of two near the extent of joints and bodies, 1 for ordinary mechanisms.
    Such equations feel inertias, those between points masses; one penalty suits both where the arm is about their radius of inertia."""
    ends = (point for joint in model.joints for point in (joint.at, joint.to) if point is not None)
    points = chain(ends, (body.centre_of_mass for body in model.bodies))
    arm = 2.0 ** round(np.log2(extent(points, {p.symbol: float(p.value) for p in model.parameters})))
    return 1.0 if 1 / 8 <= arm <= 64 else arm


@dataclass(kw_only=True)
class JointGeometry:
    """Twists of joints, derived once for all joints that differ in position only."""

    model: Model
    _shapes: dict[Hashable, Array] = field(default_factory=dict)

    def free_twists(self, t: TreeJoint) -> Array:
        """Twists [v0; w] (6, k) of the outer body relative to the inner one, at unit speeds of the joint; none if it is guided."""
        if degrees(t.joint) == 0:
            return np.zeros((6, 0))
        key = (t.reversed, *_shape(t.joint))
        if key not in self._shapes:
            kernel = derive_joint(t.joint, t.reversed)
            upright = {**dict.fromkeys((*kernel.q, *QUATERNION), sympy.Integer(0)), QUATERNION[0]: sympy.Integer(1)}
            self._shapes[key] = evaluate(self.model, list(kernel.subspace), upright).reshape(6, -1)
        twists = self._shapes[key]
        centre = _skew(evaluate(self.model, inner_point(t.joint, t.reversed)))
        return np.concatenate([twists[:3] + centre @ twists[3:], twists[3:]])

    def constraint_jacobian(self, cut: Joint) -> Array:
        """Jacobian (m, 6) of a cut joint's constraints by the twist [v0; w] of its follower relative to its base."""
        key = ("cut", *_shape(cut))
        if key not in self._shapes:
            kernel = derive_closure(cut)
            values = _at_the_joint(cut, kernel.base_directions, kernel.follower_directions)
            self._shapes[key] = evaluate(self.model, list(kernel.jacobian), values).reshape(-1, 6)
        rows = self._shapes[key]
        centre = _skew(evaluate(self.model, cut.at))
        return np.concatenate([rows[:, :3], rows[:, 3:] - rows[:, :3] @ centre], axis=1)


def _shape(joint: Joint) -> tuple[Hashable, ...]:
    """A joint's geometry without its position."""
    return joint.kind, joint.axes, None if joint.to is None else _rod(joint), joint.pitch


def _rod(joint: Joint) -> tuple[Scalar, ...]:
    assert joint.to is not None
    return tuple(b - a for a, b in zip(joint.at, joint.to, strict=True))


def _at_the_joint(cut: Joint, base: Sequence[Sequence[Scalar]], follower: Sequence[Sequence[Scalar]]) -> dict[Scalar, Scalar]:
    """The kernel's symbols in the design position; points are relative to the joint's."""
    nowhere = (0, 0, 0)
    points = [(closures.P, nowhere if cut.to is None else _rod(cut)), (closures.P0, nowhere)]
    directions = [*zip(closures.B, base, strict=False), *zip(closures.F, follower, strict=False)]
    return {symbol[i]: sympy.sympify(vector[i]) for symbol, vector in [*points, *directions] for i in range(3)}


def _skew(p: Array) -> Array:
    """p~ with p~ x = p x x."""
    x, y, z = p
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def balanced(jacobian: Array) -> Array:
    """A Jacobian with rows of equal length; rows below 1e-4 of the longest, which may be rounding, keep their proportion."""
    lengths = np.linalg.norm(jacobian, axis=1, keepdims=True)
    scaled: Array = jacobian / np.maximum(lengths, max(1e-4 * lengths.max(initial=0.0), np.finfo(float).tiny))
    return scaled


def loop_condition(geometry: JointGeometry, tree: Sequence[TreeJoint], cuts: Sequence[Joint], cut: Joint) -> float:
    """Condition number of the constraints of a cut joint's loop and of loops that share a joint with it, without zero singular values."""
    around = loops_of(tree, cuts)
    mine = {t.joint.name for t in around[cut.name]}
    near = [(other, around[other.name]) for other in cuts if any(t.joint.name in mine for t in around[other.name])]
    jacobian = design_jacobian(geometry, near)
    values = np.linalg.svd(jacobian, compute_uv=False) if jacobian.size else np.zeros(0)
    positive = values[values > TOLERANCE * values.max(initial=0.0)]
    return float(positive[0] / positive[-1]) if positive.size else 1.0


def design_jacobian(geometry: JointGeometry, loops: Sequence[tuple[Joint, Sequence[TreeJoint]]]) -> Array:
    """Jacobian of cut joints' constraint rates by the speeds of the tree joints in their loops, in order of first occurrence."""
    columns: dict[str, slice] = {}
    end = 0
    for t in (t for _, around in loops for t in around):
        if t.joint.name not in columns:
            columns[t.joint.name] = slice(end, end + degrees(t.joint))
            end += degrees(t.joint)
    rows = [np.zeros((0, end))]
    for cut, around in loops:
        constraint_jacobian = geometry.constraint_jacobian(cut)
        rows.append(np.zeros((constraint_jacobian.shape[0], end)))
        for t, is_inwards in directed(cut, around):
            sign = 1.0 if is_inwards else -1.0  # of its twist in the relative twist of the cut joint's bodies
            rows[-1][:, columns[t.joint.name]] = sign * constraint_jacobian @ geometry.free_twists(t)
    return np.concatenate(rows)
