"""The cut joints' equations as numbers: residual and Jacobian at given coordinates, and coordinates that close the loops.

Poses are the design position and others around it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.formulate.inputs import DISCRETE_STATES, INPUTS, LAW_TIME, LAW_VALUES
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.records import Equations, RecursiveEquations
from cutjoint.formulate.recursive.embedding.dependent import fitted_inputs
from cutjoint.program.blocks import Block
from cutjoint.program.interpret import RoadTable, interpret_blocks
from cutjoint.program.tangents import interpret_tangents
from cutjoint.topology.geometry import TOLERANCE

Array: TypeAlias = NDArray[np.float64]

CLOSED = 1e-9  #: the residual (m, rad; share of the arm where that is not a metre) below which a loop counts as closed
#: Damping of the steps by the largest square of a speed's effect: equations that are dependent to six digits have no effect.
_DAMPING = 1e-12
_ITERATIONS = 30
NEIGHBOURS = 4  #: the number of wanted poses besides the design position, and of trials for one
_ATTEMPTS = 16
#: The first step changes the fastest coordinate by this much (m or arms, rad); it is halved where no closed pose is found.
_STEP, _SMALLEST = 0.25, 0.015


class FlatRoad:
    """A flat road at height zero."""

    def height(self, x: float, y: float) -> float:
        """Height, m."""
        return 0.0

    def slope(self, x: float, y: float) -> float:
        """dz/dx."""
        return 0.0

    height_dx = slope_dx = slope

    def surface(self, x: float, y: float, by_x: int, by_y: int) -> float:
        """The height of a surface, m, or its derivative."""
        return 0.0

    def friction(self, x: float, y: float, by_x: int, by_y: int) -> float:
        """The factor of friction, or its derivative."""
        return float(by_x + by_y == 0)


class Charted(Protocol):
    """Coordinates by charts, and their number."""

    @property
    def charts(self) -> tuple[Chart, ...]: ...

    @property
    def coordinates(self) -> int: ...


def design_coordinates(equations: Charted) -> Array:
    """q of the design position: zeros and unit quaternions."""
    q = np.zeros(equations.coordinates)
    for chart in equations.charts:
        if chart.ball:
            q[chart.q + chart.scalars] = 1.0
    return q


def speed_scales(equations: RecursiveEquations) -> Array:
    """The usual sizes (speeds,) of displacements by speeds: 1 of angles, the mechanism's arm (its length scale, m) of lengths."""
    return np.where(equations.angular, 1.0, equations.topology.arm)


def evaluate_closures(equations: RecursiveEquations, q: Array, t: float = 0.0) -> tuple[Array, Array]:
    """Residual (equations) and Jacobian (equations, speeds) of the cut joints, with guides fixed at their positions at ``t`` (s)."""
    close = next(f for f in equations.functions if f.name == "constraint_residual").results
    residuals, rates = ([close[f"{quantity}:{c.joint}"] for c in equations.closures] for quantity in ("residual", "rate"))
    values = _interpret(equations, q, [*residuals, *rates], t)
    residual = np.concatenate([np.zeros(0), *(values[block][:, 0] for block in residuals)])
    return residual, np.concatenate([np.zeros((0, equations.speeds)), *(_by_speeds(equations, values[block]) for block in rates)])


def evaluate_guided_rates(equations: RecursiveEquations, q: Array, t: float) -> Array:
    """The rates (equations) of the residuals by the motion of guides alone at ``t`` (s)."""
    close = next(f for f in equations.functions if f.name == "constraint_residual").results
    rates = [close[f"rate:{c.joint}"] for c in equations.closures]
    inputs = {**make_inputs(equations, q, np.zeros(equations.speeds), t), "motion": np.ones(1)}
    values = interpret_blocks(rates, inputs, flat_roads(equations))
    return np.concatenate([np.zeros(0), *(values[block][:, 0] for block in rates)])


def evaluate_rates(equations: RecursiveEquations, q: Array, rates: Sequence[Block]) -> list[Array]:
    """The matrices (m, speeds) of columns (m, 1) that are linear in the speeds."""
    values = _interpret(equations, q, rates)
    return [_by_speeds(equations, values[block]) for block in rates]


def _interpret(equations: RecursiveEquations, q: Array, blocks: Sequence[Block], t: float = 0.0) -> dict[Block, Array]:
    """The blocks at all unit speeds in one batch; blocks that depend on coordinates only are evaluated once, without a batch axis."""
    return interpret_blocks(blocks, make_inputs(equations, q, np.eye(equations.speeds), t), flat_roads(equations))


def flat_roads(equations: Equations) -> dict[str, RoadTable]:
    """A flat road for each tyre."""
    return {name: FlatRoad() for name in equations.roads}


def _by_speeds(equations: RecursiveEquations, rates: Array) -> Array:
    return np.broadcast_to(rates[..., 0], (equations.speeds, rates.shape[-2])).T


def make_inputs(equations: RecursiveEquations, q: Array, v: Array, t: float = 0.0) -> dict[str, Array]:
    """The interpreter's inputs for coordinates (..., coordinates) and speeds (..., speeds) at ``t`` (s), everything else at its default."""
    numerics = equations.scene.numerics
    parameters = np.array([p.value for p in equations.parameters])
    inputs = {
        **evaluate_scene_inputs(equations, parameters, t),
        **fitted_inputs(equations.topology.model.embedded_loops),
        "t": np.full(1, t),
        "motion": np.zeros(1),
        "parameters": parameters,
        "numerics": np.array([1.0 if numerics.penalty is None else numerics.penalty, numerics.damping_ratio, numerics.frequency]),
    }
    for chart in equations.charts:
        inputs[f"q:{chart.joint}"] = q[..., chart.q : chart.q + len(chart.coordinate_names)]
        inputs[f"v:{chart.joint}"] = v[..., chart.v : chart.v + len(chart.speed_names)]
        inputs[f"vdot:{chart.joint}"] = np.zeros(len(chart.speed_names))
    for closure in equations.closures:
        inputs[f"lambda:{closure.joint}"] = np.zeros(len(closure.names))
    return inputs | {f"v:{state.name}": np.zeros(1) for state in equations.state.states}


def evaluate_scene_inputs(equations: Equations, parameters: Array, t: float) -> dict[str, Array]:
    """Values (..., length), by symbol, of a scene's laws at ``t`` (s), and the initial discrete states. ``parameters`` are (..., length).
    They are what a step reads; none of a model without inputs and controllers."""
    if not equations.input_values:
        return {}
    results = equations.function("scene_inputs").results
    values = interpret_blocks(results.values(), {LAW_TIME: np.full(1, t), "parameters": parameters}, {})
    numbers = np.stack(np.broadcast_arrays(*(values[block][..., 0, 0] for block in results.values())), axis=-1)
    return _by_input(equations, numbers)


def scene_input_changes(equations: Equations, parameters: Array, changes: Array, t: float) -> dict[str, Array]:
    """The changes (directions, length) of `evaluate_scene_inputs` by ``changes`` (directions, parameters) of parameters (length,)."""
    if not equations.input_values or not changes.any():
        return {}
    results = equations.function("scene_inputs").results
    _, moved = interpret_tangents(results.values(), {LAW_TIME: np.full(1, t), "parameters": parameters}, {"parameters": changes}, {})
    still = np.zeros((len(changes), 1, 1))
    return _by_input(equations, np.concatenate([moved.get(block, still)[:, 0] for block in results.values()], axis=-1))


def _by_input(equations: Equations, numbers: Array) -> dict[str, Array]:
    count = len(equations.slots[INPUTS].names)
    begun = count + equations.discrete_states
    return {INPUTS: numbers[..., :count], DISCRETE_STATES: numbers[..., count:begun], LAW_VALUES: numbers[..., begun:]}


def free_directions(J: Array) -> Array:
    """An orthonormal basis (speeds, dofs) of the null space of J; equations that follow from others do no harm."""
    m, n = J.shape
    if not (m and n):
        return np.eye(n)
    _, values, right = np.linalg.svd(J, full_matrices=m < n)
    return np.asarray(right[int(np.sum(values > TOLERANCE * values.max(initial=0.0))) :].T)


def close_loops(
    equations: RecursiveEquations, q: Array, across: Array | None = None, t: float = 0.0, free: Array | None = None,
    evaluate: Callable[[Array], tuple[Array, Array]] | None = None,
) -> tuple[Array, Array] | None:  # fmt: skip
    """Coordinates near q that close the loops, and the Jacobian there, by Gauss-Newton steps; None where they do not converge.

    Steps are taken across the direction ``across`` (speeds), so that they do not undo a step along it: at a bifurcation of the motion,
    minimum-norm steps would lead back to the bifurcation. Guides are at their positions at ``t`` (s). If ``free`` (speeds,) is given, only
    coordinates of these speeds change. ``evaluate`` gives the residual and its Jacobian, by default those of the loops.
    """
    rows = np.zeros((0, equations.speeds)) if across is None else across[np.newaxis]
    sizes, arm, best = speed_scales(equations), equations.topology.arm, np.inf
    for left in reversed(range(_ITERATIONS)):
        residual, jacobian = evaluate_closures(equations, q, t) if evaluate is None else evaluate(q)
        error = float(np.abs(residual).max(initial=0.0)) / arm
        if error == 0.0 or (error < CLOSED and (best / 2 <= error or not left)):
            return q, jacobian
        if not np.isfinite(error):
            return None
        best = error
        moving = jacobian if free is None else jacobian * free
        step = _step(np.concatenate([moving, rows]) * sizes, np.concatenate([-residual, np.zeros(len(rows))]))
        q = retract(equations, q, sizes * step)
    return None


def _step(matrix: Array, right: Array) -> Array:
    """The damped least-squares solution of matrix x = right: (matrix^T matrix + damping) x = matrix^T right."""
    gram = matrix.T @ matrix
    damping = _DAMPING * gram.diagonal().max(initial=0.0) or 1.0
    return np.asarray(np.linalg.solve(gram + damping * np.eye(len(gram)), matrix.T @ right), dtype=np.float64)


def retract(equations: Charted, q: Array, delta: Array) -> Array:
    """q (+) delta, (..., coordinates) and (..., speeds), as in runtime core/mechanism/retraction.hpp.
    Scalars add; a quaternion is multiplied by (1, theta/2)."""
    result = q.copy()
    for chart in equations.charts:
        ball = chart.q + chart.scalars
        result[..., chart.q : ball] += delta[..., chart.v : chart.v + chart.scalars]
        if chart.ball:
            e = _rotated_quaternion(q[..., ball : ball + 4], delta[..., chart.v + chart.scalars : chart.v + chart.scalars + 3])
            result[..., ball : ball + 4] = e / np.linalg.norm(e, axis=-1, keepdims=True)
    return result


def retract_changes(equations: Charted, q: Array, delta: Array, changes: Array) -> Array:
    """The changes (directions, coordinates) of ``retract(q, delta)`` by ``changes`` (directions, speeds) of delta (speeds,)."""
    result = np.zeros((len(changes), len(q)))
    for chart in equations.charts:
        ball, first = chart.q + chart.scalars, chart.v + chart.scalars
        result[:, chart.q : ball] = changes[:, chart.v : first]
        if chart.ball:
            e, was = _rotated_quaternion(q[ball : ball + 4], delta[first : first + 3]), q[ball : ball + 4]
            moved = _rotated_quaternion(np.broadcast_to(was, (len(changes), 4)), changes[:, first : first + 3]) - was
            length = np.linalg.norm(e)
            result[:, ball : ball + 4] = moved / length - np.outer(moved @ e, e) / length**3
    return result


def _rotated_quaternion(e: Array, theta: Array) -> Array:
    """A quaternion (..., 4) times (1, theta/2), not normalised."""
    x, y, z = np.moveaxis(theta / 2, -1, 0)
    one = np.ones_like(x)
    return np.asarray(np.einsum("ij...,...j->...i", np.array([[one, -x, -y, -z], [x, one, -z, y], [y, z, one, -x], [z, -y, x, one]]), e))


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
        """An orthonormal basis, as columns, of the speeds that the equations leave free."""
        return free_directions(self.jacobian)


def explore(equations: RecursiveEquations) -> tuple[Pose, ...]:
    """The design position, closed again where guides have moved it, then up to four poses that random steps along free motions reach.
    The steps have a fixed seed. A rigid mechanism has no other pose, and one that cannot be closed is left in its design position."""
    design = design_coordinates(equations)
    start = close_loops(equations, design)
    if start is None:
        return (_pose(design, evaluate_closures(equations, design)[1], closed=False),)
    poses = [_pose(*start)]
    free, rng, step, sizes = poses[0].free, np.random.default_rng(0), _STEP, speed_scales(equations)
    sizes_of_q = np.ones(equations.coordinates)
    for chart in equations.charts:
        sizes_of_q[chart.q : chart.q + chart.scalars] = sizes[chart.v : chart.v + chart.scalars]
    for _ in range(_ATTEMPTS if free.size else 0):
        direction = free @ rng.standard_normal(free.shape[1])
        direction /= np.abs(direction / sizes).max()
        found = close_loops(equations, retract(equations, start[0], step * direction), across=direction)
        if found is None or not step / 8 < np.abs((found[0] - start[0]) / sizes_of_q).max() < 8 * step:
            step = max(step / 2, _SMALLEST)
            continue
        poses.append(_pose(*found))
        if len(poses) > NEIGHBOURS:
            break
    return tuple(poses)


def _pose(q: Array, jacobian: Array, closed: bool = True) -> Pose:
    values = np.asarray(np.linalg.svd(jacobian, compute_uv=False) if jacobian.size else [], dtype=np.float64)
    return Pose(q=q, closed=closed, jacobian=jacobian, singular_values=values)
