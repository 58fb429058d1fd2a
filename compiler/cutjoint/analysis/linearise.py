"""A mechanism linearised about a state, by interpretation: mass, damping and stiffness are the exact tangent of its residual."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from cutjoint.analysis.closing import Array, free_directions, retract_changes
from cutjoint.analysis.natural import call, constraint_jacobian, evaluate_changes
from cutjoint.formulate.implicit.equations import ImplicitEquations
from cutjoint.program.interpret import RoadTable
from cutjoint.topology.geometry import TOLERANCE

_MASSLESS = 1e-12  #: a free motion whose mass is below this share of the masses of its coordinates has none
#: A time (s) in which guides and inputs hardly move; the share of a motion's changes, or of a unit of inertia, that is rounding.
_SOON, _STEADY = 1e-6, 1e-6

# Equations


@dataclass(frozen=True, kw_only=True)
class Linearisation:
    """The matrices ``M``, ``C``, ``K``, ``W`` (speeds, speeds) and ``J``, ``G`` (equations, speeds).
    ``names`` are those of the coordinates, ``sizes`` those of first-order states: the larger of value and nominal value.
    Those of a ``steady`` motion are constant, in axes that turn with it."""

    names: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    W: Array
    J: Array
    G: Array
    q: Array
    at_rest: bool
    steady: bool = False
    sizes: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def states(self) -> int:
        """The number of first-order states."""
        return len(self.sizes)


@dataclass(frozen=True, kw_only=True)
class ReducedSystem:
    """The linearised equations in independent unknowns. ``basis`` N (speeds, dofs), ``stiffness`` and ``damping`` (dofs, dofs) for a unit
    mass matrix, and ``first_order``, the matrix of (z, w, x)' with the first-order states x over their sizes."""

    basis: Array
    stiffness: Array
    damping: Array
    first_order: Array


class NoMassError(ValueError):
    """A motion that the loops leave free has no mass."""


def reduce_system(of: Linearisation) -> ReducedSystem:
    """The equations of the directions that the loops leave free. Raises NoMassError: one of these directions moves no mass."""
    n = len(of.M) - of.states
    joints = replace(of, **{name: getattr(of, name)[:n, :n] for name in "MCKW"}, **{name: getattr(of, name)[:, :n] for name in "JG"})
    N = _of_unit_mass(joints, free_directions(joints.J))
    P = np.zeros_like(N)
    if len(joints.J) and joints.G.any():
        P[:] = np.linalg.lstsq(joints.J, -joints.G @ N, rcond=TOLERANCE)[0]
        P -= N @ (N.T @ joints.M @ P)
    C, K, over = of.C[n:], of.K[n:], of.sizes[:, np.newaxis]
    stiffness, damping, turning = N.T @ (joints.K @ N + joints.C @ P), N.T @ joints.C @ N, N.T @ joints.M @ joints.W @ N
    first_order = np.block([
        [turning, np.eye(N.shape[1]), np.zeros((N.shape[1], of.states))],
        [-stiffness, -damping, -N.T @ of.C[:n, n:] * of.sizes],
        [-(C[:, :n] @ P + K[:, :n] @ N) / over, -C[:, :n] @ N / over, -C[:, n:] * of.sizes / over],
    ])  # fmt: skip
    return ReducedSystem(basis=N, stiffness=stiffness, damping=damping, first_order=first_order)


def _of_unit_mass(of: Linearisation, free: Array) -> Array:
    mass = free.T @ of.M @ free
    values, vectors = np.linalg.eigh((mass + mass.T) / 2)
    if len(values) and values[0] <= _MASSLESS * values[-1]:
        name = of.names[int(np.abs(free @ vectors[:, 0]).argmax())]
        raise NoMassError(
            f"'{name}' can move without moving a mass, so that its mode has no frequency; give a body that it moves mass and inertia"
        )
    return np.asarray(free @ vectors / np.sqrt(values))


# Interpretation


@dataclass(frozen=True, kw_only=True)
class Point:
    """A state at time ``t`` (s): coordinates ``q``, speeds ``v``, accelerations ``vdot``; zero of a mechanism at rest.
    ``parameters`` have the order of the equations' own, ``held`` the values of discrete states and of inputs, which replace those of the
    scene, ``roads`` the roads of tyres, flat where there are none. Multipliers follow from the residual."""

    t: float
    q: Array
    v: Array
    vdot: Array
    parameters: Array
    held: Mapping[str, float] = field(default_factory=dict)
    roads: Mapping[str, RoadTable] | None = None


def linearise(equations: ImplicitEquations, at: Point, *, at_rest: bool) -> Linearisation:
    """The equations linearised about a state, which is one ``at_rest`` or of a motion with its accelerations."""
    here = {
        "t": np.full(1, at.t), "q": at.q, "v": at.v, "vdot": at.vdot, "parameters": at.parameters,
        "motion": np.full(1, 0.0 if at_rest else 1.0), "penalty": np.zeros(1),
    }  # fmt: skip
    J = constraint_jacobian(equations, here)
    here["lambda"] = _balancing(J, _call(equations, "dynamic_residual", here, at).get("force_residual", np.zeros(0)))
    forces = _tangents(equations, "dynamic_residual", "force_residual", here, at)
    G, free = np.zeros_like(J), free_directions(J)
    if len(J) and at.v.any() and not at_rest:
        G = _tangents(equations, "constraint_residual", "rate", here, at)[:, : len(at.v)] @ free @ free.T
    K, C, M = np.split(forces, 3, axis=1)
    S = _turning(equations, at)
    none = np.zeros(len(at.v))
    later, now = (_call(equations, "dynamic_residual", {**here, "t": here["t"] + dt}, at).get("force_residual", none) for dt in (_SOON, 0))
    moves = np.where(np.arange(len(at.v)) < equations.state.speeds, at.v, 0.0)
    changes = np.array([(later - now) / _SOON, K @ moves, C @ at.vdot, M @ S @ at.vdot])
    steady = np.abs(free.T @ changes.sum(axis=0)).max(initial=0.0) <= _STEADY * max(np.abs([*changes, *M]).max(initial=0.0), 1e-300)
    S *= steady
    nominal = np.array([state.nominal for state in equations.state.states])
    return Linearisation(
        names=coordinate_names(equations), M=M, C=C + M @ S, K=K, W=_is_angular(equations, at.v) - S, J=J, G=G,
        q=at.q, at_rest=at_rest, steady=bool(steady),
        sizes=np.maximum(np.abs(at.v[len(at.v) - len(nominal) :]), nominal),
    )  # fmt: skip


def _turning(equations: ImplicitEquations, at: Point) -> Array:
    """The matrix S of v' = S v where free bodies turn steadily, with velocities in the axes of the ground."""
    S, ground = np.zeros((len(at.v), len(at.v))), equations.start.topology.tree[0].parent
    on_ground = {tree.joint.name for tree in equations.start.topology.tree if tree.parent == ground}
    starts = [c.v + i for c in equations.start.charts if c.joint in on_ground and c.ball for i in range(0, c.scalars + 1, 3)]
    parts = [slice(i, i + 3) for i in starts]
    if parts:
        crossed = np.concatenate([np.cross(np.eye(3), at.v[part]).T for part in parts])
        rate = np.linalg.lstsq(crossed, np.concatenate([at.vdot[part] for part in parts]), rcond=TOLERANCE)[0]
        for part in parts:
            S[part, part] = np.cross(rate, np.eye(3)).T
    return S


def _call(equations: ImplicitEquations, function: str, arrays: Mapping[str, Array], at: Point) -> dict[str, Array]:
    return call(equations, function, arrays, at.roads, at.held)


def _balancing(J: Array, residual: Array) -> Array:
    """The multipliers that satisfy the equations of motion for the accelerations."""
    return np.asarray(np.linalg.lstsq(J.T, -residual, rcond=TOLERANCE)[0]) if len(J) else np.zeros(0)


def _tangents(equations: ImplicitEquations, function: str, array: str, here: Mapping[str, Array], at: Point) -> Array:
    """The derivatives (rows, 3 speeds) of an array of a function's results by changes of coordinates, by speeds and by accelerations."""
    n, slots, start = equations.unknowns, equations.slots, equations.start
    moves, speeds, accelerations = np.split(np.eye(3 * n), 3, axis=1)
    q = retract_changes(start, at.q, np.zeros(n), moves)
    changes = {"q": q, "v": speeds, "vdot": accelerations, "parameters": np.zeros((3 * n, len(at.parameters)))}
    results = {name: block for name, block in equations.function(function).results.items() if name in slots and slots[name].array == array}
    found = evaluate_changes(equations, results, here, changes, at.roads, at.held)
    columns = [found[name][1] for name in sorted(found, key=lambda name: slots[name].offset)]
    return np.concatenate([np.zeros((3 * n, 0)), *columns], axis=1).T


def coordinate_names(equations: ImplicitEquations) -> tuple[str, ...]:
    """A name for the coordinate of each speed, and the states' own; of a ball, names of the angular velocity denote small rotations."""
    names = (f"{c.joint}.{name}" for c in equations.charts for name in (*c.coordinate_names[: c.scalars], *c.speed_names[c.scalars :]))
    return *names, *equations.speed_names[equations.state.speeds :]


def _is_angular(equations: ImplicitEquations, v: Array) -> Array:
    """The matrix W of d(small rotation)/dt = d(omega) + W (small rotation).
    The rotation of a ball is in the axes of its angular velocity omega."""
    W = np.zeros((len(v), len(v)))
    for c in equations.start.charts:
        if c.ball:
            first = c.v + c.scalars
            W[first : first + 3, first : first + 3] = np.cross(v[first : first + 3], np.eye(3)).T
    return W
