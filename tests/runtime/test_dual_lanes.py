"""Numbers with derivatives beside differences, by registers of two numbers and by those of this processor."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from cutjoint.package.locations import runtime_folder
from tests.conftest import needs_cpp

pytestmark = needs_cpp


@pytest.mark.parametrize("flags", [(), ("-march=native",)], ids=["two", "native"])
def test_slopes_are_those_of_differences(flags: tuple[str, ...], tmp_path: Path) -> None:
    """Differences of fourth order over steps of 1e-5 leave 1e-13; values are off by 4 units in the last place."""
    built, source = tmp_path / "compare", Path(__file__).with_name("dual_lanes.cpp")
    warnings = ["-Wall", "-Wextra", "-Werror", "-Wno-psabi"]
    subprocess.run(["g++", "-std=c++20", "-O1", *flags, *warnings, f"-I{runtime_folder() / 'include'}", source, "-o", built], check=True)
    value, slope = map(float, subprocess.run([built], capture_output=True, text=True, check=True).stdout.split())
    assert value < 1e-15
    assert slope < 1e-12
