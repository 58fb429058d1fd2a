"""Signals that end a run before its end time: what it has written stays."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a run; the message says when."""


class Terminated(SystemExit):
    """The signal ``number`` ended a run; the message says when."""

    def __init__(self, number: int, message: str) -> None:
        super().__init__(128 + number)
        self.message = message

    def __str__(self) -> str:
        return self.message


@dataclass
class StopRequest:
    """Which signal has come, if any, and what is called then."""

    number: int | None = None
    answer: Callable[[], None] | None = None

    def answer_by(self, answer: Callable[[], None]) -> None:
        """Call ``answer`` when a signal comes; at once where one has come."""
        self.answer = answer
        if self.number is not None:
            answer()

    def error(self, message: str) -> Interrupted | Terminated:
        """What to raise for it."""
        assert self.number is not None
        return Interrupted(message) if self.number == signal.SIGINT else Terminated(self.number, message)


#: What Python does with these signals by itself; where a program does otherwise that stays.
_USUAL = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL, signal.SIGHUP: signal.SIG_DFL}


@contextmanager
def stop_requests() -> Iterator[StopRequest]:
    """While this lasts, a signal that would end the program is a request instead; a second one raises `KeyboardInterrupt`."""
    request = StopRequest()

    def handle(number: int, frame: FrameType | None) -> None:
        if request.number is not None:
            raise KeyboardInterrupt
        request.number = number
        if request.answer is not None:
            request.answer()

    in_main = threading.current_thread() is threading.main_thread()
    taken = {s: usual for s, usual in _USUAL.items() if in_main and signal.getsignal(s) == usual}
    for s in taken:
        signal.signal(s, handle)
    try:
        yield request
    finally:
        for s, usual in taken.items():
            signal.signal(s, usual)
