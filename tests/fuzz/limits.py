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
def at_most(seconds: float, *, busy: bool = False) -> Iterator[None]:
    """Ends the block with a `HangError` after so many seconds on the clock, or if ``busy`` of this process's work, and the process if even
    that does not get through.
    """
    timer, number = (signal.ITIMER_PROF, signal.SIGPROF) if busy else (signal.ITIMER_REAL, signal.SIGALRM)

    def stop(_: int, frame: FrameType | None) -> None:
        raise HangError(f"not done after {seconds:g} s")

    before = signal.signal(number, stop)
    faulthandler.dump_traceback_later(20 * seconds + 300, exit=True)
    signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        signal.setitimer(timer, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(number, before)


@contextmanager
def at_most_bytes(size: int) -> Iterator[None]:
    """In the block, this process and those that it starts have no more address space than that."""
    before, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, hard))
