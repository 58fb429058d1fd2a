"""Equations of cut joints that follow from the others, in every pose or in a singular one, and reactions that are determined nevertheless.

Multipliers lambda of a motion are determined up to the null space of the transposed Jacobian: n with A^T n = 0 has no effect on motion. A
component of a reaction that some such n changes is statically indeterminate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from cutjoint.analysis.closing import Array, FlatRoad, Pose, explore, make_inputs
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.inputs import DISCRETE_STATES, INPUTS
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.elements.friction import refuse_friction
from cutjoint.model.expressions.quantities import quantities, read_by
from cutjoint.model.records import Model, Output, Reaction, Scene
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.build import build_topology
from cutjoint.topology.geometry import TOLERANCE
from cutjoint.topology.records import Topology

# Equations

#: An equation is as good as the best one left if its independent part is at least this share of it; the file's order decides among these.
_GOOD_ENOUGH = 0.01
_PART = 1e-6  #: an equation whose part in another's combination is below this share has none
_TIMES = 9  #: how many times of a scene symmetry is tried at, since a force may act for a while
_DAMPING = 1e-13  #: damping of the combinations by the largest square of a row, for poses in which the kept equations are dependent
#: A component that changes by less than this share of the effects of its single multipliers is determined: the rest is rounding.
_DETERMINED = 1e-6


@dataclass(frozen=True, kw_only=True)
class RedundantEquation:
    """An equation that follows from those kept. ``joint`` is the cut joint or gear, ``equation`` its short name, ``place`` file and line.
    ``instead`` names the kept equations any one of which is redundant in its stead in some pose."""

    joint: str
    equation: str
    place: str
    instead: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Redundancy:
    """``structural`` equations are redundant in every pose, ``momentary`` ones in the design position only."""

    structural: tuple[RedundantEquation, ...]
    momentary: tuple[RedundantEquation, ...]


def find_redundancy(equations: RecursiveEquations, poses: Sequence[Pose]) -> Redundancy:
    """The redundant equations over the poses of ``explore``; of those that might be kept, the first in the file are."""
    rank = max(p.rank for p in poses)
    regular = [p.jacobian for p in poses if p.rank == rank]
    kept = choose_independent(regular, rank)
    left = [i for i in range(len(equations.equation_names)) if i not in set(kept)]
    momentary: list[int] = []
    here = kept
    if poses[0].rank < rank:
        within = choose_independent([poses[0].jacobian[kept]], poses[0].rank)
        here = [kept[i] for i in within]
        momentary = [i for i in kept if i not in set(here)]
    return Redundancy(structural=_name(equations, left, kept, regular), momentary=_name(equations, momentary, here, [poses[0].jacobian]))


def choose_independent(jacobians: Sequence[Array], rank: int) -> list[int]:
    """Rows that are independent in all matrices (m, n) of one rank, in order, by QR of the transposes with common pivots.
    A pivot is the first row whose distance from the rows chosen is, in every matrix, not too small a share of the largest such distance;
    if there is none, the row that is best in its worst matrix."""
    rest = [jacobian.copy() for jacobian in jacobians]
    norms = np.stack([np.linalg.norm(matrix, axis=1) for matrix in rest])
    floor = TOLERANCE * norms.max(axis=1, initial=0.0, keepdims=True) + np.finfo(float).tiny
    chosen: list[int] = []
    for _ in range(rank):
        shares = (norms / np.maximum(norms.max(axis=1, keepdims=True), floor)).min(axis=0)
        shares[chosen] = -1.0
        pivot = int(np.flatnonzero(shares >= min(_GOOD_ENOUGH, 0.9 * shares.max()))[0])
        chosen.append(pivot)
        for matrix, norm, least in zip(rest, norms, floor[:, 0], strict=True):
            along = matrix[pivot] / max(norm[pivot], least)
            overlap = matrix @ along
            touched = np.flatnonzero(overlap)
            matrix[touched] -= np.outer(overlap[touched], along)
            norm[touched] = np.linalg.norm(matrix[touched], axis=1)
    return sorted(chosen)


def _name(
    equations: RecursiveEquations, rows: Sequence[int], kept: Sequence[int], jacobians: Sequence[Array]
) -> tuple[RedundantEquation, ...]:
    names = [(c.joint, name) for c in equations.closures for name in c.names]
    places = {element.name: element.span.place for element in equations.topology.closing}
    taking_part = _combinations(rows, kept, jacobians)
    return tuple(
        RedundantEquation(
            joint=names[row][0], equation=names[row][1], place=places[names[row][0]],
            instead=tuple(".".join(names[i]) for i, takes_part in zip(kept, column, strict=True) if takes_part),
        )
        for row, column in zip(rows, taking_part.T, strict=True)
    )  # fmt: skip


def _combinations(rows: Sequence[int], kept: Sequence[int], jacobians: Sequence[Array]) -> NDArray[np.bool_]:
    """Return whether each kept row (first axis) takes part in the combination that gives a redundant row (second), in any matrix."""
    result = np.zeros((len(kept), len(rows)), dtype=bool)
    for jacobian in jacobians if result.size else ():
        base, others = jacobian[kept], jacobian[rows]
        gram = base @ base.T
        damping = _DAMPING * gram.diagonal().max()
        factors = np.linalg.solve(gram + damping * np.eye(len(kept)), base @ others.T)
        parts = np.abs(factors) * np.linalg.norm(base, axis=1)[:, np.newaxis]
        result |= parts > _PART * np.linalg.norm(jacobian, axis=1).max()
    return result


# Reactions


def reaction_outputs(model: Model) -> tuple[Output, ...]:
    """All components of all reactions of a model."""
    return tuple(
        Output(element=reaction.name, quantity=quantity, span=reaction.span)
        for reaction in model.reactions if isinstance(reaction, Reaction) for quantity in quantities(reaction)
    )  # fmt: skip


def find_indeterminate(topology: Topology, scene: Scene, outputs: Sequence[Output]) -> tuple[str, ...]:
    """The columns among ``outputs`` that are components of reactions and indeterminate, in the design position or in poses near it."""
    if topology.embedded:  # by the equations of the joints that functions close
        topology = build_topology(replace(topology.model, embedded_loops=()))
    names = {reaction.name for reaction in topology.model.reactions if isinstance(reaction, Reaction)}
    requested = tuple({read.column: read for o in outputs for read in read_by(topology.model, o) if read.element in names}.values())
    if not requested or not topology.closing:
        return ()
    equations = formulate_recursive(topology, scene, requested)
    shares = np.max([_shares(equations, pose) for pose in _regular(explore(equations))], axis=0)
    loose = {output.column for output, share in zip(requested, shares, strict=True) if share > _DETERMINED}
    return tuple(o.column for o in outputs if any(read.column in loose for read in read_by(topology.model, o)))


def require_loads(topology: Topology, scene: Scene) -> Topology:
    """A topology whose friction has the loads that it follows from.
    Raises ModelError: redundant equations leave the load of a joint's friction open."""
    forces = [f for f in topology.model.forces if f.by_load and is_active(f, scene)]
    if not forces or not topology.closing:
        return topology
    equations = formulate_recursive(topology, scene, tuple(Output(element=f.name, quantity="load", span=f.span) for f in forces))
    poses = _regular(explore(equations))
    shares = np.max([_shares(equations, pose) for pose in poses], axis=0)
    loose = [f.name for f, share in zip(forces, shares, strict=True) if share > _DETERMINED]
    spaces = [left @ left.T for left in (np.linalg.svd(pose.jacobian)[0][:, pose.rank :] for pose in poses)]
    is_constant = all(np.allclose(space, spaces[0], atol=1e-6) for space in spaces)  # multipliers that begin orthogonal to it stay so
    if loose and not (is_constant and all(_is_even(equations, *at) for at in product(poses, np.linspace(0.0, scene.end, _TIMES)))):
        raise refuse_friction(
            topology.model, loose,
            "redundant equations of its loop leave the joint's load undetermined, so that its load-dependent friction has no value",
            "give joints of the loop more freedom until 'check' finds no redundant equation, or leave out arm or thrust_radius",
        )  # fmt: skip
    return topology


def _is_even(equations: RecursiveEquations, pose: Pose, t: float) -> bool:
    """Return whether multipliers of the null space and their opposites give the same loads in any motion of the loops.
    By symmetry such multipliers are zero, as across the plane of a planar mechanism with forces in this plane."""
    random = np.random.default_rng(7)
    left, _, right = np.linalg.svd(pose.jacobian)
    null, free = left[:, pose.rank :].T, right[pose.rank :]
    v, vdot = random.standard_normal((2, len(free))) @ free
    rows = pose.jacobian @ random.standard_normal(equations.speeds)
    size = np.linalg.norm(rows) or 1.0
    inputs = make_inputs(equations, pose.q, v, t) | {"motion": np.ones(1)}
    inputs |= {f"vdot:{c.joint}": vdot[c.v : c.v + len(c.speed_names)] for c in equations.charts}
    acting = {INPUTS, DISCRETE_STATES, *(f"v:{state.name}" for state in equations.state.states)} & inputs.keys()
    inputs |= {name: inputs[name] + random.standard_normal(inputs[name].shape) for name in sorted(acting)}
    one, other = (_columns(equations, inputs, rows + sign * size * null) for sign in (1, -1))
    return bool(np.allclose(one, other, rtol=1e-7, atol=1e-9 * size))


def _shares(equations: RecursiveEquations, pose: Pose) -> Array:
    """The largest change of each column by unit multipliers of the null space of either sign, as a share of that by single multipliers."""
    null = np.linalg.svd(pose.jacobian)[0][:, pose.rank :].T
    still, single = make_inputs(equations, pose.q, np.zeros(equations.speeds)), np.eye(len(equations.equation_names))
    unloaded = _columns(equations, still, np.zeros((1, len(single))))
    changes = np.abs(_columns(equations, still, np.concatenate([null, -null])) - unloaded)
    sizes = np.linalg.norm(_columns(equations, still, single) - unloaded, axis=0)
    shares: Array = changes.max(axis=0, initial=0.0) / np.where(sizes > 0, sizes, 1.0)
    return shares


def _regular(poses: Sequence[Pose]) -> list[Pose]:
    rank = max(pose.rank for pose in poses)
    return [pose for pose in poses if pose.rank == rank]


def _columns(equations: RecursiveEquations, inputs: Mapping[str, Array], multipliers: Array) -> Array:
    loaded = {f"lambda:{c.joint}": multipliers[:, c.first : c.first + len(c.names)] for c in equations.closures}
    results = equations.function("report").results
    found = interpret_blocks(results.values(), {**inputs, **loaded}, {name: FlatRoad() for name in equations.roads})
    return np.stack([np.broadcast_to(found[block][..., 0, 0], len(multipliers)) for block in results.values()], axis=1)
