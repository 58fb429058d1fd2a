"""The equations of a trimmed start: the numbers of a point, the residuals of the conditions, and their exact derivatives."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from typing import TypeAlias

import numpy as np
import sympy

from cutjoint.analysis.aims import AimedStart
from cutjoint.analysis.closing import Array, evaluate_scene_inputs, retract, retract_changes
from cutjoint.analysis.linearise import coordinate_names
from cutjoint.analysis.natural import call, evaluate_changes, evaluate_results
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.inputs import INPUT_ORDERS, INPUTS
from cutjoint.model.elements.friction import bristle_name
from cutjoint.model.expressions.parse import quantities_read, quantity_symbol
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES
from cutjoint.model.records import Aim, JointFriction, Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.program.blocks import Block
from cutjoint.program.interpret import RoadTable
from cutjoint.program.lower import reachable_blocks
from cutjoint.program.tangents import gate
from cutjoint.topology.geometry import TOLERANCE, extent

#: Changes (directions, length) of arrays, and (directions,) of inputs.
_Changes: TypeAlias = tuple[dict[str, Array], dict[str, Array]]

#: The parts of a point: changes of coordinates, speeds and states, their rates, multipliers, parameters, inputs.
MOVES, SPEEDS, RATES, MULTIPLIERS, PARAMETERS, HELD = tuple(range(6))
#: The functions that have conditions, and their arrays in the order of rows.
_CONDITIONS = ("dynamic_residual", "constraint_residual", "report")
_ROWS = ("force_residual", "residual", "rate", "curvature", "column")
#: The part that a kind of unknowns is in.
_KINDS = {"position": MOVES, "rate": SPEEDS, "state": SPEEDS, "input": HELD, "parameter": PARAMETERS}
ROUNDING, _IDLE = 1e-7, 1e-13  #: rounding: a row's largest derivative as a share of others, a column's
#: The share of the largest singular value below which one is rounding; numbers without any effect keep their values.
_SINGULAR = 1e-8
_SLOWEST, _LOOPS = 1e-3, 10.0  #: changes, 1/s, that no state need be slower than; the weight of loops


@dataclass(frozen=True, kw_only=True)
class TrimInputs:
    """The numbers of a scene in SI units: ``rates`` of speeds and states, ``targets`` of the quantities under ``hold``."""

    parameters: Mapping[str, float]
    positions: Mapping[str, float]
    rates: Mapping[str, float]
    targets: Sequence[float]
    bounds: Mapping[str, tuple[float, float]]
    roads: Mapping[str, RoadTable]


class TrimParts(AimedStart):
    """The parts of a trimmed scene's point, one vector with the numbers of all."""

    def __init__(self, model: Model, scene: Scene) -> None:
        assert scene.trim is not None
        super().__init__(model, replace(scene, assemble=(*scene.assemble, *scene.trim.hold)))
        self._trim = scene.trim
        self._system = formulate_implicit(replace(self._equations, scene=scene), self._equations.outputs)
        layout, system = self._equations.state, self._system
        self._names = (
            coordinate_names(system)[: layout.speeds], system.speed_names, system.speed_names, system.equation_names,
            tuple(p.name for p in system.parameters), tuple(p.name for p in system.inputs),
        )  # fmt: skip
        self._first = (0, *accumulate(len(names) for names in self._names))
        units = {f"{joint.name}.{name}": unit for joint in model.joints for name, unit in JOINT_QUANTITIES[joint.kind].items()}
        self._bristles = {bristle_name(f.name) for f in model.forces if isinstance(f, JointFriction)}
        self._rolling = self._slips(model)
        self._is_length = np.array([units[name] == "m/s" for name in system.speed_names[: layout.speeds]], dtype=bool)
        self._extent = extent(
            (p for joint in model.joints for p in (joint.at, joint.to) if p is not None), {p.symbol: p.value for p in model.parameters}
        )

    def _slips(self, model: Model) -> AimedStart | None:
        """The slips of wheels, where a spin is found without a guess."""
        wheels = [force for force in model.forces if force.has_road]
        if not wheels or all(unknown.kind != "rate" or unknown.entry in self._scene.rates for unknown in self._trim.find):
            return None
        slips = {f: quantity_symbol(f.name, "vx") - f.radius * quantity_symbol(f.name, "spin") for f in wheels}
        aims = (Aim(name=f.name, expression=slip, value=sympy.Integer(0), unit="m/s", size=1.0, span=f.span) for f, slip in slips.items())
        return AimedStart(model, replace(self._scene, assemble=tuple(aims)))

    def roll(self, y: Array, unguessed: Collection[str], q: Array, parameters: Mapping[str, float]) -> None:
        """Set speeds without a guess to those at which wheels roll without slip."""
        if self._rolling is not None and (at := self._at(SPEEDS, unguessed)):
            count = self._equations.speeds
            v = np.zeros((1 + len(at), len(self._names[SPEEDS])))
            v[:] = y[self._first[SPEEDS] : self._first[RATES]]
            v[range(1, 1 + len(at)), [i - self._first[SPEEDS] for i in at]] += 1.0
            slip, *by_speed = self._rolling.places_at(parameters, q, v[:, :count])
            y[at] -= np.linalg.lstsq((np.array(by_speed) - slip).T, slip)[0]

    def _at(self, part: int, names: Collection[str]) -> list[int]:
        return [self._first[part] + i for i, name in enumerate(self._names[part]) if name in names]

    def _error(self, words: str, remedy: str, name: str = "") -> RunError:
        span = next((unknown.span for unknown in self._trim.find if f"'{unknown.name}'" == name), self._trim.span)
        return RunError(f"{span}: scene '{self._scene.name}': trim: {words}; {remedy}")


@dataclass(frozen=True, kw_only=True)
class Evaluated:
    """A point, the residuals and their derivatives by the free numbers, in shares of rows' and columns' sizes."""

    y: Array
    left: Array
    A: Array
    rows: Array
    columns: Array
    _decomposed: dict[bytes, tuple[Array, Array, Array]] = field(default_factory=dict)

    def shortest(self, moving: Array, left: Array, damping: float) -> Array:
        """The short x of the ``moving`` columns for small |A x + left| / rows."""
        if (key := moving.tobytes()) not in self._decomposed:
            self._decomposed[key] = np.linalg.svd(self.A[:, moving], full_matrices=False)
        U, values, right = self._decomposed[key]
        squares = values**2 + damping
        inverse = np.where(squares > (_SINGULAR * values.max(initial=0.0)) ** 2, values / np.where(squares > 0, squares, 1.0), 0.0)
        return np.asarray(-(inverse * ((left / self.rows) @ U)) @ right)

    @property
    def worst(self) -> float:
        """The largest relative residual of a condition."""
        return float(np.abs(self.left / self.rows).max(initial=0.0)) if np.isfinite(self.left).all() else np.inf


class TrimEquations:
    """The conditions of a trimmed scene as functions of a point."""

    def __init__(self, of: TrimParts, inputs: TrimInputs) -> None:
        self._of, self._inputs, self._find = of, inputs, {u.name: u for u in of._trim.find}
        self._names, self._first, self._system, self._start = of._names, of._first, of._system, of._equations
        self._targets = np.array(inputs.targets)
        self._q, _ = of._coordinates_of(inputs.positions)
        self._begins = dict(zip(self._start.coordinate_names, self._q.tolist(), strict=True))
        guessed = {*of._scene.near, *(unknown.entry for unknown in of._trim.find)}
        _, moves = of._coordinates_of({name: value for name, value in inputs.positions.items() if name not in guessed})
        y, system = np.zeros(self._first[-1]), self._system
        y[self._part(PARAMETERS)] = [inputs.parameters[name] for name in self._names[PARAMETERS]]
        laws = evaluate_scene_inputs(system, y[self._part(PARAMETERS)], 0.0)
        y[self._part(HELD)] = laws[INPUTS][:: len(INPUT_ORDERS)] if self._names[HELD] else 0.0
        y[self._part(SPEEDS)] = [inputs.rates.get(name, 0.0) for name in self._names[SPEEDS]]
        of.roll(y, [u.entry for u in of._trim.find if u.kind == "rate" and u.entry not in inputs.rates], self._q, inputs.parameters)
        self._free = np.zeros(len(y), dtype=bool)
        self._free[self._part(MOVES)] = moves
        self._free[self._part(MULTIPLIERS)] = True
        states = {state.entry for state in system.state.states} - of._scene.starts.keys()
        read = {f"{name}.{quantity}" for aim in of._scene.assemble for name, quantity in quantities_read(aim.expression)}
        speeds = {*self._names[SPEEDS][: self._start.speeds]}
        self._free[of._at(SPEEDS, states | ((read & speeds) - inputs.rates.keys()))] = True
        self._free[of._at(RATES, [unknown.entry for unknown in of._trim.unsteady])] = True
        self._listed = {name: index for name, unknown in self._find.items() for index in of._at(_KINDS[unknown.kind], [unknown.entry])}
        if unplaced := [name for name in self._find if name not in self._listed]:
            raise of._error(f"'{unplaced[0]}' is not a coordinate of a tree joint", "find that of another joint")
        self._free[[*self._listed.values()]] = True
        self._found = {name: index for name, index in self._listed.items() if self._find[name].kind == "input"}
        known = self._free[self._part(SPEEDS)] | np.array([name in inputs.rates for name in self._names[SPEEDS]], dtype=bool)
        self._dependent = np.flatnonzero(~known[: self._start.speeds])
        self._sizes = np.where(y == 0.0, 1.0, np.abs(y))
        self._sizes[self._part(MOVES)], self.begin = np.where(of._is_length, of._extent, 1.0), y
        first = self._first[SPEEDS] + self._start.speeds
        nominal = np.array([state.nominal for state in self._start.state.states])
        self._sizes[first : first + len(nominal)] = np.maximum(np.abs(y[first : first + len(nominal)]), nominal)
        rows = len(system.speed_names) * [1] + 2 * len(system.equation_names) * [0] + len(system.equation_names) * [1]
        self._forces = np.array(rows + len(self._targets) * [0])
        self._counts = np.ones(len(self._forces), dtype=bool)
        results = {name: block for f in _CONDITIONS for name, block in system.function(f).results.items() if name in system.slots}
        order = sorted(results, key=lambda name: (_ROWS.index(system.slots[name].array), system.slots[name].offset))
        self._results = {name: results[name] for name in order}
        self._gates = _gates(self._results.values(), {f"v:{state.name}" for state in system.state.states})
        self._engaged: Collection[Block] = ()
        self._has_dependent = False
        if self._dependent.size and self._names[MULTIPLIERS]:
            arrays, roads, held = self._point(y)
            moves_on = y[self._part(SPEEDS)][: self._start.speeds].any() or self._free[self._part(SPEEDS)][: self._start.speeds].any()
            self._has_dependent = bool(moves_on or call(system, "constraint_residual", arrays, roads, held)["rate"].any())
        self._reach = np.zeros(len(self._forces) - self._start.speeds)
        self._lower, self._upper = np.full(len(y), -np.inf), np.full(len(y), np.inf)
        for i, state in enumerate(self._start.state.states, start=first):
            bounds = (-1.0, 1.0) if self._is_still() and state.name in of._bristles else state.bounds  # it sticks there
            if bounds and self._free[i]:
                self._lower[i], self._upper[i] = bounds
        for name, (lower, upper) in inputs.bounds.items():
            index, begin = self._listed[name], self._begins.get(name, 0.0)
            self._lower[index], self._upper[index] = lower - begin, upper - begin
            self._sizes[index] = upper - lower
        self._begin_within_bounds(of._at(SPEEDS, states))

    def _begin_within_bounds(self, states: Sequence[int]) -> None:
        """Set states without a guess to the bound that they move to at the first guess of speeds."""
        if not np.isfinite(self._lower[states]).any():
            return
        lower, upper, last = self._lower[states], self._upper[states], self._first[RATES]
        rates = -self.residuals(self.begin)[[i - last + len(self._names[SPEEDS]) for i in states]]
        moves = np.abs(rates) > _SLOWEST * (upper - lower)
        self.begin[states] = np.where(moves, np.where(rates > 0, upper, lower), self.begin[states])

    def _is_still(self) -> bool:
        speeds = slice(self._first[SPEEDS], self._first[SPEEDS] + self._start.speeds)
        return not (self.begin[speeds].any() or self._free[speeds].any())

    def keep_guesses(self, of: TrimEquations) -> None:
        """Count moves of free coordinates from where those of other equations begin."""
        for chart in self._start.charts:
            balls = [chart.scalars] * (4 * chart.ball)
            for at, speed in enumerate([*range(chart.scalars), *balls], chart.q):
                if self._free[chart.v + speed]:
                    self._q[at] = of._q[at]

    def _part(self, part: int) -> slice:
        return slice(self._first[part], self._first[part + 1])

    def _point(self, y: Array) -> tuple[dict[str, Array], Mapping[str, RoadTable], dict[str, Array]]:
        """The arrays of functions, the roads and the found inputs at points (..., numbers); other inputs follow the scene."""
        moves, v, vdot, multipliers, parameters, _ = np.split(y, self._first[1:-1], axis=-1)
        q = retract(self._start, np.broadcast_to(self._q, (*y.shape[:-1], len(self._q))), moves)
        still = {"t": np.zeros(1), "motion": np.ones(1), "penalty": np.zeros(1)}
        arrays = {**still, "q": q, "v": v, "vdot": vdot, "lambda": multipliers, "parameters": parameters}
        held = {name: y[..., index] for name, index in self._found.items()}
        if self._has_dependent:
            arrays["v"] = self._with_dependent_speeds(arrays, held)
        return arrays, self._inputs.roads, held

    def _with_dependent_speeds(self, arrays: Mapping[str, Array], held: Mapping[str, Array]) -> Array:
        """The speeds (..., speeds): those neither given nor found have minimum norm."""
        rate = call(self._system, "constraint_residual", arrays, self._inputs.roads, held)["rate"]
        m = len(self._names[MULTIPLIERS])
        by_row = {name: arrays[name][..., np.newaxis, :] for name in ("q", "parameters")}
        J = call(self._system, "apply_jacobian_transposed", {**by_row, "w": np.eye(m)})["force"]
        J = np.broadcast_to(J, (*arrays["v"].shape[:-1], m, J.shape[-1]))
        v = arrays["v"].copy()
        v[..., self._dependent] -= np.einsum("...ij,...j->...i", np.linalg.pinv(J[..., self._dependent], rcond=TOLERANCE), rate)
        return v

    def _changes(self, y: Array, of: tuple[dict[str, Array], Mapping[str, RoadTable], dict[str, Array]]) -> _Changes:
        """The changes of a point's arrays and found inputs by the free numbers."""
        arrays, roads, held = of
        moves, v, vdot, multipliers, parameters, _ = np.split(np.eye(len(y))[self._free], self._first[1:-1], axis=-1)
        changes = {"vdot": vdot, "lambda": multipliers, "parameters": parameters, "v": v}
        changes["q"] = retract_changes(self._start, self._q, y[self._part(MOVES)], moves)
        by_input = {name: np.eye(len(y))[self._free, index] for name, index in self._found.items()}
        if self._has_dependent:
            changes["v"] = self._dependent_speed_changes(arrays, changes, roads, held, by_input)
        return changes, by_input

    def _dependent_speed_changes(
        self, arrays: Mapping[str, Array], changes: Mapping[str, Array], roads: Mapping[str, RoadTable], held: Mapping[str, Array],
        by_input: Mapping[str, Array],
    ) -> Array:  # fmt: skip
        """The changes of speeds of which some are dependent, by the derivative of the pseudoinverse. Source: Golub and Pereyra, SIAM J.
        Numer. Anal. 10, 1973."""
        m, at = len(self._names[MULTIPLIERS]), self._dependent

        def moved(function: str, array: str, arrays: Mapping[str, Array]) -> Array:
            slots = self._system.slots
            results = {n: b for n, b in self._system.function(function).results.items() if n in slots and slots[n].array == array}
            found = evaluate_changes(self._system, results, arrays, changes, roads, held, by_input)
            return np.concatenate([found[n][1] for n in sorted(found, key=lambda n: slots[n].offset)], axis=-1)

        transposed = {"q": arrays["q"], "parameters": arrays["parameters"], "w": np.eye(m)}
        J = np.broadcast_to(call(self._system, "apply_jacobian_transposed", transposed)["force"], (m, len(arrays["v"])))[:, at]
        inverse, v = np.linalg.pinv(J, rcond=TOLERANCE), changes["v"].copy()
        turned = moved("apply_jacobian_transposed", "force", {**arrays, "w": inverse.T @ arrays["v"][at]})[:, at]
        v[:, at] += turned @ (np.eye(len(at)) - inverse @ J).T - moved("constraint_residual", "rate", arrays) @ inverse.T
        return v

    def residuals(self, y: Array) -> Array:
        """The residuals at points (..., numbers) of the conditions that count now: forces and states, loops with their rates, targets."""
        arrays, roads, held = self._point(y)
        if self._engaged:
            none = {"parameters": np.zeros((0, len(self._names[PARAMETERS])))}
            moved = evaluate_changes(self._system, self._results, arrays, none, roads, held, touching=self._engaged)
            found = {name: value for name, (value, _) in moved.items()}
        else:
            found = evaluate_results(self._system, self._results, arrays, roads, held)
        columns = [np.broadcast_to(column, (*y.shape[:-1], column.shape[-1])) for column in found.values()]
        return self._counted(np.concatenate([np.zeros((*y.shape[:-1], 0)), *columns], axis=-1))

    def _counted(self, left: Array) -> Array:
        left[..., left.shape[-1] - len(self._targets) :] -= self._targets
        return np.where(self._counts, left, 0.0)

    def evaluated(self, y: Array) -> Evaluated:
        """The residuals and their derivatives at a point."""
        sizes = np.maximum(self._sizes, np.abs(y))
        sizes[self._part(MOVES)] = self._sizes[self._part(MOVES)]
        free, point = np.flatnonzero(self._free), self._point(y)
        changes = self._changes(y, point)
        found = evaluate_changes(self._system, self._results, point[0], changes[0], *point[1:], changes[1], self._engaged)
        left = self._counted(np.concatenate([np.zeros(0), *(value for value, _ in found.values())]))
        A = np.concatenate([np.zeros((len(free), 0)), *(change for _, change in found.values())], axis=1).T * sizes[free]
        A[~self._counts] = 0.0
        A[~np.isfinite(A)] = 0.0
        ties = np.isin(free, np.arange(self._first[MULTIPLIERS], self._first[PARAMETERS]))
        largest = np.abs(A[: len(self._names[SPEEDS]), ~ties]).max(initial=0.0)
        weights = np.abs(A[:, ties]).max(axis=0, initial=0.0)
        weights[weights <= _IDLE * weights.max(initial=0.0)] = 0.0
        scale = np.where(weights > 0, (largest or 1.0) / np.where(weights > 0, weights, 1.0), 0.0)
        A[:, ties] *= scale
        sizes[free[ties]] *= np.where(scale > 0, scale, 1.0)
        rows = np.abs(A).max(axis=1, initial=0.0)
        joints = self._start.speeds
        states, ties_at = len(self._names[SPEEDS]), len(self._names[MULTIPLIERS])
        for part in (slice(0, joints), *(slice(states + k * ties_at, states + (k + 1) * ties_at) for k in range(3))):
            rows[part] = np.maximum(rows[part], ROUNDING * rows[part].max(initial=0.0))
        if ties_at:  # what closes a loop's rate or acceleration may have no free number left, and their derivatives are rounding then
            slots = {name: point[0][name] for name in ("q", "parameters")}
            J = call(self._system, "apply_jacobian_transposed", {**slots, "w": np.eye(ties_at)})["force"]
            closing = np.broadcast_to(np.where(np.isfinite(J), np.abs(J), 0.0).max(axis=-1), ties_at)
            rows[states + ties_at : states + 3 * ties_at] = np.maximum(rows[states + ties_at : states + 3 * ties_at], np.tile(closing, 2))
        rows[joints:states] = np.maximum(rows[joints:states], _SLOWEST * self._sizes[self._part(SPEEDS)][joints:])
        rows[joints:] = self._reach = np.maximum(self._reach, rows[joints:])  # derivatives vanish where values are out of reach
        rows = np.where(rows > 0, rows, np.maximum(1.0, np.abs(left)))
        rows[len(self._names[SPEEDS]) :][: len(self._names[MULTIPLIERS])] /= _LOOPS
        A /= rows[:, np.newaxis]
        largest = np.abs(A).max(axis=0, initial=0.0)
        A[:, largest <= _IDLE] = 0.0
        largest = np.where((largest > _IDLE) & (free >= self._first[SPEEDS] + joints), largest, 1.0)  # joints' sizes are rad and m
        return Evaluated(y=y, left=left, A=A / largest, rows=rows, columns=sizes[free] / largest)


def _gates(results: Collection[Block], states: Collection[str]) -> set[Block]:
    """The conditions of contacts: choices between a value and zero that depend on coordinates and speeds, not on states or multipliers."""
    reads: dict[Block, frozenset[str]] = {}
    for block in reachable_blocks(results):
        symbol = str(block.data) if block.op == "symbol" else ""
        reads[block] = frozenset([symbol.partition(":")[0] if symbol.startswith(("q:", "lambda:")) else symbol] if symbol else ()).union(
            *(reads[a] for a in block.args))  # fmt: skip
    return {b.args[0] for b in reads if gate(b) and "q" in reads[b.args[0]] and reads[b.args[0]].isdisjoint({"lambda", *states})}
