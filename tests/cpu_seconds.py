"""CPU seconds of each test with its processes: CPU_SECONDS=FILE pytest -p tests.cpu_seconds appends lines of these, seconds on the clock,
the worker of pytest-xdist, and the test."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import pytest


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Append the test's line; what tests of a module share counts for the first of them."""
    before, begun = sum(os.times()[:4]), time.perf_counter()
    try:
        return (yield)
    finally:
        used, passed, worker = sum(os.times()[:4]) - before, time.perf_counter() - begun, os.environ.get("PYTEST_XDIST_WORKER", "main")
        with open(os.environ["CPU_SECONDS"], "a", encoding="utf-8") as file:
            file.write(f"{used:.3f} {passed:.3f} {worker} {item.nodeid}\n")
