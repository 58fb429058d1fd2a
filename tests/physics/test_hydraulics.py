"""The cylinder of the recipes, whose oil has pressure: no oil is lost, and its motion is that of equations by hand."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import ROOT
from tests.physics.simulation import compile_scene

AREA, BULK, MASS = 12e-4, 1.4e9, 500.0


@cache
def text() -> str:
    found = re.search(r'title="oil\.yaml"\n(.*?)```', (ROOT / "docs/how-to/hydraulics.md").read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found[1]


def oil(written: str) -> Model:
    return read_model_text(written, "oil.yaml")


def run(model: Model, method: str, integrator: str, **options: float) -> Trajectory:
    artifact = compile_scene(model, model.scenes["lift"], CompileOptions(method=method))
    return simulate(artifact, integrator=integrator, error=False, **options)  # type: ignore[arg-type]


@cache
def by_hand() -> np.ndarray:
    """Displacement and pressures at the rows from masses of oil in the chambers, (2001, 3): the pressures follow from densities."""

    def pressures(y: np.ndarray) -> tuple[float, float]:
        return BULK * np.log(y[2] / (860 * AREA * (0.1 + y[0]))), BULK * np.log(y[3] / (860 * AREA * (0.5 - y[0])))

    def derive(opening: float, y: np.ndarray) -> list[float]:
        (below, above), (up, down) = pressures(y), (max(0.0, opening) * 4e-8, max(0.0, -opening) * 4e-8)
        leak = 2e-10 * (below - above)
        push = AREA * (below - above) - 2e4 * y[1] - MASS * 9.81
        return [y[1], push / MASS, up * (1e7 - below) - down * below - leak, -up * above + down * (1e7 - above) + leak]

    y, rows = np.array([0, 0, 860 * AREA * 0.1 * np.exp(42e5 / BULK), 860 * AREA * 0.5 * np.exp(1e5 / BULK)]), []
    for begin, end, opening in ((0, 500, 1.0), (500, 1200, 0.0), (1200, 2000, -0.5)):
        t = np.arange(begin, end + 1) * 1e-3
        found = solve_ivp(lambda _, y, o=opening: derive(o, y), t[[0, -1]], y, t_eval=t, method="Radau", rtol=1e-11, atol=1e-13).y
        y = found[:, -1]
        rows += [[x[0], *pressures(x)] for x in found.T[:-1]]
    return np.array([*rows, [y[0], *pressures(y)]])


@pytest.mark.parametrize(
    ("method", "integrator"),
    [("recursive", "dormand-prince"), ("recursive-newton", "radau5")],
)
def test_no_oil_is_lost(method: str, integrator: str) -> None:
    """Steps that err by 1e-8 of 50 bar lose 1e-8 of the density's change by that, 3e-3 of 5.6 kg, in each of some hundred."""
    found = run(oil(text()), method, integrator, tolerance=1e-8)
    assert found.failure is None
    assert np.ptp(found["oil"]) < 1e-8
    known = by_hand()
    assert np.abs(found["rod.displacement"] - known[:, 0]).max() < 1e-7
    assert np.abs(found["below.value"] - known[:, 1]).max() < 1e-6 * 93e5
    assert found["rod.displacement"].max() > 0.04


@pytest.mark.parametrize("method", ["recursive-newton", "augmented"])
def test_equal_steps_lose_less_the_shorter_they_are(method: str) -> None:
    """By the trapezoidal rule a fourth of the step loses a sixteenth."""
    lost = [np.ptp(run(oil(text().replace("{end: 2,", f"{{end: 0.4, numerics: {{dt: {dt}, solver_tolerance: 1e-9}},")),
                       method, "trapezoidal")["oil"]) for dt in (1e-3, 2.5e-4)]  # fmt: skip
    assert np.log2(lost[0] / lost[1]) == pytest.approx(4, abs=0.5)


def test_a_leak_to_nowhere_shows() -> None:
    leaking = text().replace("rate: outflow - inflow", "rate: outflow - inflow - leak")
    found = run(oil(leaking), "recursive", "dormand-prince", tolerance=1e-8)
    assert np.ptp(found["oil"]) > 1e-3
