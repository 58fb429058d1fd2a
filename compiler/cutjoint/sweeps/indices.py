"""Sobol' indices: the share of each variable in the variance of an objective, by itself and with all that it does together with others.

The estimator is SciPy's (scipy.stats.sobol_indices, Saltelli 2010), over the runs of the design `sobol_indices`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cutjoint.package.errors import RunError
from cutjoint.sweeps.records import Array

if TYPE_CHECKING:
    from cutjoint.sweeps.run import Sweep

#: Draws of points by which intervals are found, and their share of the draws.
_DRAWS, _SHARE = 200, 0.95


@dataclass(frozen=True, kw_only=True)
class Indices:
    """The indices of an objective: ``first`` and ``total`` (variables,), intervals (2, variables) of 95 %, ``points`` that count."""

    objective: str
    variables: tuple[str, ...]
    first: Array
    total: Array
    first_interval: Array
    total_interval: Array
    points: int


def has_indices(done: Sweep) -> bool:
    """Return whether the sweep's design is one that indices follow from."""
    return "sobol_indices" in done.manifest["design"]


def find_indices(done: Sweep, objective: str) -> Indices:
    """The indices of an objective by the runs of a sweep.  Points of which a run failed do not count, nor others beyond a power of two.

    Raises:
        RunError: the design is another one, or fewer than two points have all their runs.
    """
    if not has_indices(done):
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
    """The indices of first order and the total ones, of (2 + variables, points) values."""
    from scipy.stats import sobol_indices

    sets = {"f_A": values[:1], "f_B": values[1:2], "f_AB": values[2:, np.newaxis]}
    found = sobol_indices(func=sets, n=values.shape[1])
    return found.first_order, found.total_order
