"""The bound on the instructions of a step of C99 code, beside what an emulated processor counts."""

from __future__ import annotations

from shutil import which

import pytest

from cutjoint_bench.studies.step_bound import CASES, PROCESSORS, compare
from tests.conftest import needs_cpp

pytestmark = [needs_cpp, pytest.mark.heavy]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("processor", PROCESSORS)
def test_no_step_takes_more_and_the_bound_is_at_most_half_above(processor: str, case: tuple[str, str | None, bool]) -> None:
    of = PROCESSORS[processor]
    if not (which(of.run[0]) and which(f"{of.prefix}gcc")):
        pytest.skip(f"needs {of.run[0]} and {of.prefix}gcc")
    for bound, count in compare(*case, processor):
        assert count <= bound <= 1.5 * count
