"""A dense reference of the mechanics: body poses from coordinates, everything else by numerical differentiation.

Shared with the compiler are the records and the meaning of coordinates and residuals, nothing else.  A twist is the derivative
of a pose, found by a complex step (exact to rounding); an acceleration is the derivative of a velocity along the path of constant
speeds, by central differences of twelfth order.  Forces enter by the virtual power of the lengths that they work on.
The equations of motion with penalty cut joints (Cuadrado et al. 2000, eqs. 39-42) are assembled and solved densely::

    (M + Phi_v^T a Phi_v) vdot = Q - bias - Phi_v^T (lambda + a s)        s = Phidd_0 + 2 xi w Phid + w^2 Phi
    correction = a (Phi_v vdot + s)

Arrays of poses carry leading batch axes: R (..., 3, 3), p (..., 3) with x = p + R X for a point X of the design position.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy

from cutjoint.model.records import COORDINATES, GROUND, Binding, Body, Gear, Joint, JointKind, Scene
from cutjoint.topology.records import Topology, TreeJoint
from tests.oracles.dense_forces import TINY, Array, DenseForces, Poses
from tests.oracles.joints import BALLS, ROWS, SCALARS, VECTORS, apply, quaternion_product, relative_motion, residual, vector_of
from tests.oracles.tyre import Flat

#: Step in time of the central differences, s, and their weights at 1, 2, ... 6 steps. They lose w**12 STEP**12 / 12012 of a motion at
#: w rad/s, 6e-18 at 20 rad/s, and EPS / STEP of a velocity by rounding.
STEP = 0.004
WEIGHTS = (6 / 7, -15 / 56, 5 / 63, -1 / 56, 1 / 385, -1 / 5544)

TIME = sympy.Symbol("t", real=True)


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Places of a joint's unknowns: ``q``, ``v`` their first elements, ``scalars`` coordinates, then a quaternion if ``ball``."""

    q: int
    v: int
    scalars: int
    ball: bool

    @property
    def q_slice(self) -> slice:
        """The joint's part of q."""
        return slice(self.q, self.q + self.scalars + 4 * self.ball)

    @property
    def v_slice(self) -> slice:
        """The joint's part of v."""
        return slice(self.v, self.v + self.scalars + 3 * self.ball)


@dataclass(frozen=True, kw_only=True)
class Numerics:
    """Penalty a, damping ratio xi and frequency w (1/s) of the cut joints."""

    penalty: float
    damping_ratio: float
    frequency: float


@dataclass(frozen=True, kw_only=True)
class Instant:
    """A state of the mechanism: coordinates, speeds, time; ``motion`` 0 stops the guides at their place, and drives."""

    q: Array
    v: Array
    t: float = 0.0
    motion: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Motion:
    """The bodies at an instant, by name: R, p, their columns by v (``R_v`` (nv, 3, 3), ``p_v`` (nv, 3)), rates, rates of rates."""

    R: Mapping[str, Array]
    p: Mapping[str, Array]
    R_v: Mapping[str, Array]
    p_v: Mapping[str, Array]
    R_t: Mapping[str, Array]
    p_t: Mapping[str, Array]
    R_tt: Mapping[str, Array]
    p_tt: Mapping[str, Array]

    def spin(self, body: str) -> tuple[Array, Array, Array]:
        """Jacobian (3, nv) of the angular velocity, the angular velocity, and its rate without accelerations."""
        R = self.R[body]
        columns = np.array([vector_of(R_k @ R.T) for R_k in self.R_v[body]]).reshape(-1, 3).T
        w = vector_of(self.R_t[body] @ R.T)
        return columns, w, vector_of(self.R_tt[body] @ R.T)

    def point(self, body: str, X: Array) -> tuple[Array, Array, Array, Array]:
        """A body's point given in the design position: place, Jacobian (3, nv), velocity, acceleration without accelerations."""
        columns = (self.p_v[body] + self.R_v[body] @ X).T
        place, velocity = self.p[body] + self.R[body] @ X, self.p_t[body] + self.R_t[body] @ X
        return place, columns, velocity, self.p_tt[body] + self.R_tt[body] @ X


@dataclass(frozen=True, kw_only=True)
class Closures:
    """All cut joints at an instant: Phi, Phi_v, Phid, and Phidd without accelerations, seen from each cut joint's base."""

    residual: Array
    jacobian: Array
    rate: Array
    drift: Array


@dataclass(frozen=True, kw_only=True)
class Solution:
    """Results of the generated functions, in the order of v and of the cut joints' equations.

    ``condition`` is that of the system solved, scaled to a unit diagonal: what either solution may lose.
    """

    vdot: Array
    correction: Array
    residual: Array
    rate: Array
    condition: float


class DenseMechanism(DenseForces):
    """A model on its spanning tree in a scene; ``parameters`` override values by name, ``roads`` are the tyres' roads by name; vector
    residuals are in the axes of the body ``axes``."""

    def __init__(
        self, topology: Topology, scene: Scene, parameters: Mapping[str, float] | None = None,
        roads: Mapping[str, Flat] | None = None, axes: str = GROUND,
    ) -> None:  # fmt: skip
        self.axes = axes
        self.topology, self.scene, self.model = topology, scene, topology.model
        self.roads = roads or {}
        given = parameters or {}
        self._values: dict[sympy.Symbol, object] = {
            p.symbol: given.get(p.name, p.value) for p in self.model.parameters if p.binding is not Binding.INPUT
        }
        for p in self.model.parameters:
            if p.binding is Binding.INPUT:
                self._values[p.symbol] = sympy.sympify(scene.inputs.get(p.name, p.value)).subs(self._values)
        self._functions: dict[tuple[object, tuple[object, ...]], Callable[..., float]] = {}
        self._numbers: dict[object, float] = {}
        self.layout = _layout(topology)
        self.nq = sum(x.scalars + 4 * x.ball for x in self.layout.values())
        self.nv = sum(x.scalars + 3 * x.ball for x in self.layout.values())
        self.equations: dict[str, slice] = {}
        first = 0
        for cut in topology.cuts:
            self.equations[cut.name] = slice(first, first + ROWS[cut.kind])
            first += ROWS[cut.kind]
        for gear in self.model.gears:
            self.equations[gear.name] = slice(first, first + 1)
            first += 1
        self.m = first

    # Numbers and functions of the model

    def number(self, expression: object) -> float:
        """The value of an expression over parameters."""
        if expression not in self._numbers:
            self._numbers[expression] = float(sympy.sympify(expression).subs(self._values))
        return self._numbers[expression]

    def vector(self, expressions: tuple[object, ...]) -> Array:
        """The values of a design vector."""
        return np.array([self.number(e) for e in expressions])

    def law(self, expression: object, variables: str, values: tuple[float, ...], t: float) -> float:
        """The value of a law at its variables and time."""
        return self._function(expression, variables)(*values, t)

    def _function(self, expression: object, variables: str, modules: str = "math") -> Callable[..., float]:
        symbols = (*(sympy.Symbol(n, real=True) for n in variables.split()), TIME)
        key = (expression, symbols, modules)
        if key not in self._functions:
            inserted = plain_cases(sympy.sympify(expression).subs(self._values))
            self._functions[key] = sympy.lambdify(symbols, inserted, modules=modules)
        return self._functions[key]

    @cached_property
    def geometry(self) -> dict[str, tuple[Array, tuple[Array, ...], Array | None, float]]:
        """Point, axes, second point and pitch of every joint, as numbers."""
        return {
            j.name: (
                self.vector(j.at), tuple(self.vector(a) for a in j.axes),
                None if j.to is None else self.vector(j.to), 0.0 if j.pitch is None else self.number(j.pitch),
            )
            for j in self.model.joints
        }  # fmt: skip

    # Positions

    def retract(self, q: Array, delta: Array) -> Array:
        """q (+) delta, batched: scalars add, a quaternion is turned by the Cayley map of a rotation vector in inner axes."""
        shape = np.broadcast_shapes(q.shape[:-1], delta.shape[:-1])
        result = np.empty((*shape, self.nq), dtype=np.result_type(q, delta))
        for x in self.layout.values():
            result[..., x.q : x.q + x.scalars] = q[..., x.q : x.q + x.scalars] + delta[..., x.v : x.v + x.scalars]
            if x.ball:
                half = delta[..., x.v_slice][..., x.scalars :] / 2
                old = q[..., x.q_slice][..., x.scalars :]
                turned = quaternion_product(np.concatenate([np.ones((*half.shape[:-1], 1)), half], axis=-1), old)
                length = np.sqrt((turned * turned).sum(axis=-1, keepdims=True))
                result[..., x.q_slice][..., x.scalars :] = turned / length
        return result

    def poses(self, q: Array, t: Array | float) -> Poses:
        """R and p of every body and of the ground, batched over q and t."""
        shape = q.shape[:-1]
        poses = {GROUND: (np.broadcast_to(np.eye(3), (*shape, 3, 3)), np.zeros((*shape, 3)))}
        for tree_joint in self.topology.tree:
            at, axes, to, pitch = self.geometry[tree_joint.joint.name]
            inner, outer = (at, at) if to is None else (at, to)
            if tree_joint.reversed:
                inner, outer = outer, inner
            turn, shift = relative_motion(
                tree_joint.joint.kind, tree_joint.reversed, axes, outer - inner, pitch, self._coordinates(tree_joint, q, t)
            )
            R, p = poses[tree_joint.parent]
            place = p + apply(R, inner + shift)
            R = R @ turn
            poses[tree_joint.child] = (R, place - apply(R, outer))
        return poses

    def _coordinates(self, tree_joint: TreeJoint, q: Array, t: Array | float) -> Array:
        joint = tree_joint.joint
        if joint.guide is not None:
            values = (self._function(guide, "", "numpy")(t) for guide in joint.guide)
            return np.stack([np.broadcast_to(value, q.shape[:-1]) for value in values], axis=-1)
        return q[..., self.layout[joint.name].q_slice] if joint.name in self.layout else q[..., :0]

    # Motion

    def along_coordinates(self, at: Instant) -> tuple[Array, float]:
        """Coordinates with an imaginary step along each speed in turn."""
        return self.retract(at.q, 1j * TINY * np.eye(self.nv)), at.t

    def along_path(self, at: Instant) -> tuple[Array, Array]:
        """Coordinates and times at the differences' nodes on the path of constant speeds, with an imaginary step in time."""
        nodes = STEP * np.array([0, *(sign * (k + 1) for k in range(len(WEIGHTS)) for sign in (1, -1))]) + 1j * TINY
        return self.retract(at.q, nodes[:, np.newaxis] * at.v), at.t + at.motion * nodes

    def motion(self, at: Instant) -> Motion:
        """Poses of all bodies with their derivatives."""
        here = self.poses(at.q, at.t)
        columns = self.poses(*self.along_coordinates(at))
        path = self.poses(*self.along_path(at))
        rates = {b: (R.imag / TINY, p.imag / TINY) for b, (R, p) in path.items()}
        return Motion(
            R={b: R for b, (R, p) in here.items()}, p={b: p for b, (R, p) in here.items()},
            R_v={b: R.imag / TINY for b, (R, p) in columns.items()}, p_v={b: p.imag / TINY for b, (R, p) in columns.items()},
            R_t={b: R[0] for b, (R, p) in rates.items()}, p_t={b: p[0] for b, (R, p) in rates.items()},
            R_tt={b: difference(R) for b, (R, p) in rates.items()}, p_tt={b: difference(p) for b, (R, p) in rates.items()},
        )  # fmt: skip

    # Mass, inertia forces, applied forces

    def inertia(self, motion: Motion) -> tuple[Array, Array]:
        """The mass matrix (nv, nv), and the inertia forces without accelerations less the weight (nv)."""
        M, bias = np.zeros((self.nv, self.nv)), np.zeros(self.nv)
        gravity = self.vector(self.model.gravity)
        for body in self.model.bodies:
            mass, centre, own = self.inertia_of(body)
            _, J, _, a = motion.point(body.name, centre)
            W, w, wd = motion.spin(body.name)
            inertia = motion.R[body.name] @ own @ motion.R[body.name].T
            M += mass * J.T @ J + W.T @ inertia @ W
            bias += mass * J.T @ (a - gravity) + W.T @ (inertia @ wd + np.cross(w, inertia @ w))
        return M, bias

    def inertia_of(self, body: Body) -> tuple[float, Array, Array]:
        """Mass, centre of mass in the design position, inertia matrix about it."""
        xx, yy, zz, xy, xz, yz = self.vector(body.inertia)
        return self.number(body.mass), self.vector(body.centre_of_mass), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    # Closures

    def closures(self, at: Instant) -> Closures:
        """The residuals of cut joints and gears, and their derivatives."""
        here = self._residuals(at.q, at.t)
        by_v = self._residuals(*self.along_coordinates(at)).imag / TINY
        rates = self._residuals(*self.along_path(at)).imag / TINY
        turn = self.base_turn(at)
        return Closures(residual=turn @ here, jacobian=turn @ by_v.T, rate=turn @ rates[0], drift=turn @ difference(rates))

    def _residuals(self, q: Array, t: Array | float) -> Array:
        """The residuals (..., m); vectors in the axes of the cut joint's base."""
        poses = self.poses(q, t)
        parts = [self._residual(cut, poses) for cut in self.topology.cuts]
        parts += [self._gap_of_teeth(gear, q, t) for gear in self.model.gears]
        shape = poses[GROUND][1].shape[:-1]
        return np.concatenate(parts, axis=-1) if parts else np.zeros((*shape, 0))

    def _gap_of_teeth(self, gear: Gear, q: Array, t: Array | float) -> Array:
        """The first coordinate less the ratio times the second one, or the law of it, (..., 1)."""
        trees = {x.joint.name: x for x in self.topology.tree}
        of = (trees[name] for name in gear.joints)
        first, second = (
            self._coordinates(x, q, t)[..., COORDINATES[x.joint.kind].index(end.name)]
            for x, end in zip(of, (gear.first, gear.second), strict=True)
        )
        turned = self.number(gear.ratio) * second if gear.law is None else self._function(gear.law, "position", "numpy")(second, t)
        return (first - turned)[..., np.newaxis]

    def _residual(self, cut: Joint, poses: Poses) -> Array:
        at, axes, to, pitch = self.geometry[cut.name]
        (R_b, p_b), (R_f, p_f) = poses[cut.base], poses[cut.follower]
        turn = np.swapaxes(R_b, -1, -2) @ R_f
        gap = apply(np.swapaxes(R_b, -1, -2), p_f + apply(R_f, at if to is None else to) - p_b) - at
        return residual(cut.kind, axes, None if to is None else to - at, pitch, gap, turn)

    def base_turn(self, at: Instant) -> Array:
        """Turns vector residuals from their base's axes into those of the body ``axes``, (m, m)."""
        poses = self.poses(at.q, at.t)
        turn = np.eye(self.m)
        for cut in self.topology.cuts:
            first = self.equations[cut.name].start
            for row in VECTORS[cut.kind]:
                rows = slice(first + row, first + row + 3)
                turn[rows, rows] = poses[self.axes][0].T @ poses[cut.base][0]
        return turn

    # Solution

    def solve(self, at: Instant, multipliers: Array, numerics: Numerics) -> Solution:
        """Accelerations and the multipliers' correction."""
        motion, c = self.motion(at), self.closures(at)
        a, w = numerics.penalty, numerics.frequency
        s = c.drift + 2 * numerics.damping_ratio * w * c.rate + w**2 * c.residual
        M, bias = self.inertia(motion)
        vdot, condition = _penalised(M, c.jacobian, a, self.applied(at, motion) - bias - c.jacobian.T @ (a * s + multipliers))
        return Solution(
            vdot=vdot, correction=a * (c.jacobian @ vdot + s), residual=c.residual, rate=c.rate, condition=condition,
        )  # fmt: skip

    def solve_exactly(self, at: Instant) -> tuple[Array, Array]:
        """Accelerations that the cut joints hold without a penalty, and their forces Phi_v^T lambda on the speeds.

        By directions that the cut joints leave free (singular values), which takes equations that depend on each other and massless bodies.
        """
        motion, c = self.motion(at), self.closures(at)
        M, bias = self.inertia(motion)
        Q = self.applied(at, motion) - bias
        U, size, V = np.linalg.svd(c.jacobian)
        rank = int(np.sum(size > 1e-9 * size.max(initial=0.0)))
        free, held = V[rank:].T, V[:rank].T
        vdot = -held @ ((U[:, :rank].T @ c.drift) / size[:rank])
        vdot = vdot + free @ np.linalg.solve(free.T @ M @ free, free.T @ (Q - M @ vdot))
        return vdot, Q - M @ vdot

    def project(self, at: Instant, gap: Array, numerics: Numerics) -> tuple[Array, float]:
        """The step that a gap of the cut joints asks for, (M + Phi_v^T a Phi_v) dz = -Phi_v^T a gap, and the system's condition."""
        jacobian, a = self.closures(at).jacobian, numerics.penalty
        return _penalised(self.inertia(self.motion(at))[0], jacobian, a, -jacobian.T @ (a * gap))


def _penalised(M: Array, jacobian: Array, penalty: float, right: Array) -> tuple[Array, float]:
    """The solution of (M + Phi_v^T a Phi_v) x = right, and the condition of the system scaled to a unit diagonal."""
    system = M + penalty * jacobian.T @ jacobian
    scale = 1 / np.sqrt(np.diag(system))
    scaled = system * np.outer(scale, scale)
    return scale * np.linalg.solve(scaled, scale * right), float(np.linalg.cond(scaled))


def _layout(topology: Topology) -> dict[str, Layout]:
    layout: dict[str, Layout] = {}
    q = v = 0
    for tree_joint in topology.tree:
        joint = tree_joint.joint
        if joint.guide is None and joint.kind is not JointKind.FIXED:
            x = layout[joint.name] = Layout(q=q, v=v, scalars=SCALARS[joint.kind], ball=joint.kind in BALLS)
            q, v = x.q_slice.stop, x.v_slice.stop
    return layout


def plain_cases(expression: sympy.Expr) -> sympy.Expr:
    """Choices of any kind as SymPy's own, which it can print."""
    return expression.replace(
        lambda e: isinstance(e, sympy.Piecewise),
        lambda e: sympy.Piecewise(*(tuple(case.args) for case in e.args), evaluate=False),
    )


def difference(nodes: Array) -> Array:
    """The derivative at the first of nodes 0, 1, -1, 2, -2, ..."""
    return sum(w * (nodes[2 * k + 1] - nodes[2 * k + 2]) for k, w in enumerate(WEIGHTS)) / STEP
