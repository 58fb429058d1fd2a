"""Designs: the values of a study's variables, run by run, masses and inertias that no body can have, and indices that follow from a design.

Sequences are SciPy's (scipy.stats.qmc) with the study's seed.  Tolerance analysis has distributions of objectives, by Monte Carlo
runs and by first and second order.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, prod
from typing import TYPE_CHECKING, Any

import numpy as np

from cutjoint.model.elements.mass import can_exist
from cutjoint.model.expressions.evaluate import evaluate_runs
from cutjoint.model.records import Binding
from cutjoint.package.errors import RunError
from cutjoint.package.extensions import find_package
from cutjoint.run.run_file import MASSES, find_dependent_parts, parameter_values
from cutjoint.sweeps.document import Design, LatinHypercube, Listed, Sobol, SobolIndices, Tolerances
from cutjoint.sweeps.records import Array, Kind, Study

if TYPE_CHECKING:
    from cutjoint.sweeps.run import Sweep

#: The step of central differences at a mean, as a share of the standard deviation.
STEP = 0.1
#: Resamples for confidence intervals, and their confidence level.
_DRAWS, _SHARE = 200, 0.95
#: The probabilities of the reported quantiles.
QUANTILES = (0.00135, 0.05, 0.5, 0.95, 0.99865)

# Masses


class Masses:
    """Finds runs whose parameters give a body an impossible mass or inertia.

    NumPy checks all runs; suspicious ones are checked like single runs, with the same messages.
    """

    def __init__(self, study: Study) -> None:
        model = study.model
        self._study, self._places = study, {v.name: i for i, v in enumerate(study.variables) if v.kind is Kind.PARAMETER}
        self._parameters = [p for p in model.parameters if p.binding is not Binding.INPUT]
        moving = {p.symbol for p in self._parameters if p.name in self._places}
        self._bodies = [body for body in model.bodies if any(entry.free_symbols & moving for entry in (body.mass, *body.inertia))]

    def faults(self, values: Array) -> dict[int, str]:
        """The reasons that runs with values (runs, variables) cannot be, by their places."""
        runs, suspects = len(values), set[int]()
        numbers = {p.symbol: values[:, self._places[p.name]] if p.name in self._places else p.value for p in self._parameters}
        for body in self._bodies:
            mass, *inertia = (evaluate_runs(entry, numbers, runs) for entry in (body.mass, *body.inertia))
            suspects.update(map(int, np.flatnonzero(~can_exist(mass, np.column_stack(inertia)))))
        found = {run: self._fault(values[run]) for run in sorted(suspects)}
        return {run: fault for run, fault in found.items() if fault}

    def _fault(self, values: Array) -> str:
        model = self._study.model
        changes = {name: float(values[place]) for name, place in self._places.items()}
        try:
            find_dependent_parts(model, self._study.scenes[0], parameter_values(model, changes), (MASSES,))
        except RunError as error:
            return str(error)
        return ""


# Designs


@dataclass(frozen=True, kw_only=True)
class Extent:
    """The range of a variable: ``levels``, or SciPy's distribution ``spread``."""

    levels: tuple[float, ...] = ()
    spread: Any = None

    @property
    def moments(self) -> tuple[float, float]:
        """Mean and standard deviation."""
        if self.spread is not None:
            return float(self.spread.mean()), float(self.spread.std())
        return float(np.mean(self.levels)), float(np.std(self.levels))

    def at(self, share: Array) -> Array:
        """The values at fractions of the range from 0 to 1."""
        if self.spread is not None:
            return np.asarray(self.spread.ppf(share))
        return np.array(self.levels)[np.minimum((share * len(self.levels)).astype(np.int64), len(self.levels) - 1)]


def even(low: float, high: float, *, by_ratio: bool) -> Any:
    """A distribution of SciPy over a range, linear or logarithmic."""
    return _stats().loguniform(low, high) if by_ratio else _stats().uniform(low, high - low)


def distribution(kind: str, mean: float, size: float, low: float, high: float) -> Any:
    """A distribution of SciPy: a standard deviation of a normal one, within ``low`` and ``high``, or half the width of the others."""
    stats = _stats()
    if kind == "normal":
        cut = ((low - mean) / size, (high - mean) / size)
        return stats.norm(mean, size) if cut == (-inf, inf) else stats.truncnorm(*cut, loc=mean, scale=size)
    return stats.uniform(mean - size, 2 * size) if kind == "uniform" else stats.triang(0.5, mean - size, 2 * size)


def count_runs(design: Design, extents: Sequence[Extent]) -> int:
    """The number of runs of a design; unknown for a table that is not read yet."""
    match design:
        case LatinHypercube():
            return design.latin_hypercube
        case Sobol():
            return design.sobol
        case SobolIndices():
            return design.sobol_indices * (len(extents) + 2)
        case Tolerances():
            return design.tolerances + 1 + 2 * len(extents)
        case Listed():
            return len(design.list)
    return prod(len(extent.levels) for extent in extents)


def draw(design: Design, extents: Sequence[Extent], names: Sequence[str] = ()) -> Array:
    """The values (runs, variables) of a grid, whose last variable changes from run to run, or of a sequence.
    Raises RunError: SciPy is not installed."""
    if isinstance(design, Tolerances):
        return _beside_means(design, extents, names)
    if isinstance(design, (LatinHypercube, Sobol, SobolIndices)):
        shares = _shares(design, len(extents))
        return np.stack([extent.at(shares[:, i]) for i, extent in enumerate(extents)], axis=1)
    shape = [len(extent.levels) for extent in extents]
    places = np.indices(shape).reshape(len(shape), -1)
    return np.stack([np.array(extent.levels)[at] for extent, at in zip(extents, places, strict=True)], axis=1)


def correlation(names: Sequence[str], pairs: Sequence[tuple[str, str, float]]) -> Array:
    """The correlation matrix."""
    found = np.eye(len(names))
    for one, other, value in pairs:
        i, j = list(names).index(one), list(names).index(other)
        found[i, j] = found[j, i] = value
    return found


def _beside_means(design: Tolerances, extents: Sequence[Extent], names: Sequence[str]) -> Array:
    """Random points, the means, and of each variable the mean with a step down and up."""
    root = np.linalg.cholesky(correlation(names, design.correlations))
    drawn = np.random.default_rng(design.seed).standard_normal((design.tolerances, len(extents))) @ root.T
    shares = _stats().norm.cdf(drawn)
    points = np.stack([extent.at(shares[:, i]) for i, extent in enumerate(extents)], axis=1)
    means, deviations = np.array([extent.moments for extent in extents]).T
    steps = np.kron(np.diag(STEP * deviations), [[-1.0], [1.0]])
    return np.vstack([points, means, means + steps])


def _shares(design: LatinHypercube | Sobol | SobolIndices, dimensions: int) -> Array:
    qmc = _stats().qmc
    if isinstance(design, SobolIndices):
        return _mixed(qmc.Sobol(2 * dimensions, rng=design.seed).random(design.sobol_indices))
    if isinstance(design, LatinHypercube):
        return np.asarray(qmc.LatinHypercube(dimensions, rng=design.seed).random(design.latin_hypercube))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the user may choose a number of points that is no power of two
        return np.asarray(qmc.Sobol(dimensions, rng=design.seed).random(design.sobol))


def _mixed(shares: Array) -> Array:
    """Two sets of points, and for each variable the first set with that variable's values of the second, one below the other."""
    first, second = np.split(shares, 2, axis=1)
    mixed = [np.where(np.arange(first.shape[1]) == i, second, first) for i in range(first.shape[1])]
    return np.concatenate([first, second, *mixed])


def _stats() -> Any:
    return find_package("scipy.stats", otherwise=RunError("sequences and distributions need SciPy: pip install 'cutjoint[sweep]'"))


# Sobol' indices: the share of each variable in the variance of an objective, by itself and with all that it does together with others.
# The estimator is SciPy's (scipy.stats.sobol_indices, Saltelli 2010), over the runs of the design `sobol_indices`.


@dataclass(frozen=True, kw_only=True)
class Indices:
    """Indices of an objective: ``first``, ``total`` (variables,), 95 % intervals (2, variables), ``points`` used."""

    objective: str
    variables: tuple[str, ...]
    first: Array
    total: Array
    first_interval: Array
    total_interval: Array
    points: int


def find_indices(done: "Sweep", objective: str) -> Indices:
    """The indices of an objective by the runs of a sweep.  Points of which a run failed do not count, nor others beyond a power of two.
    Raises RunError: the design is another one, or fewer than two points have all their runs."""
    if "sobol_indices" not in done.manifest["design"]:
        raise RunError("Sobol' indices follow from the design {sobol_indices: points} alone")
    names = done.table.column_names
    variables = tuple(names[names.index("run") + 1 : names.index("failure")])
    values = np.asarray(done[objective], dtype=float).reshape(len(variables) + 2, -1)
    whole = values[:, ~np.isnan(values).any(axis=0)]
    if (left := whole.shape[1]) < 2:
        raise RunError(f"objective '{objective}': {left} of {values.shape[1]} points have numbers from all their runs; no indices follow")
    points = 1 << (left.bit_length() - 1)
    whole = whole[:, :points]
    first, total = _estimate(whole)
    draws = np.random.default_rng(0).integers(points, size=(_DRAWS, points))
    low, high = np.quantile([_estimate(whole[:, draw]) for draw in draws], [(1 - _SHARE) / 2, (1 + _SHARE) / 2], axis=0)
    return Indices(
        objective=objective, variables=variables, first=first, total=total, points=points,
        first_interval=np.array([low[0], high[0]]), total_interval=np.array([low[1], high[1]]),
    )  # fmt: skip


def _estimate(values: Array) -> tuple[Array, Array]:
    """The first-order and total indices, from (2 + variables, points) values."""
    from scipy.stats import sobol_indices

    sets = {"f_A": values[:1], "f_B": values[1:2], "f_AB": values[2:, np.newaxis]}
    found = sobol_indices(func=sets, n=values.shape[1])
    return found.first_order, found.total_order


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """The distribution of an objective, in its unit.

    Attributes:
        mean, deviation: of the Monte Carlo runs that have a value.
        first_mean, first_deviation: by first order; second_mean: by second order, for independent variables.
        gradient: (variables,) derivatives at the means, by central differences.
        deviations: (variables,) standard deviations of the variables.
        shares: (variables,) parts of the variance by first order; they add up to one.
        quantiles: at 0.00135, 0.05, 0.5, 0.95 and 0.99865, by Monte Carlo.
        passed, first_passed: share within the limits, of the runs and by first order (normal); NaN without limits.
        runs: Monte Carlo runs that count.
    """

    objective: str
    variables: tuple[str, ...]
    mean: float
    deviation: float
    first_mean: float
    first_deviation: float
    second_mean: float
    gradient: Array
    deviations: Array
    shares: Array
    quantiles: Array
    passed: float
    first_passed: float
    runs: int

    def cheapest(self, limits: tuple[float, float], costs: Mapping[str, float], *, wanted: float = 0.9973) -> dict[str, float]:
        """Standard deviations for a yield at the least sum of cost/deviation, by first order for independent variables.

        Variables without a cost keep theirs.

        Raises:
            RunError: the means are outside of the limits, the other variables alone spoil the yield, or a variable has no influence.
        """
        from scipy.optimize import brentq
        from scipy.stats import norm

        low, high = limits[0] - self.first_mean, limits[1] - self.first_mean
        if not low < 0.0 < high:
            raise RunError(f"objective '{self.objective}' is outside of its limits at the means: no tolerances give that yield")
        widest = max(-low, high) / max(float(norm.ppf(0.5 + wanted / 2)), 1e-9)
        most = float(brentq(lambda s: norm.cdf(high / s) - norm.cdf(low / s) - wanted, 1e-9 * widest, 2 * widest, xtol=1e-14 * widest))
        names = list(self.variables)
        chosen = [names.index(name) for name in costs]
        kept = [i for i in range(len(names)) if i not in chosen]
        left = most**2 - float(np.sum((self.gradient * self.deviations)[kept] ** 2))
        sensitivities = np.abs(self.gradient[chosen])
        if not (left > 0.0 and (sensitivities > 0.0).all()):
            raise RunError(f"objective '{self.objective}': the yield {wanted:g} needs smaller tolerances of variables without a cost, or a "
                           "variable with a cost has no influence")  # fmt: skip
        shape = np.cbrt(np.array(list(costs.values())) / sensitivities**2)  # optimal: proportional derivatives of both
        return dict(zip(costs, map(float, shape * np.sqrt(left / np.sum((sensitivities * shape) ** 2))), strict=True))


def find_tolerance(done: "Sweep", objective: str, limits: tuple[float, float] | None = None) -> Tolerance:
    """The distribution of an objective over the runs of a sweep; failed runs count as outside the limits.
    Raises RunError: the design is another one, or runs at the means or beside them have no value."""
    from scipy.stats import norm

    if "tolerances" not in done.manifest["design"]:
        raise RunError("tolerances follow from the design {tolerances: runs} alone")
    design, names = done.manifest["design"], done.table.column_names
    variables = tuple(names[names.index("run") + 1 : names.index("failure")])
    drawn = np.asarray(done[objective], dtype=float)
    drawn, beside = np.split(drawn, [design["tolerances"]])
    if np.isnan(beside).any():
        raise RunError(f"objective '{objective}': a run at the means of the variables, or beside them, has no value")
    values = np.column_stack([done[name] for name in variables])[design["tolerances"] :]
    deviations = (values[2::2] - values[1::2]).diagonal() / (2 * STEP)
    safe = np.where(deviations > 0.0, deviations, 1.0)
    low, middle, high = beside[1::2], beside[0], beside[2::2]
    gradient = np.where(deviations > 0.0, (high - low) / (2 * STEP * safe), 0.0)
    parts = gradient * deviations
    joint = parts * (correlation(variables, design["correlations"]) @ parts)
    variance = float(joint.sum())
    there = drawn[~np.isnan(drawn)]
    if len(there) < 2:
        raise RunError(f"objective '{objective}': fewer than two runs have a value")
    first = float(np.sqrt(variance))
    ends = (np.nan, np.nan) if limits is None else limits
    return Tolerance(
        objective=objective, variables=variables, mean=float(there.mean()), deviation=float(there.std(ddof=1)), first_mean=float(middle),
        first_deviation=first, second_mean=float(middle + ((high - 2 * middle + low) / (2 * STEP**2)).sum()), gradient=gradient,
        deviations=deviations, shares=joint / (variance or 1.0), quantiles=np.quantile(there, QUANTILES),
        passed=np.nan if limits is None else float(((drawn >= ends[0]) & (drawn <= ends[1])).mean()),
        first_passed=float(norm.cdf(ends[1], middle, first) - norm.cdf(ends[0], middle, first)), runs=len(there),
    )  # fmt: skip
