"""Ranks that are known otherwise, and those of the dense oracle."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.analysis.closing import explore
from cutjoint.analysis.mobility import Mobility, find_mobility
from tests.analysis.formulated import dense_closures, formulated
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.mechanisms.overconstrained import IN_LINE, parallel_cranks_text
from tests.mechanisms.random_models import random_loops


def mobility(text: str) -> Mobility:
    return find_mobility(formulated(text))


def test_iltis_has_10_degrees_of_freedom() -> None:
    """42 coordinates, 36 equations of which each revolute cut has one too many (Cuadrado et al. 2000)."""
    found = mobility((MODELS / "iltis.yaml").read_text())
    assert (found.speeds, found.equations, found.rank, found.degrees_of_freedom) == (42, 36, 32, 10)
    assert (found.design_rank, found.redundant, found.poses, found.closed) == (32, 4, 5, True)


@pytest.mark.parametrize("windows", [1, 2, 10])
def test_the_n_four_bar_has_one_degree_of_freedom(windows: int) -> None:
    """Planar: 2N + 1 angles, 2N independent closures among 6N equations in space."""
    found = mobility(four_bar_text(windows))
    assert (found.speeds, found.equations, found.rank) == (2 * windows + 1, 6 * windows, 2 * windows)
    assert found.design_rank == found.rank


@pytest.mark.parametrize("cranks", [2, 3, 4])
def test_further_parallel_cranks_change_nothing(cranks: int) -> None:
    found = mobility(parallel_cranks_text(cranks))
    assert (found.speeds, found.rank, found.degrees_of_freedom) == (cranks + 1, cranks, 1)


@pytest.mark.parametrize("cranks", [2, 3])
def test_bars_in_line_are_singular_for_a_moment(cranks: int) -> None:
    """No pin moves along the bars, so that each closure loses its equation in x."""
    found = mobility(parallel_cranks_text(cranks, IN_LINE))
    assert (found.rank, found.design_rank, found.poses) == (cranks, cranks - 1, 5)
    assert found.degrees_of_freedom == 1


@pytest.mark.parametrize("seed", [1, 3, 7, 9])
def test_ranks_are_the_oracles(seed: int) -> None:
    equations = formulated(random_loops(seed))
    poses = explore(equations)
    ranks = [np.linalg.matrix_rank(dense_closures(equations, pose.q).jacobian, rtol=1e-9) for pose in poses]
    assert [pose.rank for pose in poses] == ranks
    assert find_mobility(equations, poses).rank == max(ranks)
