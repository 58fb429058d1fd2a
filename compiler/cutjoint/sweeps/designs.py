"""Designs: the values of a study's variables, run by run, and masses and inertias that no body can have.

Sequences are SciPy's (scipy.stats.qmc) with the study's seed.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from math import log, prod
from typing import Any

import numpy as np

from cutjoint.model.evaluate import evaluate_runs
from cutjoint.model.mass import can_exist
from cutjoint.model.records import Binding
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import MASSES, following, parameter_values
from cutjoint.sweeps.document import Design, LatinHypercube, Listed, Sobol, SobolIndices
from cutjoint.sweeps.records import Array, Kind, Study, of_kind

# Masses


class Masses:
    """Says of runs why no body can have the masses and inertias that their parameters ask for.

    All runs are looked at with NumPy; those that seem impossible are judged as single runs are, in the same words.
    """

    def __init__(self, study: Study) -> None:
        model, places = study.model, of_kind(study.variables, Kind.PARAMETER)
        self._study, self._places = study, {study.variables[i].name: i for i in places}
        self._parameters = [p for p in model.parameters if p.binding is not Binding.INPUT]
        moving = {p.symbol for p in self._parameters if p.name in self._places}
        self._bodies = [body for body in model.bodies if any(entry.free_symbols & moving for entry in (body.mass, *body.inertia))]

    def faults(self, values: Array) -> dict[int, str]:
        """The reasons that runs with values (runs, variables) cannot be, by their places."""
        runs, suspects = len(values), set[int]()
        given = {p.symbol: values[:, self._places[p.name]] if p.name in self._places else p.value for p in self._parameters}
        for body in self._bodies:
            mass, *inertia = (evaluate_runs(entry, given, runs) for entry in (body.mass, *body.inertia))
            suspects.update(map(int, np.flatnonzero(~can_exist(mass, np.column_stack(inertia)))))
        found = {run: self._fault(values[run]) for run in sorted(suspects)}
        return {run: fault for run, fault in found.items() if fault}

    def _fault(self, values: Array) -> str:
        """The reason that no body can have the masses of one run; "" if they can."""
        model = self._study.model
        changes = {name: float(values[place]) for name, place in self._places.items()}
        try:
            following(model, self._study.scenes[0], parameter_values(model, changes), (MASSES,))
        except RunError as error:
            return str(error)
        return ""


# Designs


@dataclass(frozen=True, kw_only=True)
class Extent:
    """The range of a variable: one of ``levels``, or anything from ``low`` to ``high``, evenly by its logarithm or itself."""

    levels: tuple[float, ...] = ()
    low: float = 0.0
    high: float = 0.0
    by_ratio: bool = False

    def at(self, share: Array) -> Array:
        """The values at shares of the range from 0 to 1."""
        if self.levels:
            places = np.minimum((share * len(self.levels)).astype(np.int64), len(self.levels) - 1)
            return np.array(self.levels)[places]
        if self.by_ratio:
            return np.exp(log(self.low) + share * (log(self.high) - log(self.low)))
        return self.low + share * (self.high - self.low)


def spread(low: float, high: float, count: int, *, by_ratio: bool) -> tuple[float, ...]:
    """The levels from one number to another, ``count`` of them."""
    values = np.geomspace(low, high, count) if by_ratio else np.linspace(low, high, count)
    return tuple(map(float, values))


def count_runs(design: Design, extents: Sequence[Extent]) -> int:
    """The number of a design's runs; of a table it is not known before that is read."""
    match design:
        case LatinHypercube():
            return design.latin_hypercube
        case Sobol():
            return design.sobol
        case SobolIndices():
            return design.sobol_indices * (len(extents) + 2)
        case Listed():
            return len(design.list)
    return prod(len(extent.levels) for extent in extents)


def draw(design: Design, extents: Sequence[Extent]) -> Array:
    """The values (runs, variables) of a grid, whose last variable changes from run to run, or of a sequence.

    Raises:
        RunError: SciPy is not installed.
    """
    if isinstance(design, (LatinHypercube, Sobol, SobolIndices)):
        shares = _shares(design, len(extents))
        return np.stack([extent.at(shares[:, i]) for i, extent in enumerate(extents)], axis=1)
    shape = [len(extent.levels) for extent in extents]
    places = np.indices(shape).reshape(len(shape), -1)
    return np.stack([np.array(extent.levels)[at] for extent, at in zip(extents, places, strict=True)], axis=1)


def _shares(design: LatinHypercube | Sobol | SobolIndices, dimensions: int) -> Array:
    qmc = _qmc()
    if isinstance(design, SobolIndices):
        return _mixed(qmc.Sobol(2 * dimensions, rng=design.seed).random(design.sobol_indices))
    if isinstance(design, LatinHypercube):
        shares: Array = qmc.LatinHypercube(dimensions, rng=design.seed).random(design.latin_hypercube)
        return shares
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # numbers of points that are no power of two are as the user wants them
        shares = qmc.Sobol(dimensions, rng=design.seed).random(design.sobol)
    return shares


def _mixed(shares: Array) -> Array:
    """Two sets of points, and for each variable the first set with that variable's values of the second, one below the other."""
    first, second = np.split(shares, 2, axis=1)
    mixed = [np.where(np.arange(first.shape[1]) == i, second, first) for i in range(first.shape[1])]
    return np.concatenate([first, second, *mixed])


def _qmc() -> Any:
    try:
        from scipy.stats import qmc
    except ImportError:
        raise RunError("latin_hypercube, sobol and sobol_indices need SciPy: pip install 'cutjoint[sweep]'") from None
    return qmc
