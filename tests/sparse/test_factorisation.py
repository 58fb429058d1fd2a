"""Emitted factorisations, as straight-line code and as tables, against NumPy."""

from __future__ import annotations

import hashlib
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from cutjoint.emit.factorisation import STRAIGHT_LINE, emit_factorisation
from cutjoint.sparse.pattern import make_pattern
from cutjoint.sparse.plan import Plan, plan_definite, plan_unsymmetric
from tests.conftest import needs_cpp
from tests.hash_seeds import outputs
from tests.sparse.compiled import PAGE, Factorisation, emit, names
from tests.sparse.matrices import Array, kkt_matrix, nearby, pattern_of, spd_matrix, values_of

pytestmark = needs_cpp

FORMS = pytest.mark.parametrize("tables", [False, True], ids=["straight", "tables"])


def spd_plan(seed: int, branches: int = 2, nodes: int = 4) -> tuple[Plan, Array]:
    matrix = spd_matrix(seed, branches, nodes)
    return plan_definite(pattern_of(matrix, symmetric=True)), matrix


def kkt_plan(seed: int, branches: int = 2, nodes: int = 4) -> tuple[Plan, Array]:
    matrix, _ = kkt_matrix(seed, branches, nodes, massless=2)
    pattern = pattern_of(matrix, symmetric=False)
    return plan_unsymmetric(pattern, [values_of(pattern, m) for m in (matrix, *nearby(matrix, seed, 3))]), matrix


def check(factorisation: Factorisation, plan: Plan, matrix: Array) -> None:
    """Conditions are about 1e4, so that 1e-10 leaves two digits for the pivots."""
    right = np.random.default_rng(5).normal(size=len(matrix))
    expected = np.linalg.solve(matrix, right)
    assert factorisation.factor(values_of(plan.pattern, matrix)) == -1
    for _ in range(2):  # the factors stay as they are
        np.testing.assert_allclose(factorisation.solve(right), expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@FORMS
@pytest.mark.parametrize("seed", [1, 2])
def test_positive_definite_systems(seed: int, tables: bool, tmp_path: Path) -> None:
    plan, matrix = spd_plan(seed)
    factorisation = Factorisation(emit(plan, tables=tables), tmp_path)
    for one in (matrix, *nearby(matrix, seed, 2)):
        shift = max(0.0, 0.1 - np.linalg.eigvalsh(one).min())
        check(factorisation, plan, one + shift * np.eye(len(one)))


@FORMS
@pytest.mark.parametrize("seed", [1, 2])
def test_indefinite_systems(seed: int, tables: bool, tmp_path: Path) -> None:
    plan, matrix = kkt_plan(seed)
    factorisation = Factorisation(emit(plan, tables=tables), tmp_path)
    for one in (matrix, *nearby(matrix, seed + 10, 2)):
        check(factorisation, plan, one)


@FORMS
@pytest.mark.parametrize("size", [1, 3, 5])
def test_small_systems(size: int, tables: bool, tmp_path: Path) -> None:
    """Of one tile, of two, and without couplings."""
    random = np.random.default_rng(size)
    for number, matrix in enumerate((np.diag(random.uniform(1, 2, size)), random.normal(size=(size, size)))):
        pattern = pattern_of(matrix, symmetric=False)
        plan = plan_unsymmetric(pattern, [values_of(pattern, matrix)])
        folder = tmp_path / str(number)
        folder.mkdir()
        check(Factorisation(emit(plan, tables=tables), folder), plan, matrix)


@FORMS
def test_a_zero_diagonal_needs_pivots_off_it(tables: bool, tmp_path: Path) -> None:
    matrix = np.roll(np.diag([2.0, -3.0, 5.0, 7.0, 0.5, 1.5]), 1, axis=0)
    pattern = pattern_of(matrix, symmetric=False)
    plan = plan_unsymmetric(pattern, [values_of(pattern, matrix)])
    check(Factorisation(emit(plan, tables=tables), tmp_path), plan, matrix)


@FORMS
def test_a_pivot_that_is_not_positive_is_reported(tables: bool, tmp_path: Path) -> None:
    """The first pivot d_k = det_k / det_(k-1) of the permuted matrix, by its leading minors, that is not positive."""
    plan, matrix = spd_plan(3)
    factorisation = Factorisation(emit(plan, tables=tables), tmp_path)
    order = plan.tiling.elimination.rows
    for row in range(0, len(matrix), 5):
        bad = matrix.copy()
        bad[row, row] = -1.0
        permuted = bad[np.ix_(order, order)]
        signs = [np.linalg.slogdet(permuted[:k, :k])[0] for k in range(1, len(matrix) + 1)]
        assert factorisation.factor(values_of(plan.pattern, bad)) == order[signs.index(-1.0)]
    assert factorisation.factor(values_of(plan.pattern, matrix)) == -1


@FORMS
def test_a_pivot_of_zero_is_reported(tables: bool, tmp_path: Path) -> None:
    """A row of zeros stays one, and its pivot is the only one that vanishes unless columns run out."""
    plan, matrix = kkt_plan(3)
    factorisation = Factorisation(emit(plan, tables=tables), tmp_path)
    for row in range(0, len(matrix), 7):
        bad = matrix.copy()
        bad[row] = 0
        assert factorisation.factor(values_of(plan.pattern, bad)) == row


@FORMS
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_pivot_that_is_not_finite_is_reported(value: float, tables: bool, tmp_path: Path) -> None:
    """At the last pivot, so that nothing else can be wrong."""
    for number, (plan, matrix) in enumerate((spd_plan(3, 1, 3), kkt_plan(3, 1, 3))):
        folder = tmp_path / str(number)
        folder.mkdir()
        factorisation = Factorisation(emit(plan, tables=tables), folder)
        row, column = plan.tiling.elimination.rows[-1], plan.tiling.elimination.columns[-1]
        bad = matrix.copy()
        bad[row, column] = value
        pattern_has_it = (row, column) in set(plan.pattern.entries())
        assert factorisation.factor(values_of(plan.pattern, bad)) == (row if pattern_has_it else -1)


@pytest.mark.skipif(shutil.which("clang++") is None, reason="no clang++")
@FORMS
def test_clang_takes_it_too(tables: bool, tmp_path: Path) -> None:
    plan, matrix = kkt_plan(4, 1, 3)
    check(Factorisation(emit(plan, tables=tables), tmp_path, compiler="clang++"), plan, matrix)


def test_large_systems_become_tables() -> None:
    plan, _ = kkt_plan(1)
    below = PAGE.files(emit_factorisation(plan, names(plan), PAGE, straight_line=plan.multiply_adds))
    above = PAGE.files(emit_factorisation(plan, names(plan), PAGE, straight_line=plan.multiply_adds - 1))
    assert below == emit(plan, tables=False)
    assert above == emit(plan, tables=True)
    assert set(above) == {"factorisation.hpp", "factorisation.cpp"}
    assert plan.multiply_adds < STRAIGHT_LINE
    assert PAGE.files(emit_factorisation(plan, names(plan), PAGE)) == below


def test_functions_are_bounded() -> None:
    """A function has at most 400 statements, and 12 more lines a block."""
    plan, _ = kkt_plan(1, 4, 5)
    files = emit(plan, tables=False)
    parts = [text for name, text in files.items() if re.match(r"(factor|solve)_\d+\.cpp", name)]
    assert len(parts) > 5
    for text in parts:
        assert text.count("\nvoid ") == 1
        assert text.count(";\n") - text.count("next_block();") < 410


@FORMS
def test_every_row_is_named(tables: bool) -> None:
    for plan, _ in (spd_plan(1), kkt_plan(1)):
        files = emit(plan, tables=tables)
        comments = "\n".join(line.partition("//")[2] for text in files.values() for line in text.splitlines())
        for name in names(plan):
            assert re.search(rf"\b{re.escape(name)}\b", comments), name


def test_the_header_says_what_was_tried() -> None:
    plan, _ = kkt_plan(1)
    header = emit(plan, tables=True)["factorisation.hpp"]
    assert header.startswith("// Generated by cutjoint ")
    for trial in plan.trials:
        assert f"//   {trial.name}: {trial.multiply_adds} multiply-adds" in header
    assert f"inline constexpr int factors = {plan.storage.length};" in header


def digest() -> str:
    """Of all that is emitted."""
    files = [emit(plan, tables=tables) for plan in (spd_plan(1)[0], kkt_plan(1)[0]) for tables in (False, True)]
    return hashlib.sha256(repr(files).encode()).hexdigest()


def test_same_bytes_under_any_hash_seed() -> None:
    script = "from tests.sparse.test_factorisation import digest; print(digest())"
    assert set(outputs(script, "0", "12345")) == {digest()}


def test_a_definite_matrix_has_its_diagonal() -> None:
    with pytest.raises(ValueError, match="a definite matrix has no zeros on its diagonal"):
        plan_definite(make_pattern(2, [(0, 0), (0, 1)], symmetric=False))
