"""Fits from starts that are far off, beside the closed form of an oscillation, and what is said of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import cutjoint
from cutjoint.fits.fit import Solver, _open, _result, identify
from cutjoint.fits.reading import read_fit
from cutjoint.fits.residuals import Prediction
from tests.fits.slide import study_of


@pytest.mark.parametrize("start", [20.0, 900.0])
def test_an_oscillation_is_found_from_starts_whose_phase_differs_by_turns(tmp_path: Path, start: float) -> None:
    """Fits to the whole time at once take 16 and 80 iterations from here."""
    study = study_of(tmp_path)
    study["parameters"] = {"stiffness": {"start": start}, "damping": {"start": 1.0}}
    found = cutjoint.fit(study)
    assert found["stiffness"] == pytest.approx(200.0, rel=1e-6)
    assert found["damping"] == pytest.approx(2.0, rel=1e-6)
    assert found.verdict == "identified"
    assert found.iterations <= 10


def test_bounds_that_are_far_away_take_no_iterations(tmp_path: Path) -> None:
    study = study_of(tmp_path)
    free = {**study, "parameters": {"stiffness": {}, "damping": {}}}
    assert cutjoint.fit(study).iterations == cutjoint.fit(free).iterations <= 10


def test_a_bound_that_holds_is_kept_to_and_said(tmp_path: Path) -> None:
    study, said = study_of(tmp_path), list[str]()
    study["parameters"]["damping"] = {"from": 2.5, "to": 50}
    found = cutjoint.fit(study, note=said.append)
    assert found["damping"] == pytest.approx(2.5, rel=1e-6)
    assert found["stiffness"] == pytest.approx(200.0, rel=2e-2)
    assert "damping ends at its bound" in said


def test_a_residual_above_the_deviation_that_is_given_is_a_verdict(tmp_path: Path) -> None:
    study = study_of(tmp_path, noise=1e-3)
    study["experiments"]["run"]["signals"] = {"rail.displacement": {"deviation": "1e-4 m"}}
    found = cutjoint.fit(study)
    assert found.verdict == "residual not white"
    assert "rail.displacement of run has 9.59 times the deviation that the study gives" in found.faults[found.verdict]
    study["experiments"]["run"]["signals"] = {"rail.displacement": {"deviation": "1e-3 m"}}
    assert cutjoint.fit(study).verdict == "identified"


@pytest.mark.parametrize(
    ("samples", "ratio", "deviation", "is_loud"), [(1, 2.3, 1.0, False), (50, 2.3, 1.0, True), (50, 5.0, 1e-9, False), (1, 9.0, 1.0, True)]
)
def test_a_residual_is_above_its_deviation_by_more_than_chance(samples: int, ratio: float, deviation: float, is_loud: bool) -> None:
    """Of one sample in fifty the noise is above 2.3 deviations; 1e-9 of a signal's changes is rounding."""
    values = np.full(samples, ratio * deviation)
    signal: Any = SimpleNamespace(values=values, times=np.arange(float(samples)), text="x", missing=0, unit="")
    of: Any = SimpleNamespace(is_pose=True, name="run", validation=False)
    result = _result(Prediction(experiment=of, signal=signal, values=0 * values, derivatives=values[:, None]), deviation)
    result = replace(result, explained=1 - (ratio * deviation) ** 2)  # of a signal that changes by 1
    none = np.zeros(0)
    solver: Any = SimpleNamespace(names=[], sizes=[], low=none, high=none, study=SimpleNamespace(loss="linear"))
    after = identify(np.ones((2, 1)), ["p"], np.ones(1), 2)
    faults = Solver._find_faults(solver, SimpleNamespace(status=1, x=none), after, np.zeros((2, 0)), none, [result])
    assert bool(faults) is is_loud


def test_windows_find_the_other_parameters_where_one_is_at_its_bound(tmp_path: Path) -> None:
    study = study_of(tmp_path)
    study["parameters"] = {"stiffness": {"start": 150.0}, "damping": {"start": 0.5, "to": 0.5}}
    solver = Solver(read_fit(study), lambda text: None)
    solver.runs.share = 0.25
    stiffness, damping = solver.least_squares(solver.start, 6).x
    assert stiffness == pytest.approx(200.0, rel=0.05)
    assert damping == pytest.approx(0.5, rel=1e-6)


def test_windows_that_lead_away_do_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of them ends with a damping below zero, by which the motion grows."""
    study, begun = study_of(tmp_path), list[Any]()
    study["parameters"] = {"stiffness": {"start": 900.0}, "damping": {"start": 3.0}}
    solver = Solver(read_fit(study), lambda text: None)

    def least_squares(begin: Any, most: int) -> Any:
        begun.append((solver.runs.share, list(begin)))
        return SimpleNamespace(x=np.array([900.0, -5.0]), njev=1)

    monkeypatch.setattr(solver, "least_squares", least_squares)
    solver.through_windows(solver.start)
    assert begun[0][0] < begun[-1][0] == 1.0
    assert begun[-1][1] == [900.0, 3.0]


def test_a_mechanism_that_is_not_at_rest_is_named(tmp_path: Path) -> None:
    study = study_of(tmp_path)
    text = (tmp_path / "slide.yaml").read_text().replace("-stiffness*position", "-stiffness*(position - 0.1*t)")
    (tmp_path / "slide.yaml").write_text(text)
    study["experiments"]["run"]["rest"] = True
    with pytest.raises(cutjoint.CutjointError, match=r"experiment 'run': rest: "):
        cutjoint.fit(study)


def test_parameters_with_similar_effects_are_not_called_undetermined() -> None:
    one, other = np.random.default_rng(0).normal(size=(2, 50))
    (words,) = _open(identify(np.column_stack([one, one + 0.02 * other]), ["p", "q"], np.ones(2), 50))
    assert words.startswith("p and q have similar effects (collinearity 64.7)")
    words, *_ = _open(identify(np.column_stack([one, one + 1e-6 * other]), ["p", "q"], np.ones(2), 50))
    assert words.startswith("the data hardly determine: ")


def test_white_noise_is_called_coloured_as_rarely_as_the_level_says() -> None:
    rng, found = np.random.default_rng(0), []
    for _ in range(3000):
        signal: Any = SimpleNamespace(values=rng.normal(size=126), times=np.arange(126.0), text="x", missing=0, unit="")
        of: Any = SimpleNamespace(is_pose=False, name="run", validation=False)
        prediction = Prediction(experiment=of, signal=signal, values=np.zeros(126), derivatives=np.zeros((126, 1)))
        found.append(_result(prediction, 1.0).p_value)
    assert np.mean(np.array(found, dtype=float) < 0.01) == pytest.approx(0.01, abs=0.0055)  # three standard deviations
