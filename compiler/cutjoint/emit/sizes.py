"""Sizes of the memory of a simulation and its derivatives."""

from cutjoint.emit.classes import SimulationCode, System, computes_energy, fitted_parameters
from cutjoint.formulate.records import Equations
from cutjoint.formulate.transposed import Derived, Linearised
from cutjoint.methods import Steps
from cutjoint.model.expressions.functions import functions_of_host
from cutjoint.program.records import Program

_NUMBERS_OF_DUAL = 9  #: doubles of a number with derivatives along eight seeds (`dual.hpp`)


def seed_rows(parts: SimulationCode, steps: Steps) -> int:
    """The rows of a seed matrix: states, discrete states, and the memory of steps; 0 without derivatives."""
    q, v, mechanism = len(parts.mechanism.coordinate_names), len(parts.mechanism.speed_names), parts.mechanism
    states = 2 * (parts.dofs or 0) + len(mechanism.state.states)
    loops = len(mechanism.equation_names)
    return 0 if parts.dofs is None else states + mechanism.discrete_states + q + (2 + steps.averages) * v + (max(loops, q) if loops else 0)


def record_length(parts: SimulationCode, steps: Steps) -> int:
    """The numbers of a record of a run; 0 without transposed functions."""
    n, _, _, state = _lengths(parts.mechanism)
    stages = 3 * (state - 2) if steps.by_residual else 0
    return 0 if parts.transposed is None else 2 * (state + steps.averages * n) + stages + parts.mechanism.discrete_states


def simulation_size(parts: SimulationCode, steps: Steps) -> int:
    """An upper bound of the bytes that a simulation takes with an integrator, which the C++ checks when it is compiled."""
    equations, start = parts.stepped, parts.mechanism
    n, m, q, state = _lengths(start)
    assembly = (n + m) * n + 3 * (n + m) + 4 * m + 12 * n + q + 2 * state
    masses = 3 * m * m + 7 * m + 3 * n
    if computes_energy(parts):
        assembly += 2 * n * n + 2 * n * m + 10 * (n + m)  # `RestReactions`
    n, m, q, state = _lengths(equations)
    others = 6 * max(state, _lengths(start)[-1])
    others += 8 * (len(equations.parameters) + 6 * len(equations.inputs) + len(equations.columns) + len(start.closures))
    if controllers := equations.topology.model.controllers:
        others += 3 * equations.discrete_states + 2 * len(controllers) + n + 32
    stored = _stored(parts.program)
    if parts.system is None:
        stored += 7 * n + 5 * m + 2 * q + min(64, m) * (2 * m + n) + 4 * m + state + (n + m if m else 0)
        stored += 0 if steps.stages else 12 * n + 8  # accelerations of steps and iterations before
        stored += n * n + 5 * n + 8 if equations.state.states and not m else 0  # `DampedNewton`
    else:
        stored += _stored(parts.system.program) + _size_of_newton(parts.system)
        if steps.finds_events:  # a second iteration, for single states, the complex tangent of stages, and what they and the step hold
            pattern = parts.system.plan.pattern
            stored += 2 * pattern.size**2 + 8 * pattern.size + 5 * len(pattern.row)
            stored += _size_of_newton(parts.system) + 40 * n + 16 * m + 4 * q + 10 * state + 12 * len(equations.indicators) + 64
    if parts.guides_jump:  # impulses, and of Newton's iteration a second one, for single states
        stored += n * n + (n + m) ** 2 + 6 * (n + m) + 12 * n + 9 * m + q + 5 * state + 2 * len(equations.indicators) + 64
        stored += 0 if parts.system is None else _size_of_newton(parts.system)
    if steps.stages:
        stored += (steps.stages + 14) * (q + n) + 3 * state + 8 * m + 12 * len(equations.indicators) + 64
    if parts.dofs is not None:
        stored += 2 * n * m + 14 * n + 4 * m + 2 * q + len(equations.indicators)
        dual = _stored(parts.program) + (0 if parts.system is None else _stored(parts.system.program))
        dual += len(equations.parameters) + len(start.closures) + len(equations.roads) + len(equations.columns)
        dual += 2 * q + 7 * n + 4 * m + 4 * parts.dofs + 2 * len(equations.state.states) + 15 * len(equations.inputs)
        stored += _NUMBERS_OF_DUAL * dual + 4 * n + 4 * m + 13 * len(equations.inputs) + 64
        stored += (1 + _NUMBERS_OF_DUAL) * equations.discrete_states
        stored += _NUMBERS_OF_DUAL * (2 * q + 3 * n) + 2 * n + 2 * state + 3 * q + 64  # of a step's derivatives
        stored += (2 + _NUMBERS_OF_DUAL) * n if steps.averages else 0
        if steps.stages and equations.indicators:  # at events
            stored += 2 * len(equations.indicators) + q + n + 64
        stored += 0 if parts.transposed is None else _size_of_adjoint(parts, parts.transposed, steps)
        stored += 0 if parts.force_residual is None else _size_of_residual(parts, parts.force_residual, steps)
        stored += 0 if parts.force_residual is None or parts.system is None else _size_of_ends(parts, parts.force_residual, steps)
    stored += 16 * len(parts.poses) + 2 + 2 * len(functions_of_host(equations.topology.model))
    dual = 0 if parts.dofs is None else 1
    stored += _size_of_fits(start, parts.program, 2, dual)
    stored += 0 if parts.system is None else _size_of_fits(equations, parts.system.program, 2, dual)
    return 8 * (stored + assembly + masses + others + 512)


def _size_of_fits(equations: Equations, program: Program, plain: int, dual: int) -> int:
    """Numbers in the fits of loops, for so many classes over doubles and over numbers with derivatives."""
    if not equations.fits:
        return 0
    parameters = len(fitted_parameters(program))
    return (sum(fit.length for fit in equations.fits) + parameters) * (plain + _NUMBERS_OF_DUAL * dual * (parameters // 8 + 2)) + 8


def _size_of_adjoint(parts: SimulationCode, transposed: Derived, steps: Steps) -> int:
    n, m, _, state = _lengths(parts.mechanism)
    inputs = 3 * len(parts.mechanism.inputs) + parts.mechanism.discrete_states
    fitted = _size_of_fits(parts.mechanism, parts.program, 3, 1)
    numbers = _stored(transposed.program) + 2 * transposed.loaded + len(transposed.equations.columns) + 3 * inputs + fitted
    numbers += 6 * steps.averages * n + transposed.equations.input_values + 64
    return numbers + len(parts.mechanism.parameters) + n + 4 * m + 7 * state + 8 * seed_rows(parts, steps)


def _size_of_residual(parts: SimulationCode, force_residual: Linearised, steps: Steps) -> int:
    """Numbers in the derivatives of the residual of the equations of motion, over doubles and with seeds of parameters."""
    n, m, q, _ = _lengths(parts.mechanism)
    inputs = 3 * len(parts.mechanism.inputs) + parts.mechanism.discrete_states
    classes = (1 + _NUMBERS_OF_DUAL) * (_stored(force_residual.program) + force_residual.equations.input_values + 16)
    fitted = _size_of_fits(force_residual.equations, force_residual.program, 3, 1)
    at_state = force_residual.length + _size_of_matrix(force_residual) + q + 2 * n + m + inputs + 28 * (q - parts.mechanism.speeds) + 8
    weights = 4 * q + 2 * n + m + inputs + force_residual.loaded
    kept = steps.stages if 2 < steps.stages <= 8 else 2  # as `visited` of `derivatives.hpp`
    fixed = 8 * (q + n + inputs + 2 * force_residual.loaded) + force_residual.loaded + weights + n + m + 64
    return classes + fitted + kept * at_state + fixed


def _size_of_matrix(force_residual: Linearised, copies: int = 1) -> int:
    """Numbers of a matrix over accelerations and multipliers, so many of each."""
    parts = force_residual.sides.parts
    *inner, border = (copies * parts.count(p) for p in range(max(parts, default=0) + 1))
    rows = [border, *(size + border for size in inner)]
    return copies * len(parts) + sum(rows) * (max(rows) + 8) + sum(size * size for size in rows)


def _size_of_ends(parts: SimulationCode, force_residual: Linearised, steps: Steps) -> int:
    """Numbers in the derivatives of coupled stages, or of the end of a step of Newton's iteration."""
    n, _, q, state = _lengths(parts.mechanism)
    balls = q - parts.mechanism.speeds
    if not steps.by_residual:
        return 4 * force_residual.length + 2 * _size_of_matrix(force_residual) + n + force_residual.loaded + 64
    size = 6 * state + 3 * (force_residual.length + n) + force_residual.loaded + balls * (90 + 9 + 27 + 9 * 12) + 64
    return size + _size_of_matrix(force_residual, 3)


def _lengths(equations: Equations) -> tuple[int, int, int, int]:
    """The numbers of speeds, equations and coordinates, and the length of a state."""
    n, m, q = len(equations.speed_names), len(equations.equation_names), len(equations.coordinate_names)
    return n, m, q, 2 + q + 2 * n + m


def _stored(program: Program) -> int:
    return sum(max(program.graph.nodes[node].lanes, 1) + 4 for node in program.stored)


def _size_of_newton(system: System) -> int:
    plan = system.plan
    n, m, q, _ = _lengths(system.equations)
    entries, rows = len(plan.pattern.row), plan.pattern.size
    arrays = 24 * n + 24 * m + 8 * q + 10 * (n + m) + 9 * len(system.equations.charts)
    pivoting = 0 if plan.pattern.symmetric else rows * rows
    return arrays + entries + plan.storage.length + pivoting + 8 * rows + 64
