"""The fit: least squares on exact sensitivities, and what can be said of its result; combinations that data leave open."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version
from math import copysign, isfinite, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.fits.reading import read_fit
from cutjoint.fits.records import Array, Signal, Study
from cutjoint.fits.residuals import Prediction, Runs, Sims
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.package.locations import AnyPath, path_of
from cutjoint.run.outputs import is_stream
from cutjoint.run.stopping import StopRequest, stop_requests
from cutjoint.sweeps import records as sweeps
from cutjoint.sweeps.kernel import find_target
from cutjoint.sweeps.parts import require_parts_of
from cutjoint.sweeps.run import make_table
from cutjoint.sweeps.work import Work
from cutjoint.toolchain.build import FLAGS
from cutjoint.toolchain.temporary import temporary_folder

#: Singular values below these shares of the largest: nothing changes to the accuracy of derivatives; hardly anything does.
NULL, NEAR = 1e-8, 1e-4

#: A share in a combination below which a name is left out, and the collinearity (Brun, Reichert and Kuensch, 2001) that is much.
_SHARE, COLLINEAR = 0.05, 20.0
#: Shares of the parameters and of the cost by which an iteration that changes no more ends the fit.
_STEP, _CHANGE = 1e-8, 1e-8
#: The most runs of a fit, and of one to a window that others follow; the residual, as a share of signals' changes, of a model that follows.
_MOST, _FEW, _FOLLOWS = 100, 6, 0.5
#: Residuals below this share of a signal's size are rounding, and judged no further; above this multiple of a deviation they are too large.
_ROUNDING, _LOUD = 1e-7, 2.0
#: Numbers of a matrix that BLAS decomposes in one thread: a second one waits for it at full speed, which takes longer than many a run.
_BLOCK = 8000
#: Columns of the tables of fits before the parameters at the start.
_TRIES = {"starts": (), "bootstrap": ("draw",), "profiles": ("parameter", "distance", "cost", "quantile")}
#: Ends of profiles: the most fits, the share of the distance that they are right to, and that by which the parameter may move.
_SECANTS, _ENDED, _PINNED = 12, 1e-3, 1e-6
#: Exit statuses of verdicts.
STATUSES = {"": 0, "not converged": 3, "not identified": 4, "residual not white": 5}


@dataclass(frozen=True, kw_only=True)
class Identifiability:
    """What data determine of the parameters.

    * ``singular_values``: of the Jacobian by parameters as shares of their sizes, the largest first
    * ``open``, ``nearly_open``: combinations that the data do not determine, or hardly, with shares by names
    * ``collinear``: pairs with their index
    """

    singular_values: Array
    open: tuple[dict[str, float], ...]
    nearly_open: tuple[dict[str, float], ...]
    collinear: tuple[tuple[str, str, float], ...]


def identify(jacobian: Array, names: Sequence[str], sizes: Array, samples: int) -> Identifiability:
    """Judge a Jacobian (residuals, parameters) whose residuals are in units of their standard deviations.
    Those behind the ``samples`` are of priors, which may be as narrow as they like."""
    scaled = jacobian * sizes
    singular, directions = decompose(scaled)
    largest = decompose(scaled[:samples])[0][0] or 1.0
    lengths = np.linalg.norm(scaled, axis=0)
    unit = scaled / np.where(lengths > NULL * largest, lengths, np.inf)
    cosines = np.minimum(np.abs(unit.T @ unit), 1.0)
    pairs = [(names[j], names[i], float(1 / np.sqrt(1 - cosines[i, j]))) for i in range(len(names)) for j in range(i)
             if 1 - 1 / COLLINEAR**2 < cosines[i, j] < 1 - NULL]  # beyond, a combination of both is open  # fmt: skip
    return Identifiability(
        singular_values=singular, open=combine(directions[singular <= NULL * largest], names),
        nearly_open=combine(directions[(singular > NULL * largest) & (singular <= NEAR * largest)], names), collinear=tuple(pairs),
    )  # fmt: skip


def decompose(matrix: Array) -> tuple[Array, Array]:
    """Singular values and right singular vectors of a matrix (rows, columns), as many as columns."""
    _, found, directions = np.linalg.svd(np.linalg.qr(matrix, mode="r"), full_matrices=True)
    return np.pad(found, (0, matrix.shape[1] - len(found))), directions


def condense(rows: Array, jacobian: Array) -> tuple[Array, Array]:
    """Residuals, at most one more than parameters, with the cost, gradient and curvature of all; in blocks that BLAS does in one thread."""
    stacked = np.column_stack([jacobian, rows])
    height, triangle = max(_BLOCK // stacked.shape[1], 2 * stacked.shape[1]), stacked[:0]
    for first in range(0, len(stacked), height):
        triangle = np.asarray(np.linalg.qr(np.vstack([triangle, stacked[first : first + height]]), mode="r"))
    return triangle[:, -1], triangle[:, :-1]


def combine(directions: Array, names: Sequence[str]) -> tuple[dict[str, float], ...]:
    """Combinations by names.  The largest share is 1; several are combined so that each has a parameter of its own."""
    if not len(directions):
        return ()
    rows = directions.copy()
    for i in range(len(rows)):  # Gauss-Jordan elimination with complete pivoting makes names few
        rest = np.abs(rows[i:])
        row, column = (int(place) for place in np.unravel_index(rest.argmax(), rest.shape))
        rows[[i, i + row]] = rows[[i + row, i]]
        rows[i] /= rows[i, column]
        for j in range(len(rows)):
            if j != i:
                rows[j] -= rows[j, column] * rows[i]
    return tuple({name: round(float(x), 3) for name, x in zip(names, row, strict=True) if abs(x) > _SHARE} for row in rows)


def describe(combination: dict[str, float]) -> str:
    """A combination in words: relative changes that cancel."""
    return ", ".join(f"{name} {100 * share:+.3g} %" for name, share in combination.items())


@dataclass(frozen=True, kw_only=True)
class SignalResult:
    """A signal after the fit: ``rms`` of the residual and standard ``deviation`` of its noise, given or estimated, in SI units.
    ``explained`` is 1 - (residual / spread)^2; ``p_value`` is that of white noise (Ljung-Box), None if not tested."""

    experiment: str
    signal: str
    validation: bool
    samples: int
    missing: int
    rms: float
    deviation: float
    explained: float
    p_value: float | None
    autocorrelation: Array
    unit: str
    times: Array = field(repr=False)
    measured: Array = field(repr=False)
    predicted: Array = field(repr=False)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """The result of a fit, in SI units; ``fit["name"]`` is the value of a parameter.

    It has ``values``, standard ``deviations``, 95 % ``intervals`` (parameters, 2), ``correlations``
    and ``numbers`` by name, with ``ties``; ``before``, ``after``: identifiability at the start and at the result.
    ``faults`` has the verdict: nothing, or "not converged", "not identified" or "residual not white" with details."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    start: Array
    values: Array
    deviations: Array
    intervals: Array
    correlations: Array
    numbers: Mapping[str, float]
    cost: float
    iterations: int
    runs: int
    starts: tuple[float, ...]
    before: Identifiability
    after: Identifiability
    signals: tuple[SignalResult, ...]
    faults: Mapping[str, str]
    study: Study = field(repr=False)

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    @property
    def verdict(self) -> str:
        """The first fault, or "identified"."""
        return next(iter(self.faults), "identified")

    @property
    def status(self) -> int:
        """The exit status of the command."""
        return STATUSES[next(iter(self.faults), "")]


def fit(
    study: AnyPath | Mapping[str, Any], *, out: AnyPath | None = None, scheduler: str | None = None,
    note: Callable[[str], None] | None = None,
) -> Fit:  # fmt: skip
    """Fit parameters of models to measurements, by a study (file or mapping); an interrupted call with ``out`` continues.

    Args:
        out: ``starts``, ``bootstrap`` and ``profiles`` leave tables beside it, with its name and for example .starts.parquet.
        scheduler: address of a Dask scheduler for these, such as "tcp://10.0.0.1:8786".
        note: is called with messages of progress.

    Raises:
        ModelError, EquationsError, RunError: the study, a model or the data are wrong, or the runs at the start values fail.
        ToolchainError: the C++ side failed.
    """
    with temporary_folder() as folder:
        return Solver(read_fit(study), note or (lambda text: None)).solve(path_of(out) or folder / "fit", scheduler)


class Solver:
    """The steps of a fit; ``sims`` are its simulations where they have been compiled before."""

    def __init__(self, study: Study, note: Callable[[str], None], sims: Sims | None = None) -> None:
        self.study, self.note = study, note
        self.names = [p.name for p in study.parameters]
        self.sizes, self.start, self.low, self.high, self.mean, self.prior = (
            np.array([getattr(p, key) for p in study.parameters]) for key in ("size", "start", "low", "high", "mean", "deviation")
        )  # fmt: skip
        at = np.flatnonzero(np.isfinite(self.prior))
        self.known = at, self.mean[at], self.prior[at]
        for words in (f"{e.name}: {words}" for e in study.experiments for words in e.notes):
            note(words)
        self.runs = Runs(study, note, sims)
        self.signals = [s for e in study.experiments if not e.validation for s in e.signals]
        self.deviations = np.array([_spread(s) if np.isnan(s.deviation) else s.deviation for s in self.signals])
        self.open = np.array([np.isnan(s.deviation) for s in self.signals])
        self.kept: tuple[bytes, tuple[Array, Array]] = (b"", (np.zeros(0), np.zeros((0, 0))))
        self.noise: list[Array] = [np.zeros(len(s.values)) for s in self.signals]

    def solve(self, out: Path, scheduler: str | None = None) -> Fit:
        """The result; tables of starts and of the bootstrap, which a scheduler's workers fill, go beside a path."""
        from scipy.stats import qmc, t

        if is_stream(out):
            with temporary_folder() as folder:
                return self.solve(folder / "fit", scheduler)
        samples = sum(len(s.values) for s in self.signals)
        for kind in self.study.tries:
            require_parts_of(_table_of(out, kind), {"study": self.study.digest})
        try:
            self.residuals(self.start)
        except CutjointError as error:
            self.note(f"the runs with the start values fail: {error}")
            self.runs.share = 0.5 ** (self.study.windows - 1)
        jacobian, self.runs.share = self.residuals(self.start)[1], 1.0
        before = identify(jacobian, self.names, self.sizes, len(jacobian) - len(self.known[0]))
        for words in _open(before):
            self.note(f"at the start values {words}")
        if self.study.starts > 1:
            points = qmc.Sobol(len(self.names), seed=self.study.seed).random_base2(self.study.starts.bit_length())[: self.study.starts - 1]
            tried = self._try("starts", np.vstack([self.start, self.low + points * (self.high - self.low)]), out, scheduler)
            if np.isnan(tried[:, 0]).all():
                raise RunError("starts: the fits from all of them fail, the first as noted above")
            costs, (_, iterations, _, *x) = tried[:, 0], tried[np.nanargmin(tried[:, 0])]
            best = self.least_squares(np.array(x))
        else:
            best = self.through_windows(self.start)
            costs, iterations = np.array([best.cost]), best.njev
        if self.open.any():  # weights by the residuals that remain
            self._estimate(best.x)
            best = self.least_squares(best.x)
            iterations += best.njev
            self._estimate(best.x)
            if self.study.profiles:  # whose costs are by the last weights
                best = self.least_squares(best.x)
                iterations += best.njev
        for name in np.array(self.names)[best.active_mask != 0]:
            self.note(f"{name} ends at its bound")
        jacobian = self.residuals(best.x)[1]
        after = identify(jacobian, self.names, self.sizes, samples)
        deviations, correlations = self._covariance(jacobian)
        if self.study.resamples:
            draws = np.column_stack([np.arange(self.study.resamples), np.tile(best.x, (self.study.resamples, 1))])
            found = self._try("bootstrap", draws, out, scheduler)[:, 3:]
            if np.count_nonzero(~np.isnan(found[:, 0])) < 2:
                raise RunError("bootstrap: fewer than two of its fits succeed, which leaves no deviations")
            deviations = np.nanstd(found, axis=0, ddof=1)
        quantile = float(t.ppf(0.975, max(samples - len(self.names), 1)))
        intervals = best.x + np.outer([-1, 1], quantile * deviations)
        if self.study.profiles:
            intervals = self._profile(best, quantile, self._covariance(jacobian)[0], out, scheduler)
        numbers, symbols = dict(zip(self.names, map(float, best.x), strict=True)), [p.symbol for p in self.study.parameters]
        tied = {s: float(v.xreplace(dict(zip(symbols, numbers.values(), strict=True)))) for s, v in self.study.ties.items()}
        results = self._results(best.x)
        return Fit(
            names=tuple(self.names), units=tuple(p.unit for p in self.study.parameters), start=self.start, values=best.x,
            deviations=deviations, intervals=intervals.T, correlations=correlations,
            numbers=numbers | tied, cost=float(best.cost), iterations=int(iterations), runs=self.runs.count,
            starts=tuple(map(float, costs)), before=before, after=after, signals=results,
            faults=self._find_faults(best, after, intervals, quantile * deviations, results), study=self.study,
        )  # fmt: skip

    def residuals(self, theta: Array) -> tuple[Array, Array]:
        """Residuals in units of standard deviations, those of priors last, and their derivatives."""
        key = b"".join(part.tobytes() for part in (theta, np.array(self.runs.share), self.deviations, *self.known, *self.noise))
        if key != self.kept[0]:
            found = self.runs.predict(theta)
            kept = [noise[: len(p.values)] for p, noise in zip(found, self.noise, strict=True)]
            rows = [(p.values - p.signal.values - noise) / s for p, s, noise in zip(found, self.deviations, kept, strict=True)]
            shares = [r * s / _spread(x) for r, s, x in zip(rows, self.deviations, self.signals, strict=True)]
            self.missed = float(np.sqrt(np.mean(np.concatenate(shares) ** 2)))
            derivatives = [p.derivatives / s for p, s in zip(found, self.deviations, strict=True)]
            at, mean, prior = self.known
            priors, own = (theta[at] - mean) / prior, np.eye(len(theta))[at] / prior[:, None]
            self.kept = key, (np.concatenate([*rows, priors]), np.vstack([*derivatives, own]))
        return self.kept[1]

    def find_end(self, place: int, distance: float, cost: float, quantile: float, best: Array) -> Any:
        """The fit at an end of an interval by profile likelihood, with ``distance`` as a first guess.
        There the least cost over the other parameters is half the square of the quantile above that of the best, or there is a bound.
        Raises RunError: none is near."""
        limit = float((self.high if distance > 0 else self.low)[place] - best[place])
        known, begin, inside, outside, last, length = self.known, best, 0.0, np.inf, None, abs(distance)
        for _ in range(_SECANTS):
            length = min(length, abs(limit))
            end = float(np.clip(best[place] + copysign(length, distance), self.low[place], self.high[place]))
            deviation = _PINNED * (length or abs(distance))
            self.known = np.append(known[0], place), np.append(known[1], end), np.append(known[2], deviation)
            try:
                found = self.least_squares(np.where(np.arange(len(best)) == place, end, begin))
            except CutjointError:  # beyond what can run, as a mass below zero
                outside, begin, length = length, best, (inside + length) / 2
                continue
            share = sqrt(max(2 * (found.cost - cost), 0.0)) / quantile
            if abs(share - 1) < _ENDED or (share < 1 and length == abs(limit)):
                return found
            inside, outside, last = (length, outside, found) if share < 1 else (inside, length, last)
            longer = length / max(share, 0.25)
            longer = longer if inside < longer < outside else (inside + outside) / 2
            begin, length = np.clip(best + (found.x - best) * longer / length, self.low, self.high), longer
        if last is not None and outside < np.inf:  # the cost jumps, or nothing runs beyond
            return last
        raise RunError(f"the data hardly tell {self.names[place]} = {end:.6g} from the best value")

    def through_windows(self, begin: Array) -> Any:
        """The result over the whole time from those over shorter windows, which reach as far as the model follows with the last parameters.
        Later its phase may differ by turns."""
        share, iterations, first = 0.0, 0, begin
        while share < 1.0:
            least, self.runs.share = max(2 * share, 0.5 ** (self.study.windows - 1)), 1.0
            while self.runs.share > least:
                with suppress(CutjointError):
                    if self.residuals(begin) and self.missed < _FOLLOWS:
                        break
                self.runs.share /= 2
            share = self.runs.share
            if share == 1.0 and begin is not first and self._cost(first) < self._cost(begin):
                begin = first  # windows that showed nothing led away
            self.note(f"fitting to {100 * share:.3g} % of the time")
            try:
                found = self.least_squares(begin, _MOST if share == 1.0 else _FEW)
            except CutjointError:
                if begin is first:
                    raise
                begin, share = first, 0.5  # what fits a shorter window fails behind it
                continue
            begin, iterations = found.x, iterations + found.njev
        found.njev = iterations
        return found

    def _cost(self, theta: Array) -> float:
        with suppress(CutjointError):
            return float(np.sum(self.residuals(theta)[0] ** 2))
        return np.inf

    def least_squares(self, begin: Array, most: int = _MOST) -> Any:
        """SciPy's result from a start, whose unknowns are shares of sizes, after so many runs at ``most``."""
        from scipy.optimize import least_squares

        sizes, count, steps, left = self.sizes, 0, 0, False
        best = np.inf, tuple(begin)

        def evaluate(x: Array) -> tuple[Array, Array]:
            rows, jacobian = self.residuals(x * sizes)
            return condense(rows, jacobian * sizes) if self.study.loss == "linear" else (rows, jacobian * sizes)

        size = len(evaluate(begin / sizes)[0])

        def function(x: Array) -> Array:
            nonlocal count, left, best
            if not np.array_equal(x, np.clip(x, self.low / sizes, self.high / sizes)):
                left = True
                return np.full(size, np.nan)
            try:
                rows = evaluate(x)[0]
            except CutjointError as error:  # the trust region shrinks
                self.note(f"  a run failed, with a smaller step again: {error}")
                return np.full(size, np.nan)
            count, best = count + 1, min(best, (float(rows @ rows), tuple(x * sizes)))
            self.note(f"  run {count}: cost {rows @ rows / 2:.6g}, residual {self.missed:.6g} of the signals' changes")
            return rows

        try:
            for low, high in ((-np.inf, np.inf), (self.low / sizes, self.high / sizes)):  # bounds that are far away only take time
                found = least_squares(
                    function, begin / sizes, lambda x: evaluate(x)[1], bounds=(low, high), loss=self.study.loss,
                    x_scale=1.0, ftol=_CHANGE, xtol=_STEP, gtol=1e-14, max_nfev=most,
                )  # fmt: skip
                steps, begin = steps + found.njev - 1, np.clip(found.x * sizes, self.low, self.high)  # less the first run
                if not left:
                    break
        except BaseException as stop:  # by the user too
            values = ", ".join(f"{name}: {{start: {x:.12g}}}" for name, x in zip(self.names, best[1], strict=True))
            stop.add_note(f"the best parameters so far, in SI units, for another call: {{{values}}}")
            raise
        found.x, found.njev = begin, steps
        return found

    def _estimate(self, theta: Array) -> None:
        """Standard deviations of noise that are not given, from residuals."""
        predictions = self.runs.predict(theta)
        share = 1 - min(len(self.names) / sum(len(s.values) for s in self.signals), 0.9)
        for i in np.flatnonzero(self.open):
            found = float(np.sqrt(np.mean((predictions[i].values - self.signals[i].values) ** 2) / share))
            self.deviations[i] = max(found, 1e-9 * _spread(self.signals[i]))

    def _covariance(self, jacobian: Array) -> tuple[Array, Array]:
        """Standard deviations, infinite where data leave a parameter open, and correlations."""
        singular, directions = decompose(jacobian * self.sizes)
        determined = singular > NULL * singular[0]
        half = directions[determined].T / singular[determined]
        covariance = half @ half.T
        deviations = np.sqrt(np.diag(covariance))
        lengths = np.where(deviations > 0, deviations, 1.0)
        is_open = np.abs(directions[~determined]).max(axis=0, initial=0.0) > np.sqrt(NULL)
        return np.where(is_open, np.inf, deviations * self.sizes), covariance / np.outer(lengths, lengths)

    def _try(self, kind: str, values: Array, out: Path, scheduler: str | None) -> Array:
        """Cost, iterations, runs and parameters of many fits (rows), in a table that stays; NaN where one failed."""
        study, e, drawn = self.study, self.study.experiments[0], _TRIES[kind]
        results = ["cost of fit", "iterations of fit", "runs of fit", *(f"{name} fitted" for name in self.names)]
        named = (*drawn, *(f"{name} at the start" for name in self.names))
        columns = [sweeps.Variable(name=n, kind=sweeps.Kind.INPUT, unit="", span=e.span) for n in named]
        objectives = tuple(sweeps.Objective(name=n, reduction="value", series=0) for n in results)
        rows = sweeps.Study(file=study.file, model=e.model, variables=tuple(columns), values=values, objectives=objectives, span=e.span)
        target, by = find_target(FLAGS), {name: version(name) for name in ("cutjoint", "numpy", "scipy")}
        manifest = {"study": study.digest, kind: len(values), "deviations": self.deviations.tolist(), "versions": by,
                    "compiler": target.compiler, "flags": list(target.flags), "processor": [target.machine, *target.features]}  # fmt: skip
        with stop_requests() as request:
            tries = partial(_try_one, study, self.runs.sims, self.deviations, request)
            work = Work(kernels=(), has_scenes=False, objectives=objectives, trajectories=(), every=1, tasks=tries)
            path, said = _table_of(out, kind), lambda done, of: self.note(f"{kind}: {done} of {of} fits")
            table = make_table(rows, work, manifest, path, scheduler, None, said, self.note)
        found = np.column_stack([table[name] for name in results])
        self.runs.count += int(np.nansum(found[:, 2]))
        for number, (failure, cost) in enumerate(zip(table.failures, found[:, 0], strict=True), start=1):
            self.note(f"{kind}: fit {number} " + (f"failed: {failure}" if failure else f"ends with cost {cost:.6g}"))
        return found

    def _profile(self, best: Any, quantile: float, deviations: Array, out: Path, scheduler: str | None) -> Array:
        """Intervals (2, parameters) by `find_end`, infinite where the data hardly tell values apart.
        If a profile has a lower cost than the best, that has not converged."""
        intervals = np.tile([[-np.inf], [np.inf]], len(best.x))
        ends = [(i, side * quantile * deviations[i]) for i in range(len(best.x)) for side in (-1, 1) if isfinite(deviations[i])]
        if ends:
            tried = self._try("profiles", np.array([[*end, best.cost, quantile, *best.x] for end in ends]), out, scheduler)
            for (i, distance), x in zip(ends, tried[:, 3:], strict=True):
                intervals[int(distance > 0), i] = x[i] if isfinite(x[i]) else copysign(np.inf, distance)
            cost, _, _, *x = tried[np.argmin(np.nan_to_num(tried[:, 0], nan=np.inf))]
            if cost < best.cost - 1e-6 * max(best.cost, 1.0):
                at = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.names, x, strict=True))
                best.status, best.message = 0, f"a profile has a lower cost, {cost:.6g}, at {at}; start there"
        return intervals

    def _results(self, theta: Array) -> tuple[SignalResult, ...]:
        fitted = zip(self.runs.predict(theta), self.deviations, strict=True)
        held_out = [(p, p.signal.deviation) for p in self.runs.predict(theta, validation=True)]
        return tuple(_result(p, float(s)) for p, s in (*fitted, *held_out))

    def _find_faults(
        self, found: Any, after: Identifiability, intervals: Array, reach: Array, results: Sequence[SignalResult],
    ) -> dict[str, str]:  # fmt: skip
        from scipy.stats import chi2

        faults = {}
        if found.status <= 0:
            faults["not converged"] = f"after {found.nfev} runs: {found.message}"
        half, is_bounded = np.abs(intervals - found.x).max(axis=0), np.isclose(intervals, [self.low, self.high]).any(axis=0)
        half = np.where(is_bounded, np.maximum(half, reach), half)  # a bound determines nothing
        wide = [f"{name} (95 % interval: {low:.3g} to {high:.3g})" for name, (low, high), x, size in
                zip(self.names, intervals.T, np.where(np.isinf(reach), 0.0, half), self.sizes, strict=True) if size < x]  # fmt: skip
        if after.open or wide:
            faults["not identified"] = "; ".join([*(f"no effect if together: {describe(x)}" for x in after.open), *wide])
        fitted = [r for r in results if not r.validation]
        level = 0.01 / len(fitted)  # 1 %, for all signals together, is the probability that white noise counts as not white
        coloured = [f"{r.signal} of {r.experiment}" for r in fitted if r.p_value is not None and r.p_value < level]
        if self.study.loss == "linear":
            loud = ((r, r.rms / r.deviation) for r in fitted if r.rms > _LOUD * r.deviation and 1 - r.explained > _ROUNDING**2)
            loud = ((r, ratio) for r, ratio in loud if chi2.sf(r.samples * ratio**2, r.samples) < level)
            coloured += [f"{r.signal} of {r.experiment} has {ratio:.3g} times the deviation that the study gives" for r, ratio in loud]
        if coloured:
            faults["residual not white"] = ", ".join(coloured)
        return faults


def _table_of(out: Path, kind: str) -> Path:
    return out.with_name(f"{out.name.removesuffix('.json')}.{kind}.parquet")


def _try_one(study: Study, sims: Sims, deviations: Array, request: StopRequest, scene: int, values: Array) -> Mapping[int, float]:
    """Cost, iterations, runs and parameters of a fit from a start, which stands behind the columns of ``_TRIES``."""

    def check(text: str) -> None:
        if request.number is not None:
            raise request.error("interrupted")

    (solver := Solver(study, check, sims)).deviations = deviations
    if (more := len(values) - len(solver.names)) == 0:
        found = solver.through_windows(values)
    elif more == len(_TRIES["profiles"]):
        place, distance, cost, quantile = map(float, values[:more])
        found = solver.find_end(int(place), distance, cost, quantile, values[more:])
    else:
        rng = np.random.default_rng([study.seed, int(values[0])])
        errors = [p.signal.values - p.values for p in solver.runs.predict(values[1:])]
        solver.noise = [rng.choice(e, len(e)) - e for e in errors]
        found = solver.least_squares(values[1:])
    return dict(enumerate([found.cost, found.njev, solver.runs.count, *found.x]))


def _open(found: Identifiability) -> list[str]:
    pairs = [f"{a} and {b} have similar effects (collinearity {index:.3g})" for a, b, index in found.collinear]
    known = (("do not determine", found.open), ("hardly determine", found.nearly_open))
    return [*(f"the data {how}: {describe(x)}" for how, combinations in known for x in combinations), *pairs]


def _spread(signal: Signal) -> float:
    """The size of a signal's changes, or of itself where it is constant but for rounding."""
    changes, size = float(np.std(signal.values)), float(np.abs(signal.values).max())
    return changes if changes > 1e-14 * size else size or 1.0


def _result(p: Prediction, deviation: float) -> SignalResult:
    """What a signal's residual says: Ljung and Box's test over 5 lags at most, as with more white noise fails three times too often."""
    from scipy.stats import chi2

    residual, n = p.signal.values - p.values, len(p.values)
    rms, centred = float(np.sqrt(np.mean(residual**2))), residual - residual.mean()
    lags = np.arange(1, min(20, n // 5) + 1)
    power = float(centred @ centred)
    correlation = np.array([centred[k:] @ centred[:-k] for k in lags]) / (power or 1.0)
    few = min(5, n // 20)
    tested = few > 0 and not p.experiment.is_pose and rms > _ROUNDING * _spread(p.signal)
    statistic = n * (n + 2) * float(np.sum((correlation**2 / (n - lags))[:few]))
    return SignalResult(
        experiment=p.experiment.name, signal=p.signal.text, validation=p.experiment.validation, samples=n, missing=p.signal.missing,
        rms=rms, deviation=deviation, explained=1 - (rms / _spread(p.signal)) ** 2, autocorrelation=correlation, unit=p.signal.unit,
        p_value=float(chi2.sf(statistic, few)) if tested else None, times=p.signal.times, measured=p.signal.values,
        predicted=p.values,
    )  # fmt: skip
