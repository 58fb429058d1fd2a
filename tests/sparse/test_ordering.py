"""Orders of elimination from the libraries."""

from __future__ import annotations

import ctypes.util
from pathlib import Path

import numpy as np
import pytest

from cutjoint.sparse.pattern import make_pattern
from cutjoint.sparse.plan import MissingLibraryError, order_columns, order_symmetric, plan_definite, plan_unsymmetric
from cutjoint.sparse.symbolic import eliminate
from tests.sparse.matrices import kkt_matrix, pattern_of, spd_matrix


@pytest.mark.parametrize(("branches", "nodes"), [(1, 1), (4, 5), (6, 9)])
def test_orders_are_permutations(branches: int, nodes: int) -> None:
    symmetric = pattern_of(spd_matrix(1, branches, nodes), symmetric=True)
    whole = pattern_of(kkt_matrix(1, branches, nodes, massless=1)[0], symmetric=False)
    for pattern, orderings in ((symmetric, order_symmetric(symmetric)), (whole, order_columns(whole))):
        assert len({ordering.name for ordering in orderings}) == 3
        for ordering in orderings:
            assert sorted(ordering.order) == list(range(pattern.size)), ordering.name


def test_the_fill_is_that_of_a_numeric_factorisation() -> None:
    """Random values cancel nowhere, so that Cholesky's factor has exactly the predicted entries."""
    matrix = spd_matrix(3)
    pattern = pattern_of(matrix, symmetric=True)
    for ordering in order_symmetric(pattern):
        elimination = eliminate(pattern, ordering.order, ordering.order)
        factor = np.linalg.cholesky(matrix[np.ix_(ordering.order, ordering.order)])
        predicted = len(matrix) + sum(len(below) for below in elimination.lower)
        assert np.count_nonzero(factor) == predicted, ordering.name


def test_orders_fill_in_less_than_the_given_one() -> None:
    """An arrow that points the wrong way fills in wholly as it stands; any method turns it round."""
    arrow = make_pattern(30, [*((k, k) for k in range(30)), *((k, 0) for k in range(30))], symmetric=True)
    full = sum(len(below) for below in eliminate(arrow, range(30), range(30)).lower)
    assert full == 30 * 29 // 2
    for ordering in order_symmetric(arrow):
        assert sum(len(below) for below in eliminate(arrow, ordering.order, ordering.order).lower) == 29, ordering.name


@pytest.mark.parametrize("size", [1, 2, 5])
def test_matrices_without_couplings(size: int) -> None:
    diagonal = make_pattern(size, [(k, k) for k in range(size)], symmetric=True)
    for ordering in order_symmetric(diagonal):
        assert sorted(ordering.order) == list(range(size)), ordering.name


def test_the_cheapest_order_is_taken_and_all_are_recorded() -> None:
    trials = plan_definite(pattern_of(spd_matrix(1, 6, 9), symmetric=True)).trials
    assert {trial.name for trial in trials} == {"amd", "symamd", "metis"}
    assert [trial.operations for trial in trials] == sorted(trial.operations for trial in trials)
    assert trials[0].multiply_adds < trials[-1].multiply_adds


def test_at_equal_work_the_first_method_is_taken() -> None:
    diagonal = make_pattern(4, [(k, k) for k in range(4)], symmetric=True)
    assert [trial.name for trial in plan_definite(diagonal).trials] == ["amd", "symamd", "metis"]
    whole = make_pattern(4, [(k, k) for k in range(4)], symmetric=False)
    names = [trial.name for trial in plan_unsymmetric(whole, [np.ones(4)]).trials]
    assert names == ["markowitz", "likeness 0", "likeness 1", "likeness 2", "colamd", "amd", "metis"]


def test_a_missing_library_is_named_with_its_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    message = "missing: libamd, which orders sparse matrices; apt-get install libsuitesparse-dev libmetis5"
    with pytest.raises(MissingLibraryError, match=message):
        plan_definite(pattern_of(spd_matrix(1, 1, 1), symmetric=True))


def test_libraries_of_the_package_come_first(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A file that is no library shows that it was tried, before that of the system."""
    (tmp_path / "libamd.so").write_bytes(b"no library")
    monkeypatch.setattr("cutjoint.sparse.plan.binaries_folder", lambda: tmp_path)
    with pytest.raises(OSError, match=str(tmp_path / "libamd.so")):
        plan_definite(pattern_of(spd_matrix(1, 1, 1), symmetric=True))
