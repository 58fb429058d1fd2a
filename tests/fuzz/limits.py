"""Bounds on time and memory: no measures of speed, but what tells a hang."""

from __future__ import annotations

import faulthandler
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class HangError(BaseException):
    """Something did not end in time; no `except Exception` on the way swallows it."""


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Ends the block with a `HangError` after so many seconds on the clock; ends the process if even that does not get through."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise HangError(f"not done after {seconds:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    faulthandler.dump_traceback_later(2 * seconds + 30, exit=True)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, before)


@contextmanager
def at_most_bytes(size: int) -> Iterator[None]:
    """In the block, this process and those that it starts have no more address space than that."""
    before, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, hard))
