"""Folders on another processor: ARM, run by qemu."""

from __future__ import annotations

import subprocess
from pathlib import Path
from shutil import which

import pytest

from .folders import CXX, LIBRARIES, C, standalone_of, write

pytestmark = pytest.mark.skipif(
    which("qemu-aarch64") is None or which("aarch64-linux-gnu-g++") is None, reason="needs qemu-user and g++-aarch64-linux-gnu"
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "method", "rows"), [("four_bar", "recursive", 501), ("four_bar", "augmented", 501), ("press", "recursive-newton", 201)]
)
def test_a_run_is_the_same_to_the_last_bit(name: str, method: str, rows: int, tmp_path: Path) -> None:
    """Neither processor contracts products and sums; libraries have the same sines there."""
    place = write(standalone_of(name, method=method), tmp_path)
    tables = []
    for prefix, libraries, call in (("", LIBRARIES, ()), ("aarch64-linux-gnu-", ("-lm",), ("qemu-aarch64",))):
        subprocess.run([f"{prefix}g++", *CXX, "-ffp-contract=off", "-c", f"{name}.cpp", "-o", f"{name}.o"], cwd=place, check=True)
        made = [f"{prefix}gcc", *C, "-static", f"{name}_simulator.c", f"{name}.o", *libraries, "-o", "simulator"]
        subprocess.run(made, cwd=place, check=True)
        done = subprocess.run([*call, "./simulator", f"{name}.run"], cwd=place, check=True, capture_output=True, text=True)
        tables.append(done.stdout.splitlines())
    assert len(tables[0]) == 1 + rows
    assert tables[0] == tables[1]
