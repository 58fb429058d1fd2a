"""The core's own dense kernels beside Eigen's."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from cutjoint.package.locations import runtime_folder
from tests.conftest import needs_cpp
from tests.physics.simulation import is_generated

pytestmark = needs_cpp


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory) -> list[list[str]]:
    """What the program prints, in `make full` with least squares and eigenvalues."""
    built = tmp_path_factory.mktemp("dense") / "compare"
    source = Path(__file__).with_name("dense.cpp")
    subprocess.run(
        ["g++", "-std=c++20", "-O1", "-Wall", "-Wextra", "-Werror", "-isystem", "/usr/include/eigen3", f"-I{runtime_folder() / 'include'}",
         *(("-DWHOLE",) if is_generated() else ()), str(source), "-o", str(built)],
        check=True,
    )  # fmt: skip
    done = subprocess.run([built], capture_output=True, text=True, check=True)
    return [line.split() for line in done.stdout.splitlines()]


def test_least_squares(lines: list[list[str]]) -> None:
    compared = [words[1:] for words in lines if words[0] == "squares"]
    assert len(compared) > 25
    for known, rank, difference in compared:
        assert rank == known
        assert float(difference) < 1e-11


def test_eigenvalues(lines: list[list[str]]) -> None:
    compared = [words[1:] for words in lines if words[0] == "eigenvalues"]
    assert len(compared) == 8
    for difference, rebuilt in compared:
        assert max(float(difference), float(rebuilt)) < 1e-13


def test_solutions_by_pivots(lines: list[list[str]]) -> None:
    """Matrices with nothing on their diagonal, which need other pivots; small ones may have no inverse."""
    compared = [words[1:] for words in lines if words[0] == "solution"]
    assert {broken for broken, _, _ in compared} == {"0", "1"}
    for broken, singular, left in compared:
        assert broken == singular
        assert float(left) < 1e-15


def test_complex_solutions(lines: list[list[str]]) -> None:
    """Entries stand in the same places; pivots are those of the diagonal from a thousandth of their column on: entries may grow so much."""
    compared = [words[1:] for words in lines if words[0] == "complex"]
    assert {broken for broken, _, _ in compared} == {"0", "1"}
    for broken, singular, left in compared:
        assert broken == singular
        assert float(left) < 1e-13
