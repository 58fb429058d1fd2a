"""Loops that are locked only by small errors of points and axes, and the nearest geometry with which they move.

In poses q_k along a motion that the loops nearly leave free, the left null space U_k of their Jacobian has the equations that would be
redundant without these errors. Displacements and rotations p of joints close the loops in all these poses where U_k^T (Phi + Phi_p p) = 0.
Where two motions cross, at a change point, U_k has a column more: without its equation they part, since Phi is then of second order there.
Of the solutions the one that moves fewest joints is taken, by least squares with weights that follow from the one before.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.analysis.closing import Array, design_coordinates, evaluate_closures, flat_roads, make_inputs, retract, speed_scales
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.records import Binding, Joint, Model, Parameter, Vector
from cutjoint.program.tangents import interpret_tangents
from cutjoint.topology.build import build_topology
from cutjoint.topology.geometry import balanced
from cutjoint.topology.spanning_tree import loops_of

#: Poses, the largest step to one (arms, rad), steps of Newton's method, and reweightings of joints.
_POSES, _STEP, _NEWTON, _WEIGHTINGS = 14, 0.6, 16, 12
_PROJECTIONS = 12
_NOISE = 1e-8  #: singular values of the conditions below this share of the largest are rounding
#: Change points: every so many poses one is sought from; differences of coordinates (arms, rad); steps and singular values of one that is
#: found; the violation (arms) by rounding.
_EVERY, _DIFFERENCE, _NEAR, _EXACT = 5, 1e-5, 1e-3, 1e-14


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """The joint that is ``off`` most (m, or rad if it ``turns``) from one with which the loops move, and the ``model`` of that."""

    joint: str
    off: float
    turns: bool
    model: Model


@dataclass(frozen=True, kw_only=True)
class _Space:
    """The Jacobian of the loops in a pose, its rows balanced by ``lengths``: its range and the null spaces on both sides."""

    lengths: Array
    left: Array
    values: Array
    right: Array


def find_misfit(equations: RecursiveEquations, held: float, free: float) -> Misfit | None:
    """The misfit of loops; None if the loops move in no geometry nearby. It consists of small displacements and rotations of joints that
    reduce singular values below the share ``held`` of the largest to below ``free``."""
    topology, model = equations.topology, equations.topology.model
    cuts = {cut.name for cut in topology.cuts}
    within = cuts | {t.joint.name for tree in loops_of(topology.tree, topology.cuts).values() for t in tree}
    names = [joint.name for joint in model.joints if joint.name in within]
    trial = formulate_recursive(build_topology(_movable(model, names, cuts)), equations.scene, ())
    scale, total, weights = np.array([topology.arm] * 3 + [1.0] * 3), np.zeros((len(names), 6)), 1 + 0.1 * np.arange(len(names))
    first = len(trial.parameters) - total.size
    for _ in range(_NEWTON):
        last = (replace(p, value=float(value)) for p, value in zip(trial.parameters[first:], total.ravel(), strict=True))
        moved = replace(trial, parameters=(*trial.parameters[:first], *last))
        found = _linearised(moved, held, free, total.size, np.abs(total / scale).max())
        if found is None:
            return None
        matrix, right, done = found
        if done:
            worst = int(np.linalg.norm(total / scale, axis=1).argmax())
            way, angle = np.linalg.norm(total[worst, :3]), 2 * np.linalg.norm(total[worst, 3:])
            turns = bool(angle * topology.arm > way)
            return Misfit(joint=names[worst], off=float(angle if turns else way), turns=turns, model=_moved(model, names, total))
        left, values, rows = np.linalg.svd(matrix * np.tile(scale, len(names)), full_matrices=False)
        kept = values > max(_NOISE * values[0], 10 * np.abs(right).max())  # others are as inexact as the geometry
        wanted = (left.T @ right)[kept] / values[kept]
        for _ in range(_WEIGHTINGS):
            by = np.repeat(weights, 6)
            change = scale * (by * np.linalg.lstsq(rows[kept] * by, wanted)[0]).reshape(-1, 6)
            size = np.linalg.norm((total + change) / scale, axis=1)
            weights = size / size.max() + 1e-4
        total += change
    return None


def _linearised(equations: RecursiveEquations, held: float, free: float, count: int, moved: float) -> tuple[Array, Array, bool] | None:
    """The linear conditions on ``count`` changes of joints in poses of the motion, and whether it is free; None without a motion.
    The joints have ``moved`` (arms) so far."""
    design, sizes = design_coordinates(equations), speed_scales(equations)
    first = _space(evaluate_closures(equations, design)[1] * sizes)
    rank, rng = int(np.sum(first.values > held * first.values[0])), np.random.default_rng(0)
    poses, conditions, spaces = list[Array](), list[tuple[Array, Array]](), [first]
    for _ in range(_POSES):
        direction = first.right[rank:].T @ rng.standard_normal(equations.speeds - rank)
        direction *= rng.uniform(-_STEP, _STEP) / np.abs(direction).max()
        q = _projected(equations, retract(equations, design, sizes * direction), rank)
        if q is not None:
            poses.append(q)
            spaces.append(_space(evaluate_closures(equations, q)[1] * sizes))
            conditions.append(_condition(equations, q, spaces[-1], rank, count))
    if len(poses) < _POSES / 2:
        return None
    done = all((space.values[rank:] <= free * space.values[0]).all() for space in spaces)
    allowed = 10 * (moved + max(np.abs(right).max() for _, right in conditions)) + _EXACT
    lengths = np.max([space.lengths for space in spaces], axis=0)
    nearest = np.argsort([space.values[rank - 1] for space in spaces[1:]])
    for change in (_change_point(equations, poses[k], rank, lengths) for k in nearest[::_EVERY]):
        if change is None:
            continue
        rows, right = _condition(equations, change, _space(evaluate_closures(equations, change)[1] * sizes), rank - 1, count)
        if _EXACT + moved**2 < np.abs(right).max() <= allowed:  # less parts two motions by less than the misfit; more is another assembly
            conditions.append((rows, right))
            done = False
    return np.concatenate([rows for rows, _ in conditions]), np.concatenate([right for _, right in conditions]), done


def _condition(equations: RecursiveEquations, q: Array, space: _Space, rank: int, count: int) -> tuple[Array, Array]:
    """The linear conditions (equations beyond ``rank``, ``count``) on the last parameters in a pose, and their right-hand sides."""
    close = next(f for f in equations.functions if f.name == "constraint_residual").results
    blocks = [close[f"residual:{c.joint}"] for c in equations.closures]
    across = np.linalg.qr(space.left[:, rank:] / space.lengths[:, np.newaxis])[0].T / equations.topology.arm
    inputs, seeds = make_inputs(equations, q, np.zeros(equations.speeds)), np.eye(len(equations.parameters))[-count:]
    changes = interpret_tangents(blocks, inputs, {"parameters": seeds}, flat_roads(equations))[1]
    still = [np.zeros((count, block.shape[0], 1)) for block in blocks]
    moving = [np.broadcast_to(changes.get(x, none), none.shape)[..., 0] for x, none in zip(blocks, still, strict=True)]
    return across @ np.concatenate(moving, axis=1).T, -across @ evaluate_closures(equations, q)[0]


def _space(jacobian: Array) -> _Space:
    lengths = np.linalg.norm(jacobian, axis=1)
    left, values, right = np.linalg.svd(balanced(jacobian))
    shares = np.zeros(max(jacobian.shape))
    shares[: len(values)] = values
    return _Space(lengths=np.maximum(lengths, 1e-4 * lengths.max()), left=left, values=shares, right=right)


def _projected(equations: RecursiveEquations, q: Array, rank: int) -> Array | None:
    """The pose near given coordinates that satisfies the equations of full rank; None if the iteration does not converge."""
    sizes = speed_scales(equations)
    for _ in range(_PROJECTIONS):
        residual, jacobian = evaluate_closures(equations, q)
        space = _space(jacobian * sizes)
        step = -space.right[:rank].T @ ((space.left[:, :rank].T @ (residual / space.lengths)) / space.values[:rank])
        q = retract(equations, q, sizes * step)
        if np.abs(step).max() < 1e-12:
            return q
    return None


def _change_point(equations: RecursiveEquations, q: Array, rank: int, lengths: Array) -> Array | None:
    """The pose near given coordinates in which one of ``rank`` independent equations depends on the others; None if none is found.
    It is a stationary point of the residuals of all that depend on the others, within these. Rows have the same ``lengths`` in all poses:
    with balanced ones it would not be seen that a row vanishes."""
    weights = speed_scales(equations) / lengths[:, np.newaxis]
    before = np.inf
    for _ in range(_PROJECTIONS):
        residual, jacobian = evaluate_closures(equations, q)
        left, values, right = np.linalg.svd(jacobian * weights)
        closing = -right[: rank - 1].T @ ((left[:, : rank - 1].T @ (residual / lengths)) / values[: rank - 1])
        dependent, free = left[:, rank - 1 :].T, right[rank - 1 :]
        ahead = [evaluate_closures(equations, retract(equations, q, _DIFFERENCE * speed_scales(equations) * d))[1] for d in free]
        curvature = np.stack([dependent @ ((other - jacobian) * weights) @ free.T for other in ahead], axis=-1) / _DIFFERENCE
        derivatives = dependent @ (jacobian * weights) @ free.T
        step = closing - free.T @ np.linalg.lstsq(curvature.reshape(-1, len(free)), derivatives.ravel(), rcond=1e-3)[0]
        size = np.abs(step).max()
        if values[rank - 1] < _NEAR * values[0] and before / 2 <= size < _NEAR:  # as near as the misfit lets equations agree on it
            return q
        q, before = retract(equations, q, speed_scales(equations) * step * _STEP / max(size, _STEP)), size
    return None


def _movable(model: Model, names: Sequence[str], cuts: Collection[str]) -> Model:
    """The model with joints that six tunable parameters each displace and rotate, with the tree that ``cuts`` define."""
    added = [
        Parameter(name=name, symbol=sympy.Symbol(name, real=True), value=0.0, unit="", binding=Binding.PARAM, span=model.span)
        for name in (f"{joint}@{k}" for joint in names for k in range(6))
    ]
    moved = _moved(model, names, np.array([p.symbol for p in added], dtype=object).reshape(-1, 6))
    joints = (replace(joint, cut=joint.name in cuts) for joint in moved.joints)
    return replace(moved, joints=tuple(joints), parameters=(*model.parameters, *added))


def _moved(model: Model, names: Sequence[str], changes: NDArray[Any]) -> Model:
    """The model with joints displaced by the first three numbers and rotated by the next three, Rodrigues' parameters."""
    places = {name: sympy.Matrix(change) for name, change in zip(names, changes.tolist(), strict=True) if any(change)}

    def point(at: Vector, name: str) -> Vector:
        return tuple(sympy.Matrix(at) + places[name][:3, 0])

    def axis(a: Vector, name: str) -> Vector:
        s, along = places[name][3:, 0], sympy.Matrix(a)
        across = s.cross(along)
        return tuple(along + 2 * (across + s.cross(across)) / (1 + s.dot(s)))

    def moved(joint: Joint) -> Joint:
        to, axes = joint.to and point(joint.to, joint.name), tuple(axis(a, joint.name) for a in joint.axes)
        return replace(joint, at=point(joint.at, joint.name), to=to, axes=axes)

    return replace(model, joints=tuple(moved(joint) if joint.name in places else joint for joint in model.joints))
