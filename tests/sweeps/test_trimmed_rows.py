"""Rows of sweeps whose starts are trimmed, beside closed forms and single runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint import compile_model, simulate, sweep
from cutjoint.package.errors import RunError
from tests.conftest import needs_cpp
from tests.mechanisms.starts import LOADER
from tests.mechanisms.trims import SLED

pytestmark = [needs_cpp, pytest.mark.cpp]


def test_each_row_has_its_own_trim(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A throttle of at most 1 holds less than 36 m/s: the row without a start fails alone. What is found cannot vary."""
    (tmp_path / "model.yaml").write_text(SLED)
    study = {
        "cutjoint_study": 1, "model": str(tmp_path / "model.yaml"), "parameters": {"target": [10.0, 20.0, 60.0, 30.0]},
        "objectives": {
            "far": {"maximum": "way.displacement"}, "slowest": {"minimum": "way.displacement_rate"},
            "held": {"value": "throttle", "of": "equilibrium"},
        },
    }  # fmt: skip
    done = sweep(study, tmp_path / "table.parquet")
    kept = [0, 1, 3]
    assert [done.failures[row] for row in kept] == [None] * 3
    assert "trim: no start meets all conditions, with 'throttle' = 1 at the bound" in str(done.failures[2])
    speeds = np.array([10.0, 20.0, 30.0])
    assert np.allclose(done["slowest"][kept], speeds, rtol=1e-12)
    assert np.allclose(done["far"][kept], speeds, rtol=1e-9)
    assert np.allclose(done["held"][kept], 0.7 * speeds**2 / 900, rtol=1e-9)
    monkeypatch.setattr("cutjoint.sweeps.run.require_scheduler", lambda address: None)
    with pytest.raises(RunError, match=r"starts of runs are trimmed on this machine"):
        sweep(study | {"objectives": {"far": {"maximum": "way.displacement"}}}, tmp_path / "d.parquet", scheduler="tcp://127.0.0.1:9")
    found = sweep({**study, "parameters": {"throttle": [0.1, 0.2]}}, tmp_path / "other.parquet")
    assert all("trim: 'throttle' is to be found" in str(failure) for failure in found.failures)


@pytest.mark.heavy
def test_rows_are_single_runs(tmp_path: Path) -> None:
    """A loader under load."""
    (tmp_path / "model.yaml").write_text(LOADER)
    names = {"payload": [500.0, 3000.0], "bore": [40e-4, 60e-4]}
    study = {
        "cutjoint_study": 1, "model": str(tmp_path / "model.yaml"), "scenes": ["hold"], "parameters": names,
        "objectives": {"p": {"maximum": "head.value", "unit": "Pa"}, "angle": {"maximum": "foot.angle", "unit": "rad"}},
    }  # fmt: skip
    done = sweep(study, tmp_path / "table.parquet")
    assert done.failures == [None] * 4
    artifact = compile_model(tmp_path / "model.yaml", scene="hold")
    for row in range(4):
        run = simulate(artifact, parameters={name: float(done[name][row]) for name in names}, error=False)
        assert done["p"][row] == pytest.approx(run["head.value"].max(), rel=1e-5)  # of integration beside 1e-6
        assert done["angle"][row] == pytest.approx(run["foot.angle"].max(), abs=1e-7)
