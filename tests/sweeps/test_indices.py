"""Sobol' indices of sweeps: beside closed forms, with runs that fail, and what is refused."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from tests.conftest import MODELS, ROOT, needs_cpp
from tests.sweeps.studies import study

pytest.importorskip("pyarrow")
pytestmark = needs_cpp

MODEL = """
cutjoint: 1
name: falling
gravity: [0, 0, 0]
parameters:
  a: {value: 0, binding: param}
  b: {value: 0, binding: param}
  c: {value: 0, binding: param}
bodies: {body: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {slide: {kind: prismatic, bodies: [ground, body], at: [0, 0, 0], axis: [0, 0, 1]}}
forces: {push: {kind: joint_force, joint: slide, law: a + b + c}}
outputs: [body.z]
scenes: {fall: {end: 0.002, output_step: 1 ms, numerics: {dt: 1 ms}}}
"""
ISHIGAMI = "sin(a) + 7*sin(b)**2 + 0.1*c**4*sin(a)"


def study_of(folder: Path, points: int, objective: str) -> Path:
    (folder / "falling.yaml").write_text(MODEL, encoding="utf-8")
    ranges = {name: {"from": -pi, "to": pi} for name in "abc"}
    return study(
        folder, model="falling.yaml", end=None, integrator=None, parameters=ranges, rates=None, trajectories=None,
        design={"sobol_indices": points, "seed": 5}, objectives={"value": {"end": objective}},
    )  # fmt: skip


def test_a_function_whose_indices_are_known(tmp_path: Path) -> None:
    """Ishigami's function: the variance is a sum of three parts in closed form."""
    done = cutjoint.sweep(study_of(tmp_path, 2048, ISHIGAMI), tmp_path / "out.parquet")
    found = done.find_indices("value")
    alone = [0.5 * (1 + 0.1 * pi**4 / 5) ** 2, 49 / 8, 0.0]
    together = 0.1**2 * pi**8 * (1 / 18 - 1 / 50)  # of a and c
    variance = sum(alone) + together
    assert found.variables == ("a", "b", "c")
    assert found.points == 2048
    assert found.first == pytest.approx(np.array(alone) / variance, abs=0.02)
    assert found.total == pytest.approx(np.add(alone, [together, 0, together]) / variance, abs=0.02)
    for values, interval in ((found.first, found.first_interval), (found.total, found.total_interval)):
        assert (interval[0] <= values).all()
        assert (values <= interval[1]).all()
    assert (np.ptp(found.total_interval, axis=0) < 0.15).all()
    again = done.find_indices("value")
    assert np.array_equal(again.first_interval, found.first_interval)


def test_points_of_runs_without_a_number_do_not_count(tmp_path: Path) -> None:
    """A body that never reaches a level has no time of crossing."""
    path = study_of(tmp_path, 64, ISHIGAMI)
    text = path.read_text(encoding="utf-8").replace(f"end: {ISHIGAMI}", "crossing: body.z\n    at: 1.0e-7")
    path.write_text(text, encoding="utf-8")
    found = cutjoint.sweep(path, tmp_path / "out.parquet").find_indices("value")
    assert found.points < 64
    assert np.isfinite(found.total).all()


def test_the_command_prints_shares_the_largest_first(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["sweep", str(study_of(tmp_path, 256, "a + 3*b + 2*c")), "--out", str(tmp_path / "out.parquet")])
    assert result.exit_code == 0, result.output
    _, table = result.output.split("Sobol' indices of value, 256 points")
    assert [line.split()[0] for line in table.splitlines()[2:5]] == ["b", "c", "a"]


def test_what_has_no_indices(tmp_path: Path) -> None:
    with pytest.raises(cutjoint.ModelError, match="100 points are no power of two; write 64 or 128"):
        cutjoint.sweep(study_of(tmp_path, 100, "a"), tmp_path / "out.parquet")
    path = study(tmp_path, design={"sobol_indices": 64}, rates=None)
    with pytest.raises(cutjoint.ModelError, match="compares variables, and there is one"):
        cutjoint.sweep(path, tmp_path / "out.parquet")
    done = cutjoint.sweep(study(tmp_path, design={"sobol": 4}), tmp_path / "other.parquet")
    with pytest.raises(cutjoint.RunError, match="follow from the design"):
        done.find_indices("top")


def test_the_optimiser_of_the_page_on_sweeps_finds_the_best_press(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs" / "how-to" / "sweep.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"## Optimise.*?```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").symlink_to(MODELS)
    names: dict[str, Any] = {}
    exec(compile(code, "sweep.md", "exec"), names)
    assert names["best"].x == pytest.approx([1000, 10], rel=0.02)
    ends = names["heights"](np.array([[1000, 4000], [10, 5]]))
    assert -names["best"].fun == pytest.approx(-ends[0], rel=0.01)
    assert ends[1] > ends[0]
