"""CPU seconds of each test with its processes: CPU_SECONDS=FILE pytest -p tests.cpu_seconds appends lines of seconds and test."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Append the test's line; what tests of a module share counts for the first of them."""
    before = sum(os.times()[:4])
    try:
        return (yield)
    finally:
        with open(os.environ["CPU_SECONDS"], "a", encoding="utf-8") as file:
            file.write(f"{sum(os.times()[:4]) - before:.3f} {item.nodeid}\n")
