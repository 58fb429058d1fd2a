"""The simulators that interpret programs, which inputs of many kinds need."""

from __future__ import annotations

from functools import cache

from cutjoint.toolchain.build import build_interpreter
from cutjoint.toolchain.drivers import DRIVERS


@cache
def build_interpreters() -> None:
    """Build them, as far as they are not in the cache: no input's time goes into that."""
    for driver in DRIVERS:
        build_interpreter(driver)
