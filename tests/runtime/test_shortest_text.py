"""Texts of numbers in tables, byte for byte beside those of the C++ library."""

import subprocess
from pathlib import Path

import pytest

from cutjoint.package.locations import runtime_folder
from tests.conftest import needs_cpp

pytestmark = needs_cpp


SANITIZED = ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.mark.parametrize("flags", [("-O2",), SANITIZED], ids=["plain", "sanitized"])
def test_texts_are_those_of_the_library(flags: tuple[str, ...], tmp_path: Path) -> None:
    built, source = tmp_path / "compare", Path(__file__).with_name("shortest_text.cpp")
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run(["g++", "-std=c++20", *flags, *warnings, f"-I{runtime_folder() / 'include'}", source, "-o", built], check=True)
    done = subprocess.run([built], capture_output=True, text=True, check=True)
    assert (done.stdout.split(), done.stderr) == (["600007", "0"], "")
