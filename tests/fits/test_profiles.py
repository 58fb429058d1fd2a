"""Profile-likelihood intervals beside those of a closed form, whose profiles SciPy's Nelder-Mead and Brent's method find."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, minimize
from scipy.stats import t as student

import cutjoint
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


def test_an_interval_ends_at_a_bound_or_nowhere(tmp_path: Path) -> None:
    study, said = study_of(tmp_path, noise=NOISE, profiles=True, windows=1), list[str]()
    study["parameters"]["damping"] |= {"start": 2, "to": 2.2}
    study["parameters"]["stiffness"] = {}
    study["experiments"]["run"]["to"] = 0.02  # two samples after the start, at which the stiffness changes nothing but noise
    study["experiments"]["run"]["signals"]["rail.displacement"] = {"deviation": NOISE}
    found = cutjoint.fit(study, note=said.append)
    assert found.intervals[1] == pytest.approx([0.1, 2.2], rel=1e-5)
    assert np.isinf(found.intervals[0]).any()
    assert any("profiles: fit" in text and "stiffness" in text for text in said)
    assert "stiffness (95 % interval: ±inf)" in found.faults["not identified"]
