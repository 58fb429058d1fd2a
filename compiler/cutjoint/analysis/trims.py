"""A start that is trimmed: coordinates, speeds, states, inputs and parameters at which rates are zero, loops closed, and values as given.

One least-squares problem has all equations.  Its Jacobian tells which unknowns are determined and which equations conflict.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from typing import Any

import numpy as np

from cutjoint.analysis.aims import AimedStart
from cutjoint.analysis.closing import Array, evaluate_scene_inputs, retract
from cutjoint.analysis.linearise import Point, coordinate_names
from cutjoint.analysis.natural import call, evaluate_results
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.inputs import INPUT_ORDERS, INPUTS
from cutjoint.methods import join_and
from cutjoint.model.expressions.parse import quantities_read
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.program.interpret import RoadTable
from cutjoint.topology.geometry import TOLERANCE, extent

#: The parts of a point: changes of coordinates, speeds and states, their rates, multipliers, parameters, inputs.
_MOVES, _SPEEDS, _RATES, _MULTIPLIERS, _PARAMETERS, _INPUTS = tuple(range(6))
#: The functions that have conditions, and their arrays in the order of rows.
_CONDITIONS = ("dynamic_residual", "constraint_residual", "report")
_ROWS = ("force_residual", "residual", "rate", "curvature", "column")
#: The part that a kind of unknowns is in.
_KINDS = {"position": _MOVES, "rate": _SPEEDS, "state": _SPEEDS, "input": _INPUTS, "parameter": _PARAMETERS}
#: Differences as a share of an unknown's size; residuals below `_MET`, as shares of what a change of that size makes, are met.
_DIFFERENCE, _MET = 1e-5, 1e-9
#: Rounding: a row's largest derivative as a share of others, a column's, singular values where columns have length one.
_ROUNDING, _IDLE, _LOOSE = 1e-7, 1e-9, 1e-6
_ITERATIONS, _SLOW, _TRIALS = 60, 4, 5
#: The least damping, and the share of the largest singular value below which one is rounding: numbers on which nothing depends stay.
_DAMPING, _SINGULAR = 1e-10, 1e-8
#: Trials that end as far away as the best, by this share: after so many there is nothing nearer.
_ALIKE, _ENOUGH = 1e-2, 2
#: The farthest step and random start, rad or extents; the share of the worst below which conditions are not named; the weight of loops.
_FARTHEST, _STRAY, _NAMED, _LOOPS = 0.3, 0.6, 0.2, 10.0


@dataclass(frozen=True, kw_only=True)
class Trimmed:
    """What a trim has found: ``unknowns`` with their ``units``, by name, and all ``coordinates``, ``rates`` and ``states`` by place.

    ``unsteady`` are rates, with units, of what may change.  ``residual`` the largest share to which a condition is not met, ``redundant``
    are held values that follow from other conditions.  A motion is ``steady`` if no condition feels what changes.
    """

    unknowns: Mapping[str, float]
    units: Mapping[str, str]
    unsteady: Mapping[str, tuple[float, str]]
    residual: float
    redundant: tuple[str, ...]
    steady: bool
    coordinates: Mapping[str, float] = field(repr=False)
    rates: Mapping[str, float] = field(repr=False)
    states: Mapping[str, float] = field(repr=False)
    point: Point = field(repr=False, compare=False)


@dataclass(frozen=True, kw_only=True)
class Given:
    """The numbers of a scene, SI units; ``rates`` are those of speeds with the states, ``held`` the wanted values."""

    parameters: Mapping[str, float]
    positions: Mapping[str, float]
    rates: Mapping[str, float]
    held: Sequence[float]
    bounds: Mapping[str, tuple[float, float]]
    roads: Mapping[str, RoadTable]


class TrimmedStart(AimedStart):
    """The conditions of a trimmed scene as functions of a point, one vector with the numbers of all parts."""

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
        self._is_length = np.array([units[name] == "m/s" for name in system.speed_names[: layout.speeds]], dtype=bool)
        self._extent = extent(
            (p for joint in model.joints for p in (joint.at, joint.to) if p is not None), {p.symbol: p.value for p in model.parameters}
        )

    def _at(self, part: int, names: Collection[str]) -> list[int]:
        """The indices of numbers of a part."""
        return [self._first[part] + i for i, name in enumerate(self._names[part]) if name in names]

    def trim(self, given: Given) -> Trimmed:
        """The trimmed start.

        Raises:
            RunError: an unknown is not determined, or no start meets all conditions.
        """
        search = _Search(self, given)
        found = search.best()
        if idle := search.idle(found):
            raise self._error(f"nothing that holds depends on {join_and(idle)}", "leave it out of 'find', or hold what it changes", idle[0])
        if found.worst > _MET:
            raise self._error(*search.said(found))
        if loose := search.loose(found):
            words = f"too many unknowns: {join_and(loose)} can change together and all still holds"
            raise self._error(words, "give one of them a value, or hold one condition more", loose[0])
        return search.result(found)

    def follows(self, parameter: str, given: Any) -> bool:
        """Return whether conditions follow from a tunable parameter; ``given`` is that of `trim`."""
        search = _Search(self, replace(given, parameters={**given.parameters, parameter: np.nan}))
        return bool(np.isnan(search.residuals(search.begin)).any())

    def _error(self, words: str, remedy: str, name: str = "") -> RunError:
        span = next((unknown.span for unknown in self._trim.find if f"'{unknown.name}'" == name), self._trim.span)
        return RunError(f"{span}: scene '{self._scene.name}': trim: {words}; {remedy}")


@dataclass(frozen=True, kw_only=True)
class _Tried:
    """A point, the residuals and their derivatives by the free numbers, in shares of rows' and columns' sizes."""

    y: Array
    left: Array
    A: Array
    rows: Array
    columns: Array

    @property
    def worst(self) -> float:
        """The largest share to which a condition is not met."""
        return float(np.abs(self.left / self.rows).max(initial=0.0)) if np.isfinite(self.left).all() else np.inf


class _Search:
    """Looks for a point at which all conditions are met."""

    def __init__(self, of: TrimmedStart, given: Given) -> None:
        self._of, self._given, self._find = of, given, {u.name: u for u in of._trim.find}
        self._names, self._first, self._system, self._start = of._names, of._first, of._system, of._equations
        self._held = np.array(given.held)
        self._q, _ = of._given(given.positions)
        self._begins = dict(zip(self._start.coordinate_names, self._q.tolist(), strict=True))
        guessed = {*of._scene.near, *(unknown.entry for unknown in of._trim.find)}
        _, moves = of._given({name: value for name, value in given.positions.items() if name not in guessed})
        y, system = np.zeros(self._first[-1]), self._system
        y[self._part(_PARAMETERS)] = [given.parameters[name] for name in self._names[_PARAMETERS]]
        laws = evaluate_scene_inputs(system, y[self._part(_PARAMETERS)], 0.0)
        y[self._part(_INPUTS)] = laws[INPUTS][:: len(INPUT_ORDERS)] if self._names[_INPUTS] else 0.0
        y[self._part(_SPEEDS)] = [given.rates.get(name, 0.0) for name in self._names[_SPEEDS]]
        self._free = np.zeros(len(y), dtype=bool)
        self._free[self._part(_MOVES)] = moves
        self._free[self._part(_MULTIPLIERS)] = True
        states = {state.entry for state in system.state.states} - of._scene.starts.keys()
        read = {f"{name}.{quantity}" for aim in of._scene.assemble for name, quantity in quantities_read(aim.expression)}
        speeds = {*self._names[_SPEEDS][: self._start.speeds]}
        self._free[of._at(_SPEEDS, states | ((read & speeds) - given.rates.keys()))] = True
        self._free[of._at(_RATES, [unknown.entry for unknown in of._trim.unsteady])] = True
        self._listed = {name: index for name, unknown in self._find.items() for index in of._at(_KINDS[unknown.kind], [unknown.entry])}
        if unplaced := [name for name in self._find if name not in self._listed]:
            raise of._error(f"'{unplaced[0]}' is none of the coordinates that the loops leave", "find that of another joint")
        self._free[[*self._listed.values()]] = True
        known = self._free[self._part(_SPEEDS)] | np.array([name in given.rates for name in self._names[_SPEEDS]], dtype=bool)
        self._following = np.flatnonzero(~known[: self._start.speeds])
        self._sizes = np.where(y == 0.0, 1.0, np.abs(y))
        self._sizes[self._part(_MOVES)], self.begin = np.where(of._is_length, of._extent, 1.0), y
        rows = len(system.speed_names) * [1] + 2 * len(system.equation_names) * [0] + len(system.equation_names) * [1]
        self._forces = np.array(rows + len(self._held) * [0])
        self._counts = np.ones(len(self._forces), dtype=bool)
        results = {name: block for f in _CONDITIONS for name, block in system.function(f).results.items() if name in system.slots}
        order = sorted(results, key=lambda name: (_ROWS.index(system.slots[name].array), system.slots[name].offset))
        self._results = {name: results[name] for name in order}
        self._reach = np.zeros(len(self._forces) - self._start.speeds)
        self._is_guided = any(joint.guide is not None for joint in system.topology.model.joints)
        self._lower, self._upper = np.full(len(y), -np.inf), np.full(len(y), np.inf)
        for name, (lower, upper) in given.bounds.items():
            index, begin = self._listed[name], self._begins.get(name, 0.0)
            self._lower[index], self._upper[index] = lower - begin, upper - begin
            self._sizes[index] = upper - lower

    def _part(self, part: int) -> slice:
        return slice(self._first[part], self._first[part + 1])

    def _point(self, y: Array) -> tuple[dict[str, Array], Mapping[str, RoadTable], dict[str, Array]]:
        """The arrays of functions, the roads and the inputs at points (..., numbers)."""
        moves, v, vdot, multipliers, parameters, _ = np.split(y, self._first[1:-1], axis=-1)
        q = retract(self._start, np.broadcast_to(self._q, (*y.shape[:-1], len(self._q))), moves)
        still = {"t": np.zeros(1), "motion": np.ones(1), "penalty": np.zeros(1)}
        arrays = {**still, "q": q, "v": v, "vdot": vdot, "lambda": multipliers, "parameters": parameters}
        held = {name: y[..., index] for name, index in zip(self._names[_INPUTS], range(self._first[_INPUTS], self._first[-1]), strict=True)}
        if self._following.size and self._names[_MULTIPLIERS] and (v.any() or self._is_guided):
            arrays["v"] = self._with_following(arrays, held)
        return arrays, self._given.roads, held

    def _with_following(self, arrays: Mapping[str, Array], held: Mapping[str, Array]) -> Array:
        """The speeds (..., speeds) with those neither given nor found as small as the loops allow."""
        rate = call(self._system, "constraint_residual", arrays, self._given.roads, held)["rate"]
        m = len(self._names[_MULTIPLIERS])
        by_row = {name: arrays[name][..., np.newaxis, :] for name in ("q", "parameters")}
        J = call(self._system, "apply_jacobian_transposed", {**by_row, "w": np.eye(m)})["force"]
        J = np.broadcast_to(J, (*arrays["v"].shape[:-1], m, J.shape[-1]))
        v = arrays["v"].copy()
        v[..., self._following] -= np.einsum("...ij,...j->...i", np.linalg.pinv(J[..., self._following], rcond=TOLERANCE), rate)
        return v

    def residuals(self, y: Array) -> Array:
        """What is left at points (..., numbers) of conditions that count now: of forces and states, loops with their rates, held values."""
        found = evaluate_results(self._system, self._results, *self._point(y))
        columns = [np.broadcast_to(column, (*y.shape[:-1], column.shape[-1])) for column in found.values()]
        left = np.concatenate([np.zeros((*y.shape[:-1], 0)), *columns], axis=-1)
        left[..., left.shape[-1] - len(self._held) :] -= self._held
        return np.where(self._counts, left, 0.0)

    def _tried(self, y: Array) -> _Tried:
        left = self.residuals(y)
        sizes = np.maximum(self._sizes, np.abs(y))
        sizes[self._part(_MOVES)] = self._sizes[self._part(_MOVES)]
        free = np.flatnonzero(self._free)
        steps = _DIFFERENCE * sizes[free, np.newaxis] * np.eye(len(y))[free]
        values = self.residuals(np.concatenate([y + steps, y - steps]))
        A = ((values[: len(free)] - values[len(free) :]) / (2 * _DIFFERENCE)).T
        A[~np.isfinite(A)] = 0.0
        ties = np.isin(free, np.arange(self._first[_MULTIPLIERS], self._first[_PARAMETERS]))
        largest = np.abs(A[: len(self._names[_SPEEDS]), ~ties]).max(initial=0.0)
        weights = np.abs(A[:, ties]).max(axis=0, initial=0.0)
        scale = np.where(weights > 0, (largest or 1.0) / np.where(weights > 0, weights, 1.0), 1.0)
        A[:, ties] *= scale
        sizes[free[ties]] *= scale
        rows = np.abs(A).max(axis=1, initial=0.0)
        joints = self._start.speeds
        rows[:joints] = np.maximum(rows[:joints], _ROUNDING * rows[:joints].max(initial=0.0))
        rows[joints:] = self._reach = np.maximum(self._reach, rows[joints:])  # derivatives vanish where values are out of reach
        rows = np.where(rows > 0, rows, np.maximum(1.0, np.abs(left)))
        rows[len(self._names[_SPEEDS]) :][: len(self._names[_MULTIPLIERS])] /= _LOOPS
        A /= rows[:, np.newaxis]
        A[:, np.abs(A).max(axis=0, initial=0.0) <= _IDLE] = 0.0
        return _Tried(y=y, left=left, A=A, rows=rows, columns=sizes[free])

    def best(self) -> _Tried:
        """The point that meets the conditions, else the nearest of several tries, of loops and held values first."""
        self._counts = self._forces == 0
        found = self._nearest(self.begin)
        if found.worst <= _MET:
            self._counts = np.ones_like(self._counts)
            found = self._nearest(found.y)
        return found

    def _nearest(self, begin: Array) -> _Tried:
        best, rng, alike = self._approach(begin), np.random.default_rng(0), 0
        for _ in range(_TRIALS - 1):
            if best.worst <= _MET or alike == _ENOUGH:
                break
            stray = np.where(self._free, rng.uniform(-_STRAY, _STRAY, len(begin)) * self._sizes, 0.0)
            found = self._approach(begin + stray)
            alike += abs(found.worst - best.worst) <= _ALIKE * best.worst
            best = min(best, found, key=lambda tried: tried.worst)
        return best

    def _approach(self, y: Array) -> _Tried:
        """The nearest least squares by damped steps between the bounds; one is good if the next with the same derivatives is shorter,
        however residuals are weighted (Deuflhard, Newton Methods for Nonlinear Problems, 2011, ch. 3)."""
        at, damping, slow = self._tried(np.clip(y, self._lower, self._upper)), 0.0, 0
        for _ in range(_ITERATIONS):
            if not np.isfinite(at.left).all() or not at.left.any():
                break
            moving, step = self._step(at, damping)
            moves, free = np.flatnonzero(self._free) < self._first[_MOVES + 1], self._free
            share = min(1.0, _FARTHEST / max(np.abs(step[moves]).max(initial=0.0), 1e-300))
            y = at.y.copy()
            y[free] += share * step * at.columns
            y = np.clip(y, self._lower, self._upper)
            left, length = self.residuals(y), float(np.linalg.norm(step))
            after = np.linalg.norm(_shortest(at.A[:, moving], left / at.rows, damping)) if np.isfinite(left).all() else np.inf
            if after < length * (1 - share / 1e4):
                at, damping, slow = self._tried(y), damping / 8 if damping > _DAMPING else 0.0, slow + 1 if after > 0.99 * length else 0
                if slow == _SLOW:
                    break
            elif (damping := 8 * max(damping, _DAMPING)) > 1e3 or at.worst < _MET / 100:
                break
        return at

    def _step(self, at: _Tried, damping: float) -> tuple[Any, Array]:
        """The columns that move, and the step (columns,) in their sizes; numbers at a bound that it would cross stay there."""
        y, lower, upper = at.y[self._free], self._lower[self._free], self._upper[self._free]
        moving: Any = at.A.any(axis=0)
        while True:
            step = np.zeros(len(moving))
            step[moving] = _shortest(at.A[:, moving], at.left / at.rows, damping)
            stopped = moving & (((y <= lower) & (step < 0)) | ((y >= upper) & (step > 0)))
            if not stopped.any():
                return moving, step
            moving &= ~stopped

    def _columns(self, at: _Tried) -> Array:
        """The derivatives with all columns of length one, but for those of zeros."""
        lengths = np.linalg.norm(at.A, axis=0)
        return np.asarray(at.A / np.where(lengths > 0, lengths, 1.0))

    def idle(self, at: _Tried) -> list[str]:
        """The listed unknowns on which no condition depends."""
        counts, self._counts = self._counts, np.ones_like(self._counts)
        at, self._counts = self._tried(at.y), counts
        still = {*np.flatnonzero(self._free)[~at.A.any(axis=0)].tolist()}
        return [f"'{name}'" for name, index in self._listed.items() if index in still]

    def loose(self, at: _Tried) -> list[str]:
        """The listed unknowns that can change while all conditions stay met, then what changes with them."""
        free, A = np.flatnonzero(self._free), self._columns(at)
        _, values, right = np.linalg.svd(A, full_matrices=True)
        null = right[int(np.sum(values > _LOOSE)) :].T
        listed = np.isin(free, [*self._listed.values()])
        _, shares, combined = np.linalg.svd(null[listed], full_matrices=False)
        moved = np.abs(null @ combined[shares > _LOOSE].T).max(axis=1, initial=0.0) > 0.05
        names, first = [name.removesuffix(".value") for part in self._names for name in part], self._first
        order = [*free[moved & listed].tolist(), *free[moved & ~listed].tolist()]
        return [f"'{names[index]}'" for index in order if not first[_RATES] <= index < first[_PARAMETERS]]

    def said(self, at: _Tried) -> tuple[str, str]:
        """What no start meets, and the remedy."""
        if not np.isfinite(at.left).all():
            return "its conditions have no finite value where the search begins", "give other positions, rates or states"
        shares = np.abs(at.left / at.rows)
        missed = np.flatnonzero(shares > max(_MET, _NAMED * shares.max()))
        aims = missed[missed >= len(shares) - len(self._held)]
        conditions = [*self._conditions(at)]
        words = [conditions[i] for i in (aims if aims.size and not self._counts.all() else missed)]
        stopped = [(n, i) for n, i in self._listed.items() if at.y[i] in (self._lower[i], self._upper[i])]
        at_bounds = [f"'{n}' = {at.y[i] + self._begins.get(n, 0.0):.6g}" for n, i in stopped]
        bound = f", with {join_and(at_bounds)} at the bound" if at_bounds else ""
        nearest = f"no start meets all conditions{bound}; the nearest has {join_and(list(dict.fromkeys(words))[:4])}"
        A = self._columns(self._tried(self.begin))
        rows = int(np.sum(np.abs(A).max(axis=1, initial=0.0) > 0))
        if at_bounds:
            return nearest, "widen the bounds, or hold less"
        if np.linalg.matrix_rank(A, tol=_LOOSE) < rows:
            remedy = "list under 'find' what changes them, or under 'unsteady' what may change, or give and hold less"
            return f"too few unknowns, or conditions that contradict each other: {nearest}", remedy
        return nearest, "write other values, or begin nearer with 'positions' and 'near'"

    def _conditions(self, at: _Tried) -> Iterator[str]:
        """The conditions in words with what is left of them."""
        for name, is_length, left in zip(self._names[_MOVES], self._of._is_length, at.left, strict=False):
            yield f"{abs(left):.4g} {'N' if is_length else 'N*m'} missing along '{name}'"
        for state, left in zip(self._start.state.states, at.left[self._start.speeds :], strict=False):
            yield f"'{state.name}' changing by {-left:.4g} {state.unit or '1'}/s"
        for words in ("open", "opening", "opening faster"):
            yield from (f"the loop of '{name}' {words}" for name in self._names[_MULTIPLIERS])
        for aim, wanted, left in zip(self._of._scene.assemble, self._held, at.left[len(at.left) - len(self._held) :], strict=True):
            yield f"'{aim.name}' = {(wanted + left) / aim.size:.4g} in place of {wanted / aim.size:.6g} {aim.unit}".rstrip()

    def result(self, at: _Tried) -> Trimmed:
        """The start, and the held values that follow from other conditions."""
        arrays, _, held = self._point(at.y)
        rank, first = np.linalg.matrix_rank(at.A, tol=_LOOSE), len(at.left) - len(self._held)
        follows = [np.linalg.matrix_rank(np.delete(at.A, first + i, axis=0), tol=_LOOSE) == rank for i in range(len(self._held))]
        q, speeds = self._of._turned(arrays["q"]), self._start.speeds
        changing = self._of._at(_SPEEDS, [u.entry for u in self._of._trim.unsteady if at.y[self._of._at(_RATES, [u.entry])[0]] != 0.0])
        felt = np.abs((self.residuals(at.y + 1e-3 * np.diag(self._sizes)[changing]) - at.left) / at.rows).max(initial=0.0) > _MET
        rates = dict(zip(self._names[_SPEEDS], arrays["v"].tolist(), strict=True))
        coordinates = dict(zip(self._start.coordinate_names, q.tolist(), strict=True))
        numbers = dict(zip(self._listed, at.y[[*self._listed.values()]].tolist(), strict=True))
        known = {**coordinates, **rates}
        return Trimmed(
            unknowns={name: known.get(self._find[name].entry, number) for name, number in numbers.items()}, coordinates=coordinates,
            rates={name: rates[name] for name in self._names[_SPEEDS][:speeds]},
            states={name: rates[name] for name in self._names[_SPEEDS][speeds:]},
            units={name: unknown.unit for name, unknown in self._find.items()}, residual=at.worst, unsteady={
                unknown.name: (float(at.y[i]), f"{unknown.unit or '1'}/s".replace("/s/s", "/s^2"))
                for unknown in self._of._trim.unsteady for i in self._of._at(_RATES, [unknown.entry])
            },
            steady=not felt,
            redundant=tuple(aim.name for aim, is_so in zip(self._of._scene.assemble, follows, strict=True) if is_so),
            point=Point(
                t=0.0, q=arrays["q"], v=arrays["v"], vdot=arrays["vdot"], parameters=arrays["parameters"], roads=self._given.roads,
                held={name: float(value) for name, value in held.items()},
            ),
        )  # fmt: skip


def _shortest(A: Array, left: Array, damping: float) -> Array:
    """The short x of small |A x + left|."""
    damped = np.vstack([A, np.sqrt(damping) * np.eye(A.shape[1])])
    return np.asarray(-np.linalg.lstsq(damped, np.concatenate([left, np.zeros(A.shape[1])]), rcond=_SINGULAR)[0])
