"""The N-four-bar (IFToMM A02): order of convergence, singular poses, invariance against the place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.conftest import DATA
from tests.mechanisms.four_bar import exact_tip, four_bar_text
from tests.physics.simulation import compile_text, completed, read_reference, simulate, with_numerics


def largest_error(run: object, windows: int) -> float:
    exact = exact_tip(windows, run.t)  # type: ignore[attr-defined]
    return float(np.abs(np.stack([run["tip.x"], run["tip.y"]], axis=1) - exact).max())  # type: ignore[index]


@pytest.mark.parametrize("windows", [1, 2, 10])
def test_second_order_before_the_first_singular_pose(tmp_path: Path, windows: int) -> None:
    """Halving dt quarters the error: observed order 2 within 0.1."""
    artifact = with_numerics(compile_text(tmp_path, four_bar_text(windows)), penalty=1e6, tolerance=1e-8)
    errors = [largest_error(completed(simulate(artifact, dt=dt, end=0.6)), windows) for dt in (0.004, 0.002, 0.001)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([2, 2], abs=0.1)


@pytest.mark.parametrize("windows", [1, 2, 10])
def test_stays_on_its_branch_through_ten_seconds_of_singular_poses(tmp_path: Path, windows: int) -> None:
    """Seven or more crossings; 1e-3 of a 1 m bar is 20 times what was measured, a lost branch is 1."""
    run = completed(simulate(compile_text(tmp_path, four_bar_text(windows)), dt=0.001, end=10.0))
    assert largest_error(run, windows) < 1e-3


def test_agrees_with_the_published_reference(tmp_path: Path) -> None:
    run = completed(simulate(compile_text(tmp_path, four_bar_text(2)), dt=0.0005, end=10.0))
    reference = read_reference(DATA / "ref_a02_fourbar_N2.csv")
    rows = reference["t"] <= 10.0
    assert run.t == pytest.approx(reference["t"][rows], abs=1e-9)
    assert run["tip.x"] == pytest.approx(reference["x_B0"][rows], abs=5e-4)
    assert run["tip.y"] == pytest.approx(reference["y_B0"][rows], abs=5e-4)


def test_the_place_does_not_matter(tmp_path: Path) -> None:
    """The same linkage 10 km away: every branch has its pole at its own first joint."""
    near = completed(simulate(compile_text(tmp_path, four_bar_text(2)), dt=0.001, end=2.0))
    far = completed(simulate(compile_text(tmp_path, four_bar_text(2, offset=10000)), dt=0.001, end=2.0))
    # positions of 1e4 m are stored to 2e-12 m; the singular pose at 0.71 s and 1.23 s magnifies differences
    assert far["tip.x"] - 10000 == pytest.approx(near["tip.x"], abs=1e-7)
