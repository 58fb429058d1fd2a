"""Design of experiments: inputs, within limits, that raise the smallest eigenvalue of the information matrix (E-optimality)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cutjoint.fits.fit import NULL, Solver, combine, decompose, describe
from cutjoint.fits.reading import read_fit
from cutjoint.fits.records import Array, Study
from cutjoint.fits.residuals import Runs
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.package.locations import AnyPath

#: Random inputs to begin with, how often each is halved until it keeps the limits, the distance that the optimiser keeps from these, as a
#: share of their range, and the singular value of a combination whose 95 % interval is as wide as its size.
_TRIES, _HALVINGS, _MARGIN, _WEAK = 8, 8, 0.002, 1.96


@dataclass(frozen=True, kw_only=True)
class ExperimentDesign:
    """Times and inputs, as the study takes them from a file, and what these determine, of parameters as shares of their sizes.

    * ``before``, ``after``: smallest eigenvalue of the information matrix with the present inputs and with these
    * ``weak``: combinations that the present inputs determine worst, with their information (1/variance) before and after
    * ``open``: combinations that no such inputs determine; the eigenvalues are without them
    """

    table: Mapping[str, Array]
    before: float
    after: float
    weak: tuple[tuple[dict[str, float], float, float], ...]
    open: tuple[dict[str, float], ...]


def design_experiment(study: AnyPath | Mapping[str, Any], note: Callable[[str], None]) -> ExperimentDesign:
    """Find inputs for the experiment under ``design`` in a fit's study. Raises RunError: it has none, or no inputs keep the limits."""
    return _Designer(read_fit(study), note).solve()


class _Designer:
    """Inputs are sines of Fourier series, as wide as their bounds; they begin with their present values, at rest."""

    def __init__(self, study: Study, note: Callable[[str], None]) -> None:
        if (asked := study.design) is None:
            raise RunError(f"{study.file}: it has no section design; write there an experiment, and inputs with bounds")
        self.asked, self.solver, self.failures, e = asked, (solver := Solver(study, note)), list[str](), asked.experiment
        self.t = e.dt * np.arange(max(3.0, np.ceil(max(s.times[-1] for s in e.signals) / e.dt - 1e-6)) + 1, dtype=np.float64)
        k = np.arange(1.0, asked.harmonics + 1)[:, np.newaxis]
        waves = np.exp(2j * np.pi * (asked.frequency or 1 / self.t[-1]) * k * self.t)  # each less its share of the last: at rest at 0
        odd, even = waves.imag - k / k[-1] * waves.imag[-1], (1 - waves.real) - (k / k[-1]) ** 2 * (1 - waves.real[-1])
        self.basis = np.vstack([odd[:-1], even[:-1]])
        start, low, high, _ = np.array([numbers for _, *numbers in asked.inputs.values()]).T[:, :, np.newaxis]
        self.middle, self.half = (low + high) / 2, (high - low) / 2
        self.phase = np.arcsin(np.clip((start - self.middle) / self.half, -1, 1))
        self.tables, self.kept = dict(e.inputs), dict[bytes, tuple[Array, Array]]()
        limits = (replace(s, times=self.t, values=np.zeros(len(self.t))) for s, *_ in asked.limits)
        e = replace(e, inputs=self.tables, signals=(*e.signals, *limits))
        self.runs = Runs(replace(study, experiments=(e,)), note)
        rows = [(p.experiment.name == e.name, s, p.derivatives / s * solver.sizes)
                for p, s in zip(solver.runs.predict(solver.start), solver.deviations, strict=True)]  # fmt: skip
        self.noise, self.present = [s for own, s, _ in rows if own], np.vstack([x for own, _, x in rows if own])
        self.rest = [x for own, _, x in rows if not own] + [np.diag(solver.sizes / solver.prior)]

    def solve(self) -> ExperimentDesign:
        """The result; raises RunError: no inputs keep the limits, or determine anything."""
        from scipy.optimize import NonlinearConstraint, minimize

        file, names, pool, points = self.solver.study.file, self.solver.names, [self.present], list[Array]()
        for point in np.random.default_rng(0).normal(size=(_TRIES, self.phase.size * len(self.basis))):
            for shorter in point / 2.0 ** np.arange(_HALVINGS)[:, np.newaxis]:
                jacobian, excess = self.run(shorter)
                pool.append(jacobian)
                if excess.max() <= -_MARGIN:
                    points.append(shorter)
                    break
        if not points and len(self.failures) == len(pool) - 1:
            raise RunError(f"{file}: design: the runs with all inputs that were tried failed, the last: {self.failures[-1]}")
        if not points:
            raise RunError(f"{file}: design: no inputs keep the limits; widen them, or begin further inside them")
        singular, directions = decompose(np.vstack([*pool, *self.rest]))
        is_open = singular <= NULL * decompose(np.vstack([*pool, *self.rest[:-1]]))[0][0]  # of data, without priors
        if is_open.all():
            raise RunError(f"{file}: design: no inputs determine: {'; '.join(map(describe, combine(directions, names)))}; add a signal")

        def determine(jacobian: Array) -> tuple[Array, Array]:
            return decompose(np.vstack([jacobian, *self.rest]) @ directions[~is_open].T)

        best = max(((determine(self.run(x)[0])[0][-1], x) for x in points), key=lambda each: each[0])

        def function(x: Array) -> float:
            nonlocal best
            jacobian, excess = self.run(x)
            least = determine(jacobian)[0][-1]
            if excess.max() <= 0 and least > best[0]:
                best = least, x.copy()
            self.solver.note(f"  run {self.runs.count}: smallest eigenvalue {least**2:.4g}, largest so far {best[0]**2:.4g}")
            return float(-np.log(max(least, 1e-300)))

        minimize(function, best[1], method="COBYQA", bounds=[(-np.pi, np.pi)] * best[1].size, options={"maxfev": self.asked.runs},
            constraints=NonlinearConstraint(lambda x: self.run(x)[1], -np.inf, -_MARGIN))  # fmt: skip
        (before, worst), (after, axes) = determine(self.present), determine(self.run(best[1])[0])
        weak = ((combine(d[np.newaxis] @ directions[~is_open], names)[0], s**2, 1 / np.sum((axes @ d / after) ** 2))
                for s, d in zip(before, worst, strict=True) if s <= max(_WEAK, before[-1]))  # fmt: skip
        time, begin, unit = self.asked.experiment.clock
        table = {name: np.asarray(self.tables[own]["value"]) / factor for name, (own, *_, factor) in self.asked.inputs.items()}
        return ExperimentDesign(table={time: (begin + self.t) / unit, **table}, before=before[-1] ** 2, after=after[-1] ** 2,
            weak=tuple(weak), open=combine(directions[is_open], names))  # fmt: skip

    def run(self, x: Array) -> tuple[Array, Array]:
        """The triangular factor of residuals' derivatives by scaled parameters, and by how much limits are exceeded as shares of ranges.
        Behind these is 1 if the run failed, else -1."""
        values = self.middle + self.half * np.sin(self.phase + x.reshape(len(self.phase), -1) @ self.basis)
        for (name, *_), value in zip(self.asked.inputs.values(), values, strict=True):
            self.tables[name] = {"t": self.t, "value": value, "interpolation": self.tables.get(name, {}).get("interpolation", "linear")}
        if (place := np.round(x, 12).tobytes()) not in self.kept:  # COBYQA asks again for the limits of all places of its model
            try:
                found = self.runs.predict(self.solver.start)
            except CutjointError as error:
                self.failures.append(str(error))
                self.solver.note(f"  a run failed: {error}")
                jacobian, excess = np.zeros((1, len(self.solver.names))), [1.0] * (2 * len(self.asked.limits) + 1)
            else:
                jacobian = np.vstack([p.derivatives / s for p, s in zip(found, self.noise, strict=False)]) * self.solver.sizes
                limited = zip(found[len(self.noise) :], self.asked.limits, strict=True)
                excess = [x / (high - low) for p, (_, low, high) in limited for x in (low - p.values.min(), p.values.max() - high)] + [-1.0]
            self.kept[place] = np.asarray(np.linalg.qr(jacobian, mode="r")), np.array(excess)
        return self.kept[place]
