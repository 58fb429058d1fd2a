"""Systems in natural coordinates as numbers: states that satisfy their equations, Jacobians, tangents, equations that depend on others."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from cutjoint.analysis import closing
from cutjoint.analysis.closing import Array
from cutjoint.formulate.inputs import DISCRETE_STATES, INPUT_ORDERS, INPUTS, discrete_state_name
from cutjoint.formulate.natural.equations import LagrangianEquations
from cutjoint.formulate.records import SystemEquations
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.program.blocks import Block
from cutjoint.program.interpret import RoadTable, interpret_blocks
from cutjoint.program.tangents import interpret_tangents
from cutjoint.topology.geometry import TOLERANCE

#: The arrays of a call that input symbols' columns stand in.
_ARRAYS = ("q", "v", "vdot", "lambda", "w", "relative_q", "relative_v", "weights.ball_tangents")
_OFF = 0.05  #: the displacement (m, rad) of free speeds from a pose that is the only one
_INDEPENDENT = 1e-7  #: the least part of a normalised row that the rows before it do not have


@dataclass(frozen=True, kw_only=True)
class NaturalState:
    """Natural coordinates and their rates."""

    q: Array
    v: Array


def call(
    equations: SystemEquations, function: str, arrays: Mapping[str, Array], roads: Mapping[str, RoadTable] | None = None,
    held: Mapping[str, float | Array] = MappingProxyType({}),
) -> dict[str, Array]:  # fmt: skip
    """The results of a function by array, in the interpreter; ``arrays`` and so on as for `evaluate_results`.
    Only entries of the tangent with a slot are returned."""
    results = {name: block for name, block in equations.function(function).results.items() if name in equations.slots}
    pieces: dict[str, list[tuple[int, Array]]] = {}
    for name, column in evaluate_results(equations, results, arrays, roads, held).items():
        slot = equations.slots[name]
        pieces.setdefault(slot.array, []).append((slot.offset, column))
    return {array: _joined([p for _, p in sorted(parts, key=lambda part: part[0])]) for array, parts in pieces.items()}


def evaluate_results(
    equations: SystemEquations, results: Mapping[str, Block], arrays: Mapping[str, Array], roads: Mapping[str, RoadTable] | None = None,
    held: Mapping[str, float | Array] = MappingProxyType({}),
) -> dict[str, Array]:  # fmt: skip
    """Results (..., length) by name, in the interpreter; arguments that ``arrays`` lacks are zero or parameters' defaults.
    Arrays of inputs (..., length) are named as the generated functions' arguments, and may carry batch axes, as may values (...) of
    inputs that are ``held`` and do not follow the scene. Without ``roads`` they are flat."""
    roads = closing.flat_roads(equations) if roads is None else roads
    values = interpret_blocks(results.values(), _inputs(equations, arrays, held), roads)
    return {name: values[block][..., 0] for name, block in results.items()}


def evaluate_changes(
    equations: SystemEquations, results: Mapping[str, Block], arrays: Mapping[str, Array], changes: Mapping[str, Array],
    roads: Mapping[str, RoadTable] | None, held: Mapping[str, float | Array], by_input: Mapping[str, Array] = MappingProxyType({}),
    touching: Collection[Block] = (),
) -> dict[str, tuple[Array, Array]]:  # fmt: skip
    """Results (length,) by name, and their exact changes (directions, length). ``changes`` (directions, length) are those of arrays
    (length,), ``by_input`` (directions,) those of constant inputs; other arguments as of `evaluate_results` and `interpret_tangents`."""
    by_parameters, count = changes["parameters"], len(changes["parameters"])
    laws = closing.scene_input_changes(equations, arrays["parameters"], by_parameters, float(arrays["t"][0]))
    seeds = {"parameters": by_parameters, **laws}
    if by_input:
        seeds.setdefault(INPUTS, np.zeros((count, len(equations.slots[INPUTS].names))))
    for i, parameter in enumerate(equations.inputs):
        if parameter.name in held and INPUTS in seeds:
            first = len(INPUT_ORDERS) * i
            seeds[INPUTS][:, first : first + len(INPUT_ORDERS)] = 0.0
            seeds[INPUTS][:, first] = by_input.get(parameter.name, 0.0)
    for symbol, slot in equations.slots.items():
        if slot.array in changes and slot.array in _ARRAYS:
            seeds[symbol] = changes[slot.array][:, slot.offset : slot.offset + len(slot.names)]
    seeds = {name: seed for name, seed in seeds.items() if seed.any()}
    roads = closing.flat_roads(equations) if roads is None else roads
    values, moved = interpret_tangents(results.values(), _inputs(equations, arrays, held), seeds, roads, touching)
    return {
        name: (values[block][..., 0], moved[block][..., 0] if block in moved else np.zeros((count, block.shape[0])))
        for name, block in results.items()
    }


def _joined(parts: Sequence[Array]) -> Array:
    batch = np.broadcast_shapes(*(p.shape[:-1] for p in parts))
    return np.concatenate([np.broadcast_to(p, (*batch, p.shape[-1])) for p in parts], axis=-1)


def _inputs(equations: SystemEquations, arrays: Mapping[str, Array], held: Mapping[str, float | Array]) -> dict[str, Array]:
    start = equations.start
    inputs = closing.make_inputs(start, np.zeros(start.coordinates), np.zeros(start.speeds))
    inputs |= {name: arrays[name] for name in ("parameters", "penalty", "weights", "t", "motion") if name in arrays}
    inputs |= closing.evaluate_scene_inputs(equations, inputs["parameters"], float(inputs["t"][0]))
    for i, parameter in enumerate(equations.inputs):
        if parameter.name in held:
            first, number = len(INPUT_ORDERS) * i, np.asarray(held[parameter.name])
            shape = np.broadcast_shapes(number.shape, inputs[INPUTS].shape[:-1])
            inputs[INPUTS] = np.broadcast_to(inputs[INPUTS], (*shape, inputs[INPUTS].shape[-1])).copy()
            inputs[INPUTS][..., first : first + len(INPUT_ORDERS)] = np.stack([number, 0 * number, 0 * number], axis=-1)
    for i, value in enumerate(equations.topology.model.discrete_states):
        inputs[DISCRETE_STATES][..., i] = held.get(discrete_state_name(value), inputs[DISCRETE_STATES][..., i])
    for symbol, slot in equations.slots.items():
        if slot.array in _ARRAYS:
            size = len(slot.names)
            inputs[symbol] = arrays[slot.array][..., slot.offset : slot.offset + size] if slot.array in arrays else np.zeros(size)
    return inputs


def closed_states(equations: LagrangianEquations) -> list[NaturalState]:
    """The recursive equations' closed poses in natural coordinates, each with speeds along a free motion."""
    rng = np.random.default_rng(0)
    return [_moving(equations, pose, rng) for pose in closing.explore(equations.start)]


def states_off_a_single_pose(equations: LagrangianEquations, states: Sequence[NaturalState]) -> list[NaturalState]:
    """States with open loops along free speeds of the only closed pose.
    Equations that are dependent there too are so structurally, as in a planar loop; others in the closed pose only. None where other
    poses say it, and where no speed is free: what is kept then holds the pose."""
    if len(states) > 1:
        return []
    pose = closing.explore(equations.start)[0]
    free, sizes = pose.free, closing.speed_scales(equations.start)
    if not free.size:
        return []
    rng = np.random.default_rng(1)
    directions = (free @ rng.standard_normal(free.shape[1]) for _ in range(2))
    shifts = (_OFF * direction / np.abs(direction / sizes).max() for direction in directions)
    poses = (replace(pose, q=closing.retract(equations.start, pose.q, shift)) for shift in shifts)
    return [_moving(equations, off, rng) for off in poses]


def _moving(equations: LagrangianEquations, pose: closing.Pose, rng: np.random.Generator) -> NaturalState:
    free = pose.free
    speeds = free @ rng.standard_normal(free.shape[1])
    states = np.zeros(len(equations.state.states))
    placed = call(equations, "initial_coordinates", {"relative_q": pose.q, "relative_v": np.concatenate([speeds, states])})
    nothing = np.zeros(0)  # of a mechanism that does not move
    return NaturalState(q=placed.get("q", nothing), v=placed.get("v", nothing))


def constraint_jacobian(equations: SystemEquations, arrays: Mapping[str, Array]) -> Array:
    """Phi_q, (equations, unknowns); ``arrays`` are those of `evaluate_results`."""
    m, n = len(equations.equation_names), equations.unknowns
    if m == 0:
        return np.zeros((0, n))
    return np.broadcast_to(call(equations, "apply_jacobian_transposed", {**arrays, "w": np.eye(m)})["force"], (m, n))


def dependent_equations(equations: LagrangianEquations, states: Sequence[NaturalState]) -> tuple[str, ...]:
    """The names of equations that follow from the others in every state: the last of those that depend on each other.
    The rows kept have the rank of all in each state that has the largest rank."""
    sizes = [1 / equations.topology.arm if angular else 1.0 for angular in equations.angular] + [1.0] * len(equations.state.states)
    jacobians = [constraint_jacobian(equations, {"q": state.q}) * sizes for state in states]
    if not jacobians[0].shape[0]:
        return ()
    values = [np.linalg.svd(J, compute_uv=False) for J in jacobians]
    ranks = [int(np.sum(of > TOLERANCE * of.max(initial=0.0))) for of in values]
    best = [J for J, rank in zip(jacobians, ranks, strict=True) if rank == max(ranks)]
    kept: list[int] = []
    reduced = [J / np.linalg.norm(J, axis=1, keepdims=True).clip(1e-300) for J in best]
    bases = [np.zeros((0, J.shape[1])) for J in best]
    for row in range(len(best[0])):
        rests = [J[row] - basis.T @ (basis @ J[row]) for J, basis in zip(reduced, bases, strict=True)]
        if min(np.linalg.norm(rest) for rest in rests) > _INDEPENDENT:
            kept.append(row)
            rests = [rest - basis.T @ (basis @ rest) for basis, rest in zip(bases, rests, strict=True)]  # again, for what rounding left
            bases = [np.vstack([basis, rest / np.linalg.norm(rest)]) for basis, rest in zip(bases, rests, strict=True)]
    return tuple(name for row, name in enumerate(equations.equation_names) if row not in kept)


def tangent_samples(equations: LagrangianEquations, states: Sequence[NaturalState], dt: float) -> Iterator[Array]:
    """Values of the tangent's entries at states, as a step of dt has them and as the start has them.
    The constraints have the same weight in both: it multiplies rows and columns of the multipliers, and pivots do not depend on it. That
    of a mechanism far from a metre is its mass, so that no entry is rounding."""
    bodies, known = equations.topology.model.bodies, {p.symbol: p.value for p in equations.topology.model.parameters}
    weight = 1.0 if equations.topology.arm == 1 else sum(evaluate(body.mass, known) for body in bodies) or 1.0
    for state in states:
        for weights in ((dt / 2, dt * dt / 4, weight), (0.0, 0.0, weight)):
            arrays = {"q": state.q, "v": state.v, "penalty": np.zeros(1), "weights": np.array(weights)}
            yield call(equations, "linearise", arrays)["tangent"]
