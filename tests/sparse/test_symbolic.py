"""Symbolic elimination against numeric factorisations."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg

from cutjoint.sparse.pattern import make_pattern
from cutjoint.sparse.symbolic import Elimination, eliminate, multiply_adds, postorder, renumber
from cutjoint.sparse.tiles import WIDTH, Tiling, make_tiles
from tests.sparse.matrices import Array, pattern_of, spd_matrix


def sparse_matrix(seed: int, size: int = 40) -> Array:
    """Few entries, unsymmetric, and a diagonal that needs no pivoting."""
    random = np.random.default_rng(seed)
    return np.where(random.random((size, size)) < 0.06, random.normal(size=(size, size)), 0) + 10 * np.eye(size)


def numeric_structure(matrix: Array) -> tuple[Array, Array]:
    """SuperLU's factors without any permutation."""
    options = {"permc_spec": "NATURAL", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    factors = scipy.sparse.linalg.splu(scipy.sparse.csc_matrix(matrix), **options)
    np.testing.assert_array_equal(factors.perm_r, range(len(matrix)))
    np.testing.assert_array_equal(factors.perm_c, range(len(matrix)))
    return factors.L.toarray(), factors.U.toarray()


def structure(elimination: Elimination) -> tuple[Array, Array]:
    """Patterns of L and U."""
    size = len(elimination.rows)
    L, U = np.eye(size), np.eye(size)
    for k, (below, right) in enumerate(zip(elimination.lower, elimination.upper, strict=True)):
        L[list(below), k] = 1
        U[k, list(right)] = 1
    return L, U


@pytest.mark.parametrize("seed", range(5))
def test_the_structure_holds_the_numeric_factors(seed: int) -> None:
    matrix = sparse_matrix(seed)
    elimination = eliminate(pattern_of(matrix, symmetric=False), range(40), range(40))
    for predicted, found in zip(structure(elimination), numeric_structure(matrix), strict=True):
        assert not ((found != 0) & (predicted == 0)).any()
        assert np.count_nonzero(predicted) == np.count_nonzero(found), "random values cancel nowhere"


def test_pivots_off_the_diagonal() -> None:
    matrix = sparse_matrix(7)
    random = np.random.default_rng(1)
    rows, columns = random.permutation(40), random.permutation(40)
    shuffled = np.zeros_like(matrix)
    shuffled[np.ix_(rows, columns)] = matrix  # pivot k of the matrix is entry (rows[k], columns[k])
    direct = eliminate(pattern_of(matrix, symmetric=False), range(40), range(40))
    moved = eliminate(pattern_of(shuffled, symmetric=False), rows.tolist(), columns.tolist())
    assert (moved.lower, moved.upper) == (direct.lower, direct.upper)


def test_operations_compute_the_factors() -> None:
    """Carrying out the listed operations alone gives the Schur complements' diagonal, the pivots."""
    matrix = sparse_matrix(3)
    elimination = eliminate(pattern_of(matrix, symmetric=False), range(40), range(40))
    remains = matrix.copy()
    for i, j, k in elimination.operations():
        remains[i, j] -= remains[i, k] * remains[k, j] / remains[k, k]
    _, U = numeric_structure(matrix)
    np.testing.assert_allclose(remains.diagonal(), U.diagonal(), rtol=1e-12)


@pytest.mark.parametrize("symmetric", [True, False])
def test_multiply_adds_are_those_of_the_operations(symmetric: bool) -> None:
    matrix = spd_matrix(1, 2, 3)
    elimination = eliminate(pattern_of(matrix, symmetric=symmetric), range(len(matrix)), range(len(matrix)))
    below, right = (sum(map(len, part)) for part in (elimination.lower, elimination.upper))
    scaling, solution = below, below + right + len(matrix)
    assert multiply_adds(elimination) == sum(1 for _ in elimination.operations()) + scaling + solution


def test_a_dense_matrix_has_the_counts_of_the_textbook() -> None:
    """L U of n unknowns: (n^3 - n) / 3 multiply-adds with scaling, and n^2 for a solution."""
    n = 12
    whole = make_pattern(n, [(i, j) for i in range(n) for j in range(n)], symmetric=False)
    assert multiply_adds(eliminate(whole, range(n), range(n))) == (n**3 - n) // 3 + n**2


@pytest.mark.parametrize("seed", range(5))
def test_the_postorder_fills_in_alike(seed: int) -> None:
    pattern = pattern_of(sparse_matrix(seed), symmetric=False)
    elimination = eliminate(pattern, range(40), range(40))
    ordered = renumber(elimination, postorder(elimination))
    assert ordered == eliminate(pattern, ordered.rows, ordered.columns)
    assert multiply_adds(ordered) == multiply_adds(elimination)


@pytest.mark.parametrize("symmetric", [True, False])
def test_tiles_hold_the_factors_and_change_later_ones_only(symmetric: bool) -> None:
    matrix = spd_matrix(2) if symmetric else sparse_matrix(2)
    elimination = eliminate(pattern_of(matrix, symmetric=symmetric), range(len(matrix)), range(len(matrix)))
    tiling = make_tiles(elimination)
    assert sorted(tiling.elimination.rows) == list(range(len(matrix)))
    assert all(1 <= tiling.size(tile) <= WIDTH for tile in range(len(tiling)))
    permuted = matrix[np.ix_(tiling.elimination.rows, tiling.elimination.columns)]
    L, U = numeric_structure(permuted)
    assert not (_outside(tiling, L) | _outside(tiling, U)).any()


def _outside(tiling: Tiling, factor: Array) -> Array:
    """Entries of a factor that no block of the tiling has."""
    entries = factor != 0
    for tile in range(len(tiling)):
        own = tiling.pivots(tile)
        entries[own.start : own.stop, own.start : own.stop] = False
        for other in tiling.lower[tile]:
            assert other > tile
            entries[np.ix_(tiling.pivots(other), own)] = False
        for other in tiling.upper[tile]:
            assert other > tile
            entries[np.ix_(own, tiling.pivots(other))] = False
    return entries


def test_wrong_orders_are_refused() -> None:
    pattern = make_pattern(3, [(k, k) for k in range(3)], symmetric=True)
    with pytest.raises(ValueError, match="have to be permutations"):
        eliminate(pattern, [0, 1, 1], [0, 1, 1])
    with pytest.raises(ValueError, match="one order of rows and columns"):
        eliminate(pattern, [0, 1, 2], [0, 2, 1])
