"""Static pivots from samples."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from cutjoint.sparse.pattern import Pattern, make_pattern
from cutjoint.sparse.pivoting import (
    LAST_RESORT,
    LIKENESSES,
    THRESHOLD,
    NoPivotError,
    PivotSequence,
    SingularError,
    dependent_rows,
    pivot_by_columns,
    pivot_by_likeness,
    pivot_by_markowitz,
    scale_samples,
)
from cutjoint.sparse.plan import plan_unsymmetric
from tests.sparse.matrices import Array, kkt_matrix, nearby, pattern_of, values_of


def multipliers(matrix: Array, rows: tuple[int, ...], columns: tuple[int, ...]) -> Array:
    """All |l_ik| of an elimination with these pivots."""
    remains = matrix[np.ix_(rows, columns)].copy()
    found = []
    for k in range(len(matrix)):
        factors = remains[k + 1 :, k] / remains[k, k]
        remains[k + 1 :] -= np.outer(factors, remains[k])
        found.append(np.abs(factors))
    return np.concatenate(found)


CHOICES = (pivot_by_markowitz, *(partial(pivot_by_likeness, number=number) for number in range(len(LIKENESSES))))


@pytest.mark.parametrize("choose", CHOICES)
def test_pivots_hold_in_all_samples(choose: Callable[[Pattern, Array], PivotSequence]) -> None:
    matrix, _ = kkt_matrix(1)
    pattern = pattern_of(matrix, symmetric=False)
    samples = nearby(matrix, 2, 4)
    scaled = scale_samples(pattern, [values_of(pattern, sample) for sample in samples])
    sequence = choose(pattern, scaled)
    assert sorted(sequence.rows) == sorted(sequence.columns) == list(range(len(matrix)))
    largest = max(multipliers(sample, sequence.rows, sequence.columns).max() for sample in scaled)
    assert sequence.threshold >= THRESHOLD
    np.testing.assert_allclose(1 / largest, sequence.threshold, rtol=1e-6)  # another order of operations


def test_a_pivot_that_vanishes_in_one_sample_is_not_taken() -> None:
    """Entry (0, 0) is the sparsest choice of both samples."""
    pattern = make_pattern(3, [(0, 0), (0, 1), (1, 0), (1, 1), (2, 2), (1, 2), (2, 1)], symmetric=False)
    large = np.array([[1.0, 1, 0], [1, 1, 1], [0, 1, -1]])
    small = np.array([[1e-6, 1, 0], [1, 1, 1], [0, 1, -1]])
    alone = pivot_by_markowitz(pattern, scale_samples(pattern, [values_of(pattern, large)]))
    both = pivot_by_markowitz(pattern, scale_samples(pattern, [values_of(pattern, m) for m in (large, small)]))
    assert (0, 0) in zip(alone.rows, alone.columns, strict=True)
    assert (0, 0) not in zip(both.rows, both.columns, strict=True)


def test_units_of_rows_and_columns_do_not_matter() -> None:
    """The samples are the same when they are scaled, but for rounding."""
    matrix, n = kkt_matrix(3, branches=2)
    units = np.where(np.arange(len(matrix)) < n, 2.0**-20, 2.0**10)
    pattern = pattern_of(matrix, symmetric=False)
    plain = pivot_by_markowitz(pattern, scale_samples(pattern, [values_of(pattern, matrix)]))
    scaled = pivot_by_markowitz(pattern, scale_samples(pattern, [values_of(pattern, units[:, np.newaxis] * matrix * units)]))
    assert (plain.rows, plain.columns) == (scaled.rows, scaled.columns)


def test_a_singular_sample_is_reported_with_its_dependent_row() -> None:
    matrix, n = kkt_matrix(4, branches=2)
    doubled = np.pad(matrix, (0, 1))
    doubled[-1], doubled[:, -1] = doubled[n], doubled[:, n]  # the first equation once more
    pattern = pattern_of(doubled, symmetric=False)
    with pytest.raises(SingularError, match=f"sample 0 is singular: rows {len(matrix)} depend on the others") as raised:
        plan_unsymmetric(pattern, [values_of(pattern, doubled)])
    assert raised.value.rows == (len(matrix),)


def test_the_singular_one_of_several_samples_is_named() -> None:
    pattern = make_pattern(3, [(i, j) for i in range(3) for j in range(3)], symmetric=False)
    regular = np.array([[2.0, 1, 0.5], [1, 3, 1], [0.5, 1, 4]])
    singular = regular.copy()
    singular[2] = 2 * singular[0] - singular[1]
    with pytest.raises(SingularError) as raised:
        pivot_by_markowitz(pattern, scale_samples(pattern, [values_of(pattern, m) for m in (regular, singular)]))
    assert raised.value.sample == 1
    assert len(raised.value.rows) == 1


@pytest.mark.parametrize("seed", range(4))
def test_rounding_in_place_of_zeros_does_not_scale(seed: int) -> None:
    """As where no direction of a mechanism is along an axis: the matrix is scaled as it is without that rounding."""
    matrix, n = kkt_matrix(seed, branches=3)
    matrix[:n, :n] *= 1e-5  # masses beside directions
    largest = np.minimum(np.abs(matrix).max(axis=1, keepdims=True), np.abs(matrix).max(axis=0))
    rounding = 1e-17 * largest * np.random.default_rng(seed).normal(size=matrix.shape)
    pattern = pattern_of(np.ones_like(matrix), symmetric=False)
    exact, rounded = (scale_samples(pattern, [values_of(pattern, m)])[0] for m in (matrix, np.where(matrix == 0, rounding, matrix)))
    np.testing.assert_allclose(rounded, exact, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_rounding_does_not_choose_the_rows_that_depend_on_others(seed: int) -> None:
    """Of rows that are equally large any could go; processors round in their own ways."""
    matrix = np.array([[1.0, 0, 1, 0], [0, 1, 0, 1], [1, 1, 1, 1], [1, -1, 1, -1]])
    noise = 1 + 1e-15 * np.random.default_rng(seed).normal(size=matrix.shape)
    assert dependent_rows(matrix * noise) == dependent_rows(matrix) == (2, 3)


def test_rounding_is_no_pivot() -> None:
    """A row that depends on others leaves rounding, and not zero."""
    random = np.random.default_rng(6)
    matrix = random.normal(size=(12, 12))
    matrix[7] = random.normal(size=11) @ np.delete(matrix, 7, axis=0)
    pattern = pattern_of(matrix, symmetric=False)
    for choose in CHOICES:
        with pytest.raises(SingularError) as raised:
            choose(pattern, scale_samples(pattern, [values_of(pattern, matrix)]))
        assert len(raised.value.rows) == 1


def test_a_row_of_zeros_depends_on_the_others() -> None:
    pattern = make_pattern(3, [(k, k) for k in range(3)], symmetric=False)
    with pytest.raises(SingularError) as raised:
        pivot_by_markowitz(pattern, scale_samples(pattern, [np.array([1.0, 0, 1])]))
    assert raised.value.rows == (1,)


def test_samples_that_need_different_pivots() -> None:
    """None of the four entries is usable in both samples, and each sample is regular."""
    pattern = make_pattern(2, [(i, j) for i in range(2) for j in range(2)], symmetric=False)
    samples = [np.array([1.0, 0, 0, 1]), np.array([0.0, 1, 1, 0])]
    with pytest.raises(NoPivotError, match="take samples that are less far apart"):
        pivot_by_markowitz(pattern, scale_samples(pattern, samples))


def test_a_weak_pivot_is_the_last_resort() -> None:
    """In each column another entry dominates in another sample; the best compromise is taken and its share recorded."""
    pattern = make_pattern(2, [(i, j) for i in range(2) for j in range(2)], symmetric=False)
    samples = [values_of(pattern, np.array(m)) for m in ([[1.0, -0.02], [0.02, 1]], [[0.03, -1], [1.0, 0.03]])]
    sequence = pivot_by_markowitz(pattern, scale_samples(pattern, samples))
    assert LAST_RESORT < sequence.threshold < THRESHOLD


def test_columns_come_in_the_given_order() -> None:
    matrix, _ = kkt_matrix(5, branches=2)
    pattern = pattern_of(matrix, symmetric=False)
    order = np.random.default_rng(1).permutation(len(matrix)).tolist()
    sequence = pivot_by_columns("mine", order, pattern, scale_samples(pattern, [values_of(pattern, matrix)]))
    assert sequence.columns == tuple(order)
    assert sequence.threshold >= THRESHOLD
