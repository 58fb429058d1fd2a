"""Solutions of systems that fall apart but for a border, beside those from which their right sides are made."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from cutjoint.package.locations import runtime_folder
from tests.conftest import needs_cpp

pytestmark = needs_cpp


@pytest.mark.parametrize("flags", [("-O1",), ("-O2", "-march=native")], ids=["two", "native"])
def test_solutions_of_bordered_systems(flags: tuple[str, ...], tmp_path: Path) -> None:
    """Random matrices of 33 rows have conditions up to 1e5; pivots of an earlier one may let entries grow by 1e3 more."""
    built, source = tmp_path / "compare", Path(__file__).with_name("bordered.cpp")
    warnings = ["-Wall", "-Wextra", "-Werror", "-Wno-psabi"]
    subprocess.run(["g++", "-std=c++20", *flags, *warnings, f"-I{runtime_folder() / 'include'}", source, "-o", built], check=True)
    systems, again, error = subprocess.run([built], capture_output=True, text=True, check=True).stdout.split()
    assert systems == "600"
    assert 0 < int(again) < 100
    assert float(error) < 1e-8
