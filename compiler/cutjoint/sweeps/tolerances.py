"""Tolerance analysis: distributions of objectives, by Monte Carlo runs and by first and second order."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cutjoint.package.errors import RunError
from cutjoint.sweeps.designs import STEP, correlation
from cutjoint.sweeps.records import Array

if TYPE_CHECKING:
    from cutjoint.sweeps.run import Sweep

#: The probabilities of the reported quantiles.
QUANTILES = (0.00135, 0.05, 0.5, 0.95, 0.99865)


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


def has_tolerances(done: "Sweep") -> bool:
    """Return whether the sweep's design is one of tolerances."""
    return "tolerances" in done.manifest["design"]


def find_tolerance(done: "Sweep", objective: str, limits: tuple[float, float] | None = None) -> Tolerance:
    """The distribution of an objective over the runs of a sweep; failed runs count as outside the limits.

    Raises:
        RunError: the design is another one, or runs at the means or beside them have no value.
    """
    from scipy.stats import norm

    if not has_tolerances(done):
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
