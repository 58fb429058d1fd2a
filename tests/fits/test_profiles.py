"""Profile-likelihood intervals beside those of a closed form, whose profiles SciPy's Nelder-Mead and Brent's method find."""

from __future__ import annotations

from math import inf
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize
from scipy.stats import t as student

import cutjoint
from cutjoint.fits.fit import Solver
from cutjoint.package.errors import RunError
from tests.fits.slide import study_of

NOISE = 0.03


def cost_of(data: np.ndarray, stiffness: float, damping: float) -> float:
    """Half the sum of squares of 2 x'' + damping x' + stiffness x = 0 from x = 0, x' = 1."""
    w = np.sqrt(stiffness / 2 - damping**2 / 16)
    return float(np.sum(((np.exp(-damping / 4 * data[:, 0]) * np.sin(w * data[:, 0]) / w - data[:, 1]) / NOISE) ** 2)) / 2


def test_intervals_by_profiles_are_those_of_a_closed_form(tmp_path: Path) -> None:
    study, said = study_of(tmp_path, noise=NOISE, profiles=True), list[str]()
    study["experiments"]["run"]["signals"]["rail.displacement"] = {"deviation": NOISE}
    found = cutjoint.fit(study, out=tmp_path / "fit.json", note=said.append)
    data = np.loadtxt(tmp_path / "d.csv", delimiter=",", skiprows=1)
    quantile, best = student.ppf(0.975, len(data) - 2), found.values
    least = cost_of(data, *best)
    for i in range(2):
        def rise(value: float, i: int = i) -> float:
            others = minimize(lambda y: cost_of(data, *((value, y[0]) if i == 0 else (y[0], value))), best[1 - i], method="Nelder-Mead",
                              options={"xatol": 1e-9, "fatol": 1e-9})  # fmt: skip
            return float(2 * (others.fun - least) - quantile**2)

        reach = 2 * found.deviations[i]
        ends = [brentq(rise, best[i] + near * reach, best[i] + far * reach, xtol=1e-6) for near, far in ((-3, -1 / 3), (1 / 3, 3))]
        assert np.abs(found.intervals[i] - ends).max() < 3e-3 * reach
        below, above = best[i] - ends[0], ends[1] - best[i]
    assert above > 1.1 * below  # damping: not symmetric, as that of the covariance is
    assert (tmp_path / "fit.profiles.parquet").is_file()
    assert cutjoint.fit(study, out=tmp_path / "fit.json", note=said.append).intervals.tolist() == found.intervals.tolist()


def test_an_interval_ends_at_a_bound_or_where_nothing_runs(tmp_path: Path) -> None:
    study = study_of(tmp_path, noise=NOISE, profiles=True, windows=1)
    study["parameters"]["damping"] |= {"start": 2, "to": 2.2}
    study["parameters"]["stiffness"] = {}
    study["experiments"]["run"]["to"] = 0.02  # two samples after the start, at which the stiffness changes nothing but noise
    study["experiments"]["run"]["signals"]["rail.displacement"] = {"deviation": NOISE}
    found = cutjoint.fit(study)
    assert found.intervals[1] == pytest.approx([0.1, 2.2], rel=1e-5)
    assert np.abs(found.intervals[0]).min() > 1e5  # beyond, steps of 2 ms are unstable, and no run succeeds
    assert "stiffness (95 % interval: -" in found.faults["not identified"]
    assert "damping (95 % interval: 0.1 to 2.2)" in found.faults["not identified"]  # bounds determine nothing


def test_costs_of_profiles_and_of_the_result_have_the_same_weights(tmp_path: Path) -> None:
    """Deviations of two signals that are not given are estimated once more after the last fit."""
    study = study_of(tmp_path, profiles=True)
    t, x = np.loadtxt(tmp_path / "d.csv", delimiter=",", skiprows=1).T
    noise = np.random.default_rng(1).normal(size=(2, len(t)))
    rows = np.column_stack([t, x + 1e-3 * noise[0], np.gradient(x, t) + 0.3 * noise[1]])
    np.savetxt(tmp_path / "d.csv", rows, delimiter=",", header="t,rail.displacement,rail.displacement_rate", comments="")
    (tmp_path / "slide.yaml").write_text((tmp_path / "slide.yaml").read_text().replace("[rail.d", "[rail.displacement_rate, rail.d"))
    study["experiments"]["run"]["signals"]["rail.displacement_rate"] = {}
    found = cutjoint.fit(study)
    reach = student.ppf(0.975, 2 * len(t) - 2) * found.deviations
    assert np.abs((found.intervals.T - found.values) / reach - [[-1], [1]]).max() < 0.05  # nearly a parabola with so little noise
    assert "not identified" not in found.faults


def end_of(share: object, distance: float, low: float = -inf, high: float = inf) -> float:
    """The end that is found where a profile's root is that share of the quantile, a function of the parameter; best at 0."""
    solver = object.__new__(Solver)
    solver.names, solver.low, solver.high, solver.known = ["k"], np.array([low]), np.array([high]), (np.zeros(0, int), *np.zeros((2, 0)))
    quantile = 2.0

    def fit(begin: np.ndarray) -> SimpleNamespace:
        return SimpleNamespace(cost=7.0 + (share(begin[0]) * quantile) ** 2 / 2, x=begin)  # type: ignore[operator]

    solver.least_squares = fit  # type: ignore[assignment]
    return float(solver.find_end(0, distance, 7.0, quantile, np.zeros(1)).x[0])


def test_ends_of_intervals() -> None:
    def runs_above_a_mass(k: float) -> float:
        if k < -1.5:
            raise RunError("the mass is not above zero")
        return abs(k) / 2

    assert end_of(lambda k: abs(k), 5.0) == pytest.approx(1, rel=2e-3)
    assert end_of(lambda k: abs(k) ** 3, -0.1) == pytest.approx(-1, rel=2e-3)
    assert end_of(lambda k: 1.065 * abs(k), -6.0, low=-1) == pytest.approx(-1 / 1.065, rel=2e-3)  # a little inside the bound
    assert end_of(lambda k: abs(k) / 9, -6.0, low=-1) == -1
    assert end_of(lambda k: 0.0, 3.0, high=0) == 0  # best at the bound
    assert end_of(lambda k: 0.5 + (k > 2), 1.0) == pytest.approx(2, rel=1e-2)  # a jump
    assert end_of(runs_above_a_mass, -3.0) == pytest.approx(-1.5, rel=1e-2)
    with pytest.raises(RunError, match=r"the data hardly tell k = 4\.19"):
        end_of(lambda k: 0.1, 1.0)


def test_profiles_of_robust_losses_are_refused(tmp_path: Path) -> None:
    with pytest.raises(cutjoint.ModelError, match=r"profiles.*use 'bootstrap'"):
        cutjoint.fit(study_of(tmp_path, profiles=True, loss="cauchy"))
