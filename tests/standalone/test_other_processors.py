"""The same code on another processor: ARM, run by qemu."""

from __future__ import annotations

import subprocess
from pathlib import Path
from shutil import which

import pytest

from tests.conftest import MODELS

from .folders import CXX, LIBRARIES, C, folder_of, write

pytestmark = pytest.mark.skipif(
    which("qemu-aarch64") is None or which("aarch64-linux-gnu-g++") is None, reason="needs qemu-user and g++-aarch64-linux-gnu"
)  # fmt: skip


def test_a_run_is_the_same_to_the_last_bit(tmp_path: Path) -> None:
    """Neither processor contracts products and sums; libraries have the same sines there."""
    place = write(folder_of((MODELS / "four_bar.yaml").read_text(encoding="utf-8"), "four_bar.yaml"), tmp_path)
    tables = []
    for prefix, libraries, call in (("", LIBRARIES, ()), ("aarch64-linux-gnu-", ("-lm",), ("qemu-aarch64",))):
        subprocess.run([f"{prefix}g++", *CXX, "-ffp-contract=off", "-c", "four_bar.cpp", "-o", "four_bar.o"], cwd=place, check=True)
        made = [f"{prefix}gcc", *C, "-static", "four_bar_simulator.c", "four_bar.o", *libraries, "-o", "simulator"]
        subprocess.run(made, cwd=place, check=True)
        done = subprocess.run([*call, "./simulator", "four_bar.run"], cwd=place, check=True, capture_output=True, text=True)
        tables.append(done.stdout.splitlines())
    assert len(tables[0]) == 502
    assert tables[0] == tables[1]
