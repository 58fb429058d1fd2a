"""Patterns: compressed columns as the runtime has them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse

from cutjoint.sparse.pattern import Pattern, dense, make_pattern, positions
from tests.sparse.matrices import kkt_matrix, pattern_of, values_of


def test_compressed_columns_are_those_of_scipy() -> None:
    matrix, _ = kkt_matrix(1, branches=2, nodes=3)
    pattern = pattern_of(matrix, symmetric=False)
    scipys = scipy.sparse.csc_array(matrix)
    assert pattern.first == tuple(scipys.indptr.tolist())
    assert pattern.row == tuple(scipys.indices.tolist())


def test_either_half_of_a_symmetric_pattern_gives_the_lower_triangle() -> None:
    lower = make_pattern(3, [(0, 0), (2, 0), (1, 1), (2, 2)], symmetric=True)
    upper = make_pattern(3, [(2, 2), (1, 1), (0, 2), (0, 0), (0, 2)], symmetric=True)
    assert lower == upper == Pattern(size=3, symmetric=True, first=(0, 2, 3, 4), row=(0, 2, 1, 2))
    assert positions(lower) == {(0, 0): 0, (2, 0): 1, (0, 2): 1, (1, 1): 2, (2, 2): 3}


def test_values_find_their_places() -> None:
    matrix, _ = kkt_matrix(2, branches=2, nodes=3)
    pattern = pattern_of(matrix, symmetric=False)
    np.testing.assert_array_equal(dense(pattern, values_of(pattern, matrix)), matrix)
    found = positions(pattern)
    assert [found[entry] for entry in pattern.entries()] == list(range(len(pattern.row)))


def test_entries_outside_are_refused() -> None:
    with pytest.raises(ValueError, match=r"entry \(3, 0\) is outside of a matrix of size 3"):
        make_pattern(3, [(3, 0)], symmetric=False)
