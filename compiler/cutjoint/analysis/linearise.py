"""A mechanism linearised about a state, by interpretation: mass, damping and stiffness are the exact tangent of its residual."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from cutjoint.analysis.closing import Array, retract
from cutjoint.analysis.natural import call, evaluate_results
from cutjoint.formulate.implicit.equations import ImplicitEquations
from cutjoint.program.interpret import RoadTable
from cutjoint.topology.geometry import TOLERANCE

# Equations


@dataclass(frozen=True, kw_only=True)
class Linearisation:
    """The matrices above: ``M``, ``C``, ``K``, ``W`` (speeds, speeds), ``J``, ``G`` (equations, speeds), with a name for each speed's
    coordinate, the state's coordinates ``q``, and whether it is one ``at_rest``.  The last of the speeds are ``states`` first-order states,
    whose rows are x' + C (q', x) + K q = 0."""

    names: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    W: Array
    J: Array
    G: Array
    q: Array
    at_rest: bool
    states: int = 0


@dataclass(frozen=True, kw_only=True)
class ReducedSystem:
    """The linearised equations in independent unknowns.

    ``basis`` N (speeds, dofs), ``stiffness`` and ``damping`` (dofs, dofs) beside a unit mass, and ``first_order``, the matrix
    of (z, w, x)' with the first-order states x.
    """

    basis: Array
    stiffness: Array
    damping: Array
    first_order: Array


class NoMassError(ValueError):
    """A direction that the loops leave free moves no mass."""


def free_directions(J: Array) -> Array:
    """An orthonormal basis (speeds, dofs) of the null space of J; equations that follow from others do no harm."""
    if 0 in J.shape:
        return np.eye(J.shape[1])
    _, values, right = np.linalg.svd(J)
    rank = int(np.sum(values > TOLERANCE * values.max(initial=0.0)))
    return np.asarray(right[rank:].T)


def reduce_system(of: Linearisation) -> ReducedSystem:
    """The equations of the directions that the loops leave free.

    Raises:
        NoMassError: one of these directions moves no mass.
    """
    n = len(of.M) - of.states
    joints = replace(of, **{name: getattr(of, name)[:n, :n] for name in "MCKW"}, **{name: getattr(of, name)[:, :n] for name in "JG"})
    N = _of_unit_mass(joints, free_directions(joints.J))
    P = _kept_rates(joints, N)
    C, K = of.C[n:], of.K[n:]
    stiffness, damping, turning = N.T @ (joints.K @ N + joints.C @ P), N.T @ joints.C @ N, N.T @ joints.M @ joints.W @ N
    first_order = np.block([
        [turning, np.eye(N.shape[1]), np.zeros((N.shape[1], of.states))],
        [-stiffness, -damping, -N.T @ of.C[:n, n:]],
        [-(C[:, :n] @ P + K[:, :n] @ N), -C[:, :n] @ N, -C[:, n:]],
    ])  # fmt: skip
    return ReducedSystem(basis=N, stiffness=stiffness, damping=damping, first_order=first_order)


#: A direction whose mass is this share of what its coordinates move one by one has none.
_MASSLESS = 1e-12


def _of_unit_mass(of: Linearisation, free: Array) -> Array:
    mass = free.T @ of.M @ free
    values, vectors = np.linalg.eigh((mass + mass.T) / 2)
    if len(values) and values[0] <= _MASSLESS * values[-1]:
        name = of.names[int(np.abs(free @ vectors[:, 0]).argmax())]
        raise NoMassError(
            f"'{name}' can move without moving a mass, so that its mode has no frequency; give a body that it moves mass and inertia"
        )
    return np.asarray(free @ vectors / np.sqrt(values))


def _kept_rates(of: Linearisation, N: Array) -> Array:
    if not len(of.J) or not of.G.any():
        return np.zeros_like(N)
    P = np.linalg.lstsq(of.J, -of.G @ N, rcond=TOLERANCE)[0]
    return np.asarray(P - N @ (N.T @ of.M @ P))


# Interpretation

_STEP = 1e-3
#: Central differences of fourth order, for a unit step.
_DIFFERENCES = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
#: Weights of damping, stiffness and constraints that give M, M + C and M + K.
_WEIGHTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, kw_only=True)
class Point:
    """A state at time ``t`` (s): coordinates ``q``, speeds ``v``, accelerations ``vdot``; zero of a mechanism at rest.

    ``parameters`` have the order of the equations' own, ``held`` the values of inputs that do not follow the scene and what controllers
    hold, ``roads`` the roads of tyres, flat where there are none.  Multipliers follow from the residual.
    """

    t: float
    q: Array
    v: Array
    vdot: Array
    parameters: Array
    held: Mapping[str, float] = field(default_factory=dict)
    roads: Mapping[str, RoadTable] | None = None


def linearise(equations: ImplicitEquations, at: Point, *, at_rest: bool) -> Linearisation:
    """The equations linearised about a state, which is one ``at_rest`` or of a motion with its accelerations."""
    here = _arrays(equations, at, at_rest)
    J = _jacobian(equations, here)
    here["lambda"] = _balancing(J, _call(equations, "dynamic_residual", here, at).get("force_residual", np.zeros(0)))
    M, damped, stiffened = _tangents(equations, here, at)
    return Linearisation(
        names=coordinate_names(equations), M=M, C=damped - M, K=stiffened - M, W=_turning(equations, at.v), J=J,
        G=_rate_changes(equations, here, at, J) if len(J) and at.v.any() and not at_rest else np.zeros_like(J),
        q=at.q, at_rest=at_rest, states=len(equations.state.states),
    )  # fmt: skip


def _arrays(equations: ImplicitEquations, at: Point, at_rest: bool) -> dict[str, Array]:
    balls = sum(c.ball for c in equations.start.charts)
    return {
        "t": np.full(1, at.t), "q": at.q, "v": at.v, "vdot": at.vdot, "parameters": at.parameters,
        "motion": np.full(1, 0.0 if at_rest else 1.0), "penalty": np.zeros(1), "weights.turns": np.tile(np.eye(3).ravel(), balls),
    }  # fmt: skip


def _call(equations: ImplicitEquations, function: str, arrays: Mapping[str, Array], at: Point) -> dict[str, Array]:
    return call(equations, function, arrays, at.roads, at.held)


def _jacobian(equations: ImplicitEquations, here: Mapping[str, Array]) -> Array:
    """J, (equations, speeds)."""
    m, n = len(equations.equation_names), equations.unknowns
    if not m:
        return np.zeros((0, n))
    return np.broadcast_to(call(equations, "apply_jacobian_transposed", {**here, "w": np.eye(m)})["force"], (m, n))


def _balancing(J: Array, residual: Array) -> Array:
    """The multipliers that balance the accelerations."""
    return np.asarray(np.linalg.lstsq(J.T, -residual, rcond=TOLERANCE)[0]) if len(J) else np.zeros(0)


def _tangents(equations: ImplicitEquations, here: Mapping[str, Array], at: Point) -> Array:
    """The tangent with each of the weights, (weights, speeds, speeds)."""
    n = equations.unknowns
    tangents = np.zeros((len(_WEIGHTS), n, n))
    entries = {name: block for name, block in equations.function("linearise").results.items() if name.startswith("tangent:")}
    for name, entry in evaluate_results(equations, entries, {**here, "weights": _WEIGHTS}, at.roads, at.held).items():
        row, column = map(int, name.removeprefix("tangent:").split(","))
        tangents[:, row, column] = entry[..., 0]
    return tangents


def coordinate_names(equations: ImplicitEquations) -> tuple[str, ...]:
    """A name for the coordinate of each speed, and the states' own; of a quaternion, the names of the angular velocity stand for small
    turns."""
    names = (f"{c.joint}.{name}" for c in equations.charts for name in (*c.coordinate_names[: c.scalars], *c.speed_names[c.scalars :]))
    return *names, *equations.speed_names[equations.state.speeds :]


def _turning(equations: ImplicitEquations, v: Array) -> Array:
    """W: a small turn of a ball, in the axes of its angular velocity omega, changes by omega x turn besides what omega changes by."""
    W = np.zeros((len(v), len(v)))
    for c in equations.start.charts:
        if c.ball:
            first = c.v + c.scalars
            W[first : first + 3, first : first + 3] = np.cross(v[first : first + 3], np.eye(3)).T
    return W


def _rate_changes(equations: ImplicitEquations, here: Mapping[str, Array], at: Point, J: Array) -> Array:
    """G in the directions that the loops leave free, zero across them: by differences, as the rates have no tangent of their own."""
    free = free_directions(J)
    near = np.array(list(_neighbours(equations, at.q, free))).reshape(-1, len(at.q))
    rates = _call(equations, "constraint_residual", {**here, "q": near}, at)["rate"]
    rates = np.broadcast_to(rates, (len(near), len(J))).reshape(free.shape[1], len(_DIFFERENCES), len(J))
    changes: Array = np.einsum("fsm,s->mf", rates, np.array([*_DIFFERENCES.values()]) / _STEP)
    return np.asarray(changes @ free.T)


def _neighbours(equations: ImplicitEquations, q: Array, directions: Array) -> Iterator[Array]:
    for direction in directions.T:
        for steps in _DIFFERENCES:
            yield retract(equations.start, q, steps * _STEP * direction)
