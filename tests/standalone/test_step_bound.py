"""The bound on the instructions of a step of C99 code, beside what an emulated processor counts."""

from __future__ import annotations

from shutil import which

import pytest

from cutjoint_bench.studies.step_bound import CASES, PREFIX, compare
from tests.conftest import needs_cpp

pytestmark = [
    needs_cpp, pytest.mark.heavy,
    pytest.mark.skipif(not (which("qemu-aarch64") and which(f"{PREFIX}gcc")), reason="needs qemu-user and gcc-aarch64-linux-gnu"),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_no_step_takes_more_and_the_bound_is_at_most_half_above(case: tuple[str, str | None, bool]) -> None:
    for bound, count in compare(*case):
        assert count <= bound <= 1.5 * count
