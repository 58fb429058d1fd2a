"""The fit: least squares on exact sensitivities, and what can be said of its result; combinations that data leave open."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cutjoint.fits.reading import read_fit
from cutjoint.fits.records import Array, Signal, Study
from cutjoint.fits.residuals import Prediction, Runs
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.package.locations import AnyPath

#: Singular values below these shares of the largest: nothing changes to the accuracy of derivatives; hardly anything does.
NULL, NEAR = 1e-8, 1e-4

#: A share in a combination below which a name is left out, and the collinearity (Brun, Reichert and Kuensch, 2001) that is much.
_SHARE, COLLINEAR = 0.05, 20.0
#: Shares of the parameters and of the cost by which an iteration that changes no more ends the fit.
_STEP, _CHANGE = 1e-10, 1e-8
#: Residuals below this share of a signal's size are rounding, and judged no further.
_ROUNDING = 1e-7
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
    pairs = []
    for i in range(len(names)):
        for j in range(i):
            product = min(abs(float(unit[:, i] @ unit[:, j])), 1.0)
            if 1 - 1 / COLLINEAR**2 < product < 1 - NULL:  # beyond, a combination of both is open
                pairs.append((names[j], names[i], float(1 / np.sqrt(1 - product))))
    return Identifiability(
        singular_values=singular, open=combine(directions[singular <= NULL * largest], names),
        nearly_open=combine(directions[(singular > NULL * largest) & (singular <= NEAR * largest)], names), collinear=tuple(pairs),
    )  # fmt: skip


def decompose(matrix: Array) -> tuple[Array, Array]:
    """Singular values and right singular vectors of a matrix (rows, columns), as many as columns."""
    _, found, directions = np.linalg.svd(np.linalg.qr(matrix, mode="r"), full_matrices=True)
    return np.pad(found, (0, matrix.shape[1] - len(found))), directions


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


def fit(study: AnyPath | Mapping[str, Any], *, note: Callable[[str], None] | None = None) -> Fit:
    """Fit parameters of models to measurements, by a study (file or mapping).

    Args:
        note: is called with messages of progress.

    Raises:
        ModelError, EquationsError, RunError: the study, a model or the data are wrong, or the runs at the start values fail.
        ToolchainError: the C++ side failed.
    """
    return Solver(read_fit(study), note or (lambda text: None)).solve()


class Solver:
    """The steps of a fit."""

    def __init__(self, study: Study, note: Callable[[str], None]) -> None:
        self.study, self.note = study, note
        self.names = [p.name for p in study.parameters]
        self.sizes, self.start, self.low, self.high, self.mean, self.prior = (
            np.array([getattr(p, key) for p in study.parameters]) for key in ("size", "start", "low", "high", "mean", "deviation")
        )  # fmt: skip
        self.known = np.isfinite(self.prior)
        for e in study.experiments:
            for words in e.notes:
                note(f"{e.name}: {words}")
        self.runs = Runs(study, note)
        self.signals = [s for e in study.experiments if not e.validation for s in e.signals]
        self.deviations = np.array([_spread(s) if np.isnan(s.deviation) else s.deviation for s in self.signals])
        self.open = np.array([np.isnan(s.deviation) for s in self.signals])
        self.kept: tuple[bytes, tuple[Array, Array]] = (b"", (np.zeros(0), np.zeros((0, 0))))
        self.best: tuple[float, tuple[float, ...]] = (np.inf, tuple(self.start))
        self.noise: list[Array] = [np.zeros(len(s.values)) for s in self.signals]

    def solve(self) -> Fit:
        """The result."""
        from scipy.stats import qmc, t

        samples = sum(len(s.values) for s in self.signals)
        try:
            before = identify(self.residuals(self.start)[1], self.names, self.sizes, samples)
        except CutjointError as error:
            raise RunError(f"{self.study.file}: the runs with the start values fail: {error}") from None
        for words in _open(before):
            self.note(f"the data do not determine: {words}")
        begins = [self.start]
        if self.study.starts > 1:
            points = qmc.Sobol(len(self.names), seed=self.study.seed).random(self.study.starts - 1)
            begins += list(self.low + points * (self.high - self.low))
        tries = []
        for number, begin in enumerate(begins):
            found = self._through_windows(begin)
            self.note(f"start {number + 1} of {len(begins)}: cost {found.cost:.6g} after {found.njev} iterations")
            tries.append(found)
        best = min(tries, key=lambda found: float(found.cost))
        iterations = best.njev
        if self.open.any():  # weights by the residuals that remain
            self._estimate(best.x)
            best = self.least_squares(best.x)
            self._estimate(best.x)
        for name in np.array(self.names)[best.active_mask != 0]:
            self.note(f"{name} ends at its bound")
        jacobian = self.residuals(best.x)[1]
        after = identify(jacobian, self.names, self.sizes, samples)
        deviations, correlations = self._covariance(jacobian)
        if self.study.resamples:
            deviations = self._bootstrap(best.x)
        reach = t.ppf(0.975, max(samples - len(self.names), 1)) * deviations
        numbers = {p.name: float(x) for p, x in zip(self.study.parameters, best.x, strict=True)}
        tied = {s: float(v.xreplace({p.symbol: x for p, x in zip(self.study.parameters, map(float, best.x), strict=True)}))
                for s, v in self.study.ties.items()}  # fmt: skip
        results = self._results(best.x)
        return Fit(
            names=tuple(self.names), units=tuple(p.unit for p in self.study.parameters), start=self.start, values=best.x,
            deviations=deviations, intervals=np.column_stack([best.x - reach, best.x + reach]), correlations=correlations,
            numbers=numbers | tied, cost=float(best.cost), iterations=iterations, runs=self.runs.count,
            starts=tuple(float(each.cost) for each in tries), before=before, after=after, signals=results,
            faults=self._find_faults(best, after, reach, results), study=self.study,
        )  # fmt: skip

    def residuals(self, theta: Array) -> tuple[Array, Array]:
        """Residuals in units of standard deviations, those of priors last, and their derivatives."""
        key = b"".join(part.tobytes() for part in (theta, np.array(self.runs.share), self.deviations, *self.noise))
        if key != self.kept[0]:
            found = self.runs.predict(theta)
            kept = [noise[: len(p.values)] for p, noise in zip(found, self.noise, strict=True)]
            rows = [(p.values - p.signal.values - noise) / s for p, s, noise in zip(found, self.deviations, kept, strict=True)]
            derivatives = [p.derivatives / s for p, s in zip(found, self.deviations, strict=True)]
            known = self.known
            rows.append(((theta - self.mean)[known]) / self.prior[known])
            derivatives.append(np.eye(len(theta))[known] / self.prior[known, np.newaxis])
            self.kept = key, (np.concatenate(rows), np.vstack(derivatives))
        return self.kept[1]

    def _through_windows(self, begin: Array) -> Any:
        """The result over the whole time from those over shorter windows, in which phases of an oscillation cannot differ by turns."""
        iterations = 0
        for window in range(self.study.windows):
            self.runs.share = 0.5 ** (self.study.windows - 1 - window)
            found = self.least_squares(begin)
            begin, iterations = found.x, iterations + found.njev
        found.njev = iterations
        return found

    def least_squares(self, begin: Array) -> Any:
        """SciPy's result from a start, whose unknowns are shares of sizes."""
        from scipy.optimize import least_squares

        sizes, count, size = self.sizes, 0, len(self.residuals(begin)[0])

        def function(x: Array) -> Array:
            nonlocal count
            try:
                rows = self.residuals(x * sizes)[0]
            except CutjointError as error:  # the trust region shrinks
                self.note(f"  a run failed, with a smaller step again: {error}")
                return np.full(size, np.nan)
            count += 1
            self.best = min(self.best, (float(np.mean(rows**2)), tuple(x * sizes)))
            self.note(f"  run {count}: residual {np.sqrt(np.mean(rows**2)):.6g} of the standard deviations")
            return rows

        try:
            found = least_squares(
                function, begin / sizes, lambda x: self.residuals(x * sizes)[1] * sizes, bounds=(self.low / sizes, self.high / sizes),
                loss=self.study.loss, x_scale=1.0, ftol=_CHANGE, xtol=_STEP, gtol=1e-14, max_nfev=100,
            )  # fmt: skip
        except BaseException as stop:  # by the user too
            values = ", ".join(f"{name}: {{start: {x:.12g}}}" for name, x in zip(self.names, self.best[1], strict=True))
            stop.add_note(f"the best parameters so far, in SI units, for another call: {{{values}}}")
            raise
        found.x = found.x * sizes
        return found

    def _estimate(self, theta: Array) -> None:
        """Standard deviations of noise that are not given, from residuals."""
        predictions = self.runs.predict(theta)
        share = 1 - min(len(self.names) / sum(len(s.values) for s in self.signals), 0.9)
        for i, p in enumerate(predictions):
            if self.open[i]:
                found = float(np.sqrt(np.mean((p.values - p.signal.values) ** 2) / share))
                self.deviations[i] = max(found, 1e-9 * _spread(p.signal))

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

    def _bootstrap(self, theta: Array) -> Array:
        """Standard deviations from fits to the model's outputs with noise of resampled residuals."""
        rng, found = np.random.default_rng(self.study.seed), []
        errors = [p.signal.values - p.values for p in self.runs.predict(theta)]
        for _ in range(self.study.resamples):
            self.noise = [rng.choice(e, len(e)) - e for e in errors]
            found.append(self.least_squares(theta).x)
        self.noise = [np.zeros(len(e)) for e in errors]
        return np.asarray(np.std(found, axis=0, ddof=1))

    def _results(self, theta: Array) -> tuple[SignalResult, ...]:
        fitted = zip(self.runs.predict(theta), self.deviations, strict=True)
        held_out = [(p, p.signal.deviation) for p in self.runs.predict(theta, validation=True)]
        return tuple(_result(p, float(s)) for p, s in (*fitted, *held_out))

    def _find_faults(self, found: Any, after: Identifiability, reach: Array, results: Sequence[SignalResult]) -> dict[str, str]:
        faults = {}
        if found.status <= 0:
            faults["not converged"] = f"after {found.nfev} runs: {found.message}"
        wide = [f"{name} to ±{x:.3g}" for name, x, size in zip(self.names, reach, self.sizes, strict=True) if x > size]
        if after.open or wide:
            faults["not identified"] = "; ".join([*map(describe, after.open), *wide])
        tested = [r for r in results if r.p_value is not None and not r.validation]
        level = 0.01  # the probability, for all signals together, that white noise counts as not white
        if coloured := [r for r in tested if r.p_value is not None and r.p_value < level / len(tested)]:
            faults["residual not white"] = ", ".join(f"{r.signal} of {r.experiment}" for r in coloured)
        return faults


def _open(found: Identifiability) -> list[str]:
    pairs = [f"{a} and {b} apart (collinearity {index:.3g})" for a, b, index in found.collinear]
    return [*map(describe, found.open), *(f"{describe(x)} (nearly)" for x in found.nearly_open), *pairs]


def _spread(signal: Signal) -> float:
    """The size of a signal's changes, or of itself where it is constant but for rounding."""
    changes, size = float(np.std(signal.values)), float(np.abs(signal.values).max())
    return changes if changes > 1e-14 * size else size or 1.0


def _result(p: Prediction, deviation: float) -> SignalResult:
    """What a signal's residual says: Ljung and Box's test over as many lags as a fifth of the samples, 20 at most."""
    from scipy.stats import chi2

    residual, n = p.signal.values - p.values, len(p.values)
    rms, centred = float(np.sqrt(np.mean(residual**2))), residual - residual.mean()
    lags = np.arange(1, min(20, n // 5) + 1)
    power = float(centred @ centred)
    correlation = np.array([centred[k:] @ centred[:-k] for k in lags]) / (power or 1.0)
    tested = len(lags) > 0 and not p.experiment.is_pose and rms > _ROUNDING * _spread(p.signal)
    statistic = n * (n + 2) * float(np.sum(correlation**2 / (n - lags)))
    return SignalResult(
        experiment=p.experiment.name, signal=p.signal.text, validation=p.experiment.validation, samples=n, missing=p.signal.missing,
        rms=rms, deviation=deviation, explained=1 - (rms / _spread(p.signal)) ** 2, autocorrelation=correlation, unit=p.signal.unit,
        p_value=float(chi2.sf(statistic, len(lags))) if tested else None, times=p.signal.times, measured=p.signal.values,
        predicted=p.values,
    )  # fmt: skip
