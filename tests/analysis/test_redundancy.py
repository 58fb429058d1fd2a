"""Redundant equations by name."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.analysis.closing import explore
from cutjoint.analysis.redundancy import Redundancy, choose_independent, find_redundancy
from tests.analysis.formulated import dense_closures, formulated
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.mechanisms.overconstrained import IN_LINE, UPRIGHT, parallel_cranks_text
from tests.mechanisms.random_models import random_loops

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")


def redundancy(text: str) -> Redundancy:
    equations = formulated(text)
    return find_redundancy(equations, explore(equations))


def names(found: tuple) -> list[str]:
    return [f"{r.joint}.{r.equation}" for r in found]


def test_one_equation_of_each_leaf_hinge_of_the_iltis() -> None:
    """It is the one along the hinge, in the axes of the chassis, wherever that has turned."""
    text = (MODELS / "iltis.yaml").read_text()
    found = redundancy(text)
    assert names(found.structural) == [f"{corner}.leaf_hinge.axis_x" for corner in CORNERS]
    assert found.momentary == ()
    line = 1 + text.split("\n").index(next(x for x in text.split("\n") if "leaf_hinge: {kind: revolute" in x))
    for r in found.structural:
        assert r.place == f"model.yaml:{line}"
        assert r.instead == ()


@pytest.mark.parametrize("windows", [1, 3])
def test_a_planar_loop_in_space_has_four_equations_too_many(windows: int) -> None:
    found = redundancy(four_bar_text(windows))
    expected = [f"closure_{i}.{e}" for i in range(1, windows + 1) for e in ("z", "axis_x", "axis_y", "axis_z")]
    assert names(found.structural) == expected
    assert all(r.instead == () for r in found.structural)


def test_a_third_parallel_crank_brings_an_equation_that_others_imply() -> None:
    found = redundancy(parallel_cranks_text(3))
    assert found.momentary == ()
    (within,) = [r for r in found.structural if r.equation in ("x", "y")]
    assert (within.joint, within.equation) == ("closure_2", "y")
    assert set(within.instead) == {"closure_1.x", "closure_1.y", "closure_2.x"}


def test_two_cranks_in_line_lose_an_equation_for_a_moment() -> None:
    found = redundancy(parallel_cranks_text(2, IN_LINE))
    assert names(found.momentary) == ["closure_1.x"]
    assert names(found.structural) == [f"closure_1.{e}" for e in ("z", "axis_x", "axis_y", "axis_z")]


def test_structural_and_momentary_redundancy_are_reported_apart() -> None:
    """Three cranks in line: one equation in the plane is always implied, another for the moment."""
    found = redundancy(parallel_cranks_text(3, IN_LINE))
    assert len([r for r in found.structural if r.equation in ("x", "y")]) == 1
    assert [r.equation for r in found.momentary] == ["x"]


def test_of_a_hinge_in_no_special_direction_the_first_two_equations_are_kept() -> None:
    text = (MODELS / "iltis.yaml").read_text()
    found = redundancy(text.replace("at: S, axis: [1, 0, 0], cut: true", "at: S, axis: [2, 1, 1], cut: true"))
    assert "front_left.leaf_hinge.axis_z" in names(found.structural)


@pytest.mark.parametrize("seed", [1, 3, 7, 9])
def test_what_is_kept_is_independent_and_any_named_equation_may_go_instead(seed: int) -> None:
    """By the oracle's Jacobians: the kept rows have full rank in every pose, and still where one named equation is exchanged."""
    equations = formulated(random_loops(seed))
    poses = explore(equations)
    rank = max(p.rank for p in poses)
    every = list(equations.equation_names)
    jacobians = [dense_closures(equations, p.q).jacobian for p in poses if p.rank == rank]
    structural = find_redundancy(equations, poses).structural
    kept = [n for n in every if n not in names(structural)]

    def ranks(rows: list[str]) -> list[int]:
        return [int(np.linalg.matrix_rank(J[[every.index(n) for n in rows]], rtol=1e-9)) for J in jacobians]

    assert len(kept) == rank
    assert set(ranks(kept)) == {rank}
    for r in structural:
        for other in r.instead:
            assert max(ranks([f"{r.joint}.{r.equation}" if n == other else n for n in kept])) == rank


def test_a_row_that_is_good_in_every_matrix_is_preferred() -> None:
    one = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    other = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    assert choose_independent([one], 2) == [1, 2]
    assert choose_independent([other], 2) == [0, 1]
    assert choose_independent([one, other], 2) == [1, 2]


def test_rows_stay_in_their_order_unless_they_add_too_little() -> None:
    rows = np.array([[1.0, 0.0, 0.0], [1.0, 1e-6, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 1.0]])
    assert choose_independent([rows], 3) == [0, 2, 3]
    assert choose_independent([rows[:2]], 2) == [0, 1]


def test_matrices_without_a_common_basis_are_not_an_error() -> None:
    one, other = np.array([[1.0], [0.0]]), np.array([[0.0], [1.0]])
    assert len(choose_independent([one, other], 1)) == 1


def test_cranks_upright_and_in_line_have_the_same_structure() -> None:
    upright, in_line = (len(redundancy(parallel_cranks_text(3, crank)).structural) for crank in (UPRIGHT, IN_LINE))
    assert upright == in_line == 9
