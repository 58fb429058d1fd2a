"""A start that is trimmed: coordinates, speeds, states, inputs and parameters at which rates are zero, loops closed, and targets met.

One least-squares problem has all equations.  Its Jacobian shows which unknowns are determined and which equations conflict.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from cutjoint.analysis.closing import Array
from cutjoint.analysis.linearise import Point, linearise
from cutjoint.analysis.natural import evaluate_results
from cutjoint.analysis.trim_equations import (
    HELD,
    MOVES,
    MULTIPLIERS,
    PARAMETERS,
    RATES,
    ROUNDING,
    SPEEDS,
    Evaluated,
    TrimEquations,
    TrimInputs,
    TrimParts,
)
from cutjoint.methods import join_and
from cutjoint.model.records import Found, SolvedTrim
from cutjoint.package.renamed import with_old_members
from cutjoint.program.blocks import Block

_MET = 1e-9  #: residuals below this, as shares of what a change of an unknown by its size makes, are met
_SINGULAR = 1e-6  #: singular values where columns have length one that are rounding
_ITERATIONS, _SLOW, _IDLE, _TRIALS = 60, 4, 8, 5
_SHARE = 0.25  #: the share of the distance to the targets that the first step of the continuation covers
_ROUNDED = 1e-13  #: a step that is rounding, in sizes of unknowns
_LONGER, _DAMPING = 10.0, 1e-10  #: the factor by which implicit steps grow at most, and the least damping
#: Implicit steps: how many, the longest first one, s or s^2, the share of a singular value that counts, refinements where contacts close,
#: residuals below which steps that hardly reduce them end.
_STEPS, _FIRST, _RANK, _REFINED, _CREEPING = 100, 1.0, 1e-14, 12, 1e-3
_ALIKE, _ENOUGH = 1e-2, 2  #: the search ends after so many trials whose residuals equal the best one within this share
#: The farthest step, random start and find from one, rad or extents; the share of the worst below which conditions are not named.
_FARTHEST, _STRAY, _LOST, _NAMED = 0.3, 0.6, 1.5, 0.2


@with_old_members
@dataclass(frozen=True, kw_only=True)
class Trimmed:
    """The result of a trim.

    * ``unknowns``, ``units``: by name; ``coordinates``, ``rates``, ``states``: of the whole start, by place
    * ``unsteady``: rates with units, of those that may change
    * ``residual``: the largest share to which a condition is not met
    * ``redundant``: targets that follow from other conditions
    * ``steady``: the conditions stay met in the motion
    * ``from_random_start``: found from random coordinates, because no solution was near the given ones
    * ``gradients``: derivatives of the unknowns, by parameter
    """

    unknowns: Mapping[str, float]
    units: Mapping[str, str]
    unsteady: Mapping[str, tuple[float, str]]
    residual: float
    redundant: tuple[str, ...]
    steady: bool
    from_random_start: bool
    gradients: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    coordinates: Mapping[str, float] = field(repr=False)
    rates: Mapping[str, float] = field(repr=False)
    states: Mapping[str, float] = field(repr=False)
    point: Point = field(repr=False, compare=False)
    solved: SolvedTrim = field(repr=False, compare=False)


class TrimmedStart(TrimParts):
    """The conditions of a trimmed scene, met."""

    def trim(self, inputs: TrimInputs, changed: Mapping[str, tuple[float, TrimInputs, TrimInputs]] = MappingProxyType({})) -> Trimmed:
        """The trimmed start, with gradients by parameters: ``changed`` has by name a small change and the numbers with less and with more.
        Raises RunError: an unknown is not determined, or no start meets all conditions."""
        search = _Search(self, inputs)
        found = search.best()
        if found.worst > _MET and (unaffected := search.unaffected(found)):
            words = f"too few unknowns: none of them changes {join_and(unaffected)}"
            raise self._error(words, "list one that does under 'find', or prescribe less")
        if idle := search.idle(found):
            remedy = "remove it from 'find', or add a condition on what it changes"
            raise self._error(f"no condition depends on {join_and(idle)}", remedy, idle[0])
        if found.worst > _MET:
            raise self._error(*search.failure(found))
        if undetermined := search.undetermined(found):
            words = f"too many unknowns: {join_and(undetermined)} can change together without violating a condition"
            raise self._error(words, "give one of them a value, or add a condition", undetermined[0])
        return replace(search.result(found), gradients={name: search.gradient(found, *of) for name, of in changed.items()})

    def follows(self, parameter: str, inputs: Any) -> bool:
        """Return whether conditions follow from a tunable parameter; ``inputs`` is that of `trim`."""
        search = _Search(self, replace(inputs, parameters={**inputs.parameters, parameter: np.nan}))
        return bool(np.isnan(search.residuals(search.begin)).any())


class _Search(TrimEquations):
    _is_random = False

    def best(self) -> Evaluated:
        """The point that meets the conditions, else the nearest of several tries; loops and targets are met first."""
        self._counts = self._forces == 0
        found = self._nearest(self.begin)
        if found.worst <= _MET:
            self._counts = np.ones_like(self._counts)
            found = self._nearest(self._balanced(found.y))
        return found

    def _balanced(self, y: Array) -> Array:
        """The point with the multipliers that balance forces best: derivatives by coordinates depend on them."""
        at, forces, free = self.evaluated(y), self._forces == 1, np.flatnonzero(self._free)
        ties = (self._first[MULTIPLIERS] <= free) & (free < self._first[PARAMETERS])
        if ties.any() and np.isfinite(at.left).all():
            x = np.linalg.lstsq(at.A[forces][:, ties], -(at.left / at.rows)[forces], rcond=_SINGULAR)[0]
            y = y.copy()
            y[free[ties]] += x * at.columns[ties]
        return y

    def _nearest(self, begin: Array) -> Evaluated:
        best, rng, alike = self._approach(begin), np.random.default_rng(0), 0
        if best.worst > _MET and (apart := self._without_targets()) is not None:
            return min(best, apart, key=lambda evaluated: evaluated.worst)
        if best.worst <= _MET and self._is_still() and self._closed(begin) != self._closed(best.y):
            best = sunk if (sunk := self._by_relaxation(begin)).worst <= _MET else best  # not balanced on two feet of three
        for search in (self._by_relaxation, self._from_engaged_contacts, self._by_continuation):
            if best.worst > _MET:
                best = min(best, search(begin), key=lambda evaluated: evaluated.worst)
        listed = np.isin(np.arange(len(begin)), [*self._listed.values()])
        for trial in range(_TRIALS):
            if best.worst <= _MET or alike == _ENOUGH:
                break
            stray = np.where(self._free & (listed | (trial > 0)), rng.uniform(-_STRAY, _STRAY, len(begin)) * self._sizes, 0.0)
            found = self._approach(begin + stray)
            if found.worst <= _MET and np.abs(((found.y - begin) / self._sizes)[self._part(MOVES)]).max(initial=0.0) > _LOST:
                continue
            self._is_random |= found.worst <= _MET and trial > 0
            alike += abs(found.worst - best.worst) <= _ALIKE * best.worst
            best = min(best, found, key=lambda evaluated: evaluated.worst)
        return best

    def _without_targets(self) -> Evaluated | None:
        """The point that the conditions besides targets determine as far as it changes targets: other tries meet these by chance only."""
        counts, others = self._counts, np.arange(len(self._counts)) < len(self._forces) - len(self._targets)
        if others.all() or not counts.all():
            return None
        self._counts = counts & others
        found = self._by_relaxation(self.begin)
        self._counts = counts
        at = self.evaluated(found.y)
        ranks = [np.linalg.matrix_rank(self._columns(at)[of], tol=_SINGULAR) for of in (counts, others)]
        return at if found.worst <= _MET and ranks[0] == ranks[1] else None

    def _from_engaged_contacts(self, begin: Array) -> Evaluated:
        """Start with all contacts engaged, pulling where they are open; then release those that pull, until none does."""
        self._engaged = self._gates
        return self._release(self._approach(begin))

    def _release(self, found: Evaluated) -> Evaluated:
        while self._engaged and np.isfinite(found.left).all():
            kept = self._closed(found.y) & {*self._engaged}
            self._engaged = () if len(kept) == len(self._engaged) else kept
            found = self._approach(found.y)
        self._engaged = ()
        return found

    def _closed(self, y: Array) -> set[Block]:
        """The conditions of contacts that are met at a point."""
        arrays, roads, held = self._point(y)
        met = evaluate_results(self._system, {str(i): gate for i, gate in enumerate(self._gates)}, arrays, roads, held)
        return {gate for gate, is_met in zip(self._gates, met.values(), strict=True) if is_met.all()}

    def _by_relaxation(self, begin: Array) -> Evaluated:
        """Pseudo-transient continuation (Kelley and Keyes, SIAM J. Numer. Anal. 35, 1998), then a search from there.
        Implicit steps of growing size: states by their rates, in a start at rest also coordinates by M q' = F."""
        y, joints, every, span = np.clip(begin, self._lower, self._upper), self._start.speeds, self._free, _FIRST
        own = np.array([*range(joints), *range(self._first[SPEEDS] + joints, self._first[RATES])], dtype=int)
        rows = np.flatnonzero(every[own] & (self._is_still() | (np.arange(len(own)) >= joints)))
        masses = (self.residuals(y + np.eye(len(y))[self._first[RATES] + rows]) - self.residuals(y)).T
        if not (rows.size and np.isfinite(masses).all()):
            return self.evaluated(y)
        inverse, sizes = np.linalg.pinv(masses), self._sizes[own[rows]]
        among = np.arange(len(masses)) if self._is_still() else rows
        if not self._is_still():
            self._engaged, self._free = self._gates, np.isin(np.arange(len(every)), own[rows])
        at = np.searchsorted(np.flatnonzero(self._free), own[rows])
        least, last = np.inf, 0
        for n in range(_STEPS):
            here = self.evaluated(y)
            fastest = np.abs(inverse @ here.left / sizes).max()
            least, last = (here.worst, n) if here.worst < 0.99 * least else (least, last)
            creeps = n - last > _IDLE and least < _CREEPING  # along a direction that hardly anything restores
            if here.worst <= _MET / 100 or not fastest or fastest * span > 1 / ROUNDING or creeps:
                break
            span = min(_FARTHEST / fastest, span)
            A = here.A.copy()
            A[:, at] += masses * here.columns[at] / (span * here.rows[:, np.newaxis])
            high = np.abs(A).max(axis=1, keepdims=True)  # of full rank, even with stiff contacts on bodies that move freely
            A /= (high := np.where(high > 0, high, 1.0))
            wide = np.where((wide := np.abs(A).max(axis=0)) > 0, wide, 1.0)
            step = -np.linalg.lstsq((A / wide)[among], (here.left / here.rows / high[:, 0])[among], rcond=_RANK)[0] / wide
            moved = self._shortened(here, step, rows[rows < joints], at[rows < joints])
            y, span = (y, span / 8) if moved is None else (moved, _LONGER * span)
        self._free = every
        return self._release(self._approach(y))

    def _shortened(self, at: Evaluated, step: Array, rows: Any, columns: Any) -> Array | None:
        """The point after a step, shortened where contacts push back more than forces drive; None where no step remains."""

        def drive(y: Array) -> Array:
            return np.asarray(-self.residuals(y)[..., rows] @ (step * at.columns)[columns])

        y, low, high = self._after_step(at, step)[0], 0.0, 1.0
        if not len(rows) or ((begun := float(drive(at.y))) >= 0 and drive(y) >= -begun):
            return y
        for _ in range(_REFINED if begun > 0 else 0):
            shares = np.linspace(low, high, 17)
            driven = drive(at.y + shares[:, np.newaxis] * (y - at.y))
            last = max(1, int(np.argmax(driven < 0)))
            low, high = shares[last - 1], shares[last]
            if driven[last - 1] <= begun / 10:
                break
        return at.y + low * (y - at.y) if low > 0 else None

    def _by_continuation(self, _: Array) -> Evaluated:
        """Continuation from the initial values of the targets to the wanted ones, by steps as large as the search can follow."""
        wanted, self._targets = self._targets, np.zeros(len(self._targets))
        begun = self.residuals(self.begin)[len(self._forces) - len(wanted) :]
        share, step, at = 0.0, _SHARE, None
        while share < 1 and (at is None or step > _SHARE / 32):
            self._targets = begun + (share + step * (at is not None)) * (wanted - begun)
            found = self._by_relaxation(self.begin) if at is None else self._approach(at.y)
            if found.worst <= _MET:
                share, step, at = (0.0, step, found) if at is None else (share + step, min(2 * step, 1 - share - step), found)
            elif at is None:
                break
            else:
                step /= 2
        self._targets = wanted
        return self.evaluated(self.begin if at is None else at.y)

    def _after_step(self, at: Evaluated, step: Array) -> tuple[Array, float]:
        """The point after a step within the bounds, and the admissible share of the step."""
        moves, y = np.flatnonzero(self._free) < self._first[MOVES + 1], at.y.copy()
        far = np.abs(step * at.columns / self._sizes[self._free])[moves].max(initial=0.0)
        share = min(1.0, _FARTHEST / max(far, 1e-300))
        y[self._free] += share * step * at.columns
        return np.clip(y, self._lower, self._upper), share

    def _approach(self, y: Array) -> Evaluated:
        """The least-squares solution by damped steps within the bounds. A step is accepted if the next one with the same derivatives is
        shorter, which does not depend on the weights of residuals (Deuflhard, Newton Methods for Nonlinear Problems, 2011, ch. 3)."""
        at, damping, slow, least, last = self.evaluated(np.clip(y, self._lower, self._upper)), 0.0, 0, np.full(2, np.inf), 0
        for n in range(_ITERATIONS):
            if not np.isfinite(at.left).all() or not at.left.any():
                break
            moving, step = self._step(at, damping)
            if (length := float(np.linalg.norm(step))) <= _ROUNDED and at.worst <= _MET:
                break
            size = np.array([length, np.linalg.norm(at.left / at.rows)])
            least, last = np.minimum(least, size), n if (size < 0.99 * least).any() else last
            if n - last > _IDLE and at.worst > _MET:
                break  # it circles about a point that meets no conditions
            y, share = self._after_step(at, step)
            left = self.residuals(y)
            after = np.linalg.norm(at.shortest(moving, left, damping)) if np.isfinite(left).all() else np.inf
            if after < length * (1 - share / 1e4):
                at, damping, slow = self.evaluated(y), damping / 8 if damping > _DAMPING else 0.0, slow + 1 if after > 0.99 * length else 0
                if slow == _SLOW:
                    break
            elif (damping := 8 * max(damping, _DAMPING)) > 1e3 or at.worst < _MET / 100:
                break
        return at

    def _step(self, at: Evaluated, damping: float) -> tuple[Any, Array]:
        """The columns that move, and the step (columns,) in their sizes; a number at a bound that it would cross stays there."""
        y, lower, upper = at.y[self._free], self._lower[self._free], self._upper[self._free]
        moving: Any = at.A.any(axis=0)
        while True:
            step = np.zeros(len(moving))
            step[moving] = at.shortest(moving, at.left, damping)
            stopped = moving & (((y <= lower) & (step < 0)) | ((y >= upper) & (step > 0)))
            if not stopped.any():
                return moving, step
            moving &= ~stopped

    def _columns(self, at: Evaluated) -> Array:
        """The derivatives with all columns of length one, but for those of zeros."""
        lengths = np.linalg.norm(at.A, axis=0)
        return np.asarray(at.A / np.where(lengths > 0, lengths, 1.0))

    def idle(self, at: Evaluated) -> list[str]:
        """The listed unknowns on which no condition depends."""
        if not self._counts.all():
            counts, self._counts = self._counts, np.ones_like(self._counts)
            at, self._counts = self.evaluated(at.y), counts
        still = {*np.flatnonzero(self._free)[~at.A.any(axis=0)].tolist()}
        return [f"'{name}'" for name, index in self._listed.items() if index in still]

    def unaffected(self, at: Evaluated) -> list[str]:
        """The conditions that are not met and that no unknown changes."""
        missed = (np.abs(at.left / at.rows) > _MET) & ~at.A.any(axis=1)
        return list(dict.fromkeys(words for words, is_missed in zip(self._conditions(at), missed, strict=True) if is_missed))[:4]

    def undetermined(self, at: Evaluated) -> list[str]:
        """The listed unknowns that can change while all conditions stay met, then all values that change with them."""
        free, A = np.flatnonzero(self._free), self._columns(at)
        _, values, right = np.linalg.svd(A, full_matrices=True)
        null = right[int(np.sum(values > _SINGULAR)) :].T
        listed = np.isin(free, [*self._listed.values()])
        _, shares, combined = np.linalg.svd(null[listed], full_matrices=False)
        moved = np.abs(null @ combined[shares > _SINGULAR].T).max(axis=1, initial=0.0) > np.where(listed, _SINGULAR, 0.05)
        names, first = [name.removesuffix(".value") for part in self._names for name in part], self._first
        order = [*free[moved & listed].tolist(), *free[moved & ~listed].tolist()]
        return [f"'{names[index]}'" for index in order if not first[RATES] <= index < first[PARAMETERS]]

    def failure(self, at: Evaluated) -> tuple[str, str]:
        """The error message: conditions that no start meets, and the remedy."""
        if not np.isfinite(at.left).all():
            return "its conditions have no finite value where the search begins", "give other positions, rates or states"
        shares = np.abs(at.left / at.rows)
        missed = np.flatnonzero(shares > max(_MET, _NAMED * shares.max()))
        aims = missed[missed >= len(shares) - len(self._targets)]
        conditions = [*self._conditions(at)]
        if aims.size and not self._counts.all():  # open loops count against distances to targets, however small their shares
            opened = np.flatnonzero(shares[: len(shares) - len(self._targets)] * self._counts[: len(shares) - len(self._targets)] > _MET)
            missed = np.concatenate([aims, opened])
        words = [conditions[i] for i in missed]
        stopped = [(n, i) for n, i in self._listed.items() if at.y[i] in (self._lower[i], self._upper[i])]
        at_bounds = [f"'{n}' = {at.y[i] + self._begins.get(n, 0.0):.6g}" for n, i in stopped]
        bound = f", with {join_and(at_bounds)} at the bound" if at_bounds else ""
        nearest = f"no start meets all conditions{bound}; the nearest has {join_and(list(dict.fromkeys(words))[:4])}"
        if possible := [*self._possible(aims)]:
            nearest += f"; with the others met, {' or '.join(possible)} is possible"
        A = self._columns(self.evaluated(self.begin))
        rows = int(np.sum(np.abs(A).max(axis=1, initial=0.0) > 0))
        if at_bounds:
            return nearest, "widen the bounds, or remove conditions"
        if np.linalg.matrix_rank(A, tol=_SINGULAR) < rows:
            remedy = "list unknowns that change them under 'find', rates that may differ from zero under 'unsteady', or remove conditions"
            return f"too few unknowns, or conditions that contradict each other: {nearest}", remedy
        return nearest, "write other values, or begin nearer with 'positions' and 'near'"

    def _possible(self, aims: Any) -> Iterator[str]:
        """The values of unmet targets to which the other conditions that count lead."""
        counts, first = self._counts, len(self._forces) - len(self._targets)
        for i in aims:
            self._counts = counts & (np.arange(len(counts)) != i)
            found = self._approach(self._balanced(self.begin))
            self._counts = counts
            rows = self._columns(self.evaluated(found.y))
            ranks = [np.linalg.matrix_rank(rows[of], tol=_SINGULAR) for of in (counts, counts & (np.arange(len(counts)) != i))]
            if found.worst <= _MET and ranks[0] == ranks[1]:
                aim, value = self._of._scene.assemble[i - first], self._targets[i - first] + self.residuals(found.y)[i]
                yield f"'{aim.name}' = {value / aim.size:.6g} {aim.unit}".rstrip()

    def _conditions(self, at: Evaluated) -> Iterator[str]:
        for name, is_length, left in zip(self._names[MOVES], self._of._is_length, at.left, strict=False):
            yield f"{abs(left):.4g} {'N' if is_length else 'N*m'} missing along '{name}'"
        for state, left in zip(self._start.state.states, at.left[self._start.speeds :], strict=False):
            yield f"'{state.name}' changing by {-left:.4g} {state.unit or '1'}/s"
        for words in ("open", "opening", "opening faster"):
            yield from (f"the loop of '{name}' {words}" for name in self._names[MULTIPLIERS])
        for aim, wanted, left in zip(self._of._scene.assemble, self._targets, at.left[len(at.left) - len(self._targets) :], strict=True):
            yield f"'{aim.name}' = {(wanted + left) / aim.size:.4g} in place of {wanted / aim.size:.6g} {aim.unit}".rstrip()

    def gradient(self, at: Evaluated, change: float, less: TrimInputs, more: TrimInputs) -> dict[str, float]:
        """The derivatives of the listed unknowns by a number that the conditions follow from: the implicit function theorem."""
        left = []
        for inputs in (less, more):
            other = type(self)(self._of, inputs)
            other.keep_guesses(self)
            left.append(other.residuals(np.where(self._free, at.y, other.begin)))
        moving: Any = at.A.any(axis=0)
        step = np.zeros(len(moving))
        step[moving] = at.shortest(moving, (left[1] - left[0]) / (2 * change), 0.0)
        moved = dict(zip(np.flatnonzero(self._free).tolist(), step * at.columns, strict=True))
        return {name: float(moved[index]) for name, index in self._listed.items()}

    def result(self, at: Evaluated) -> Trimmed:
        """The start, and the targets that follow from other conditions."""
        arrays, _, held = self._point(at.y)
        left, values, _ = np.linalg.svd(at.A)
        follows = (np.abs(left[len(at.left) - len(self._targets) :, int(np.sum(values > _SINGULAR)) :]) > _SINGULAR).any(axis=1)
        q, speeds = self._of._with_reversed_attitudes(arrays["q"]), self._start.speeds
        point = Point(
            t=0.0, q=arrays["q"], v=arrays["v"], vdot=arrays["vdot"], parameters=arrays["parameters"], roads=self._inputs.roads,
            held={name: float(value) for name, value in held.items()},
        )  # fmt: skip
        rates = dict(zip(self._names[SPEEDS], arrays["v"].tolist(), strict=True))
        coordinates = dict(zip(self._start.coordinate_names, q.tolist(), strict=True))
        numbers = dict(zip(self._listed, at.y[[*self._listed.values()]].tolist(), strict=True))
        known = {**coordinates, **rates}
        return Trimmed(
            unknowns={name: known.get(self._find[name].entry, number) for name, number in numbers.items()}, coordinates=coordinates,
            rates={name: rates[name] for name in self._names[SPEEDS][:speeds]},
            states={name: rates[name] for name in self._names[SPEEDS][speeds:]},
            units={name: unknown.unit for name, unknown in self._find.items()}, residual=at.worst, unsteady={
                unknown.name: (float(at.y[i]), f"{unknown.unit or '1'}/s".replace("/s/s", "/s^2"))
                for unknown in self._of._trim.unsteady for i in self._of._at(RATES, [unknown.entry])
            },
            steady=linearise(self._system, point, at_rest=False).steady, point=point, from_random_start=self._is_random,
            redundant=tuple(aim.name for aim, is_so in zip(self._of._scene.assemble, follows, strict=True) if is_so),
            solved=self._solved(at.y, known),
        )  # fmt: skip

    def _solved(self, y: Array, known: Mapping[str, float]) -> SolvedTrim:
        kinds = {MOVES: "move", SPEEDS: "rate", PARAMETERS: "parameter", HELD: "input"}
        listed: dict[Any, float] = {
            index: known[self._find[name].entry] - y[index] for name, index in self._listed.items() if self._find[name].kind == "position"
        }
        found = []
        for part, kind in kinds.items():
            names = self._names[SPEEDS if part == MOVES else part]
            for i in np.flatnonzero(self._free[self._part(part)]) + self._first[part]:
                size = self._sizes[i] if part == MOVES else max(self._sizes[i], abs(y[i]))
                begin, lower, upper = (float(listed.get(i, 0.0) + x) for x in (y[i], self._lower[i], self._upper[i]))
                found.append(Found(kind=kind, name=names[i - self._first[part]], begin=begin, size=float(size), lower=lower, upper=upper))
        return SolvedTrim(
            aims=self._of._scene.assemble, found=tuple(found), dependent=frozenset(self._names[SPEEDS][i] for i in self._dependent),
            unsteady=frozenset(unknown.entry for unknown in self._of._trim.unsteady),
        )  # fmt: skip
