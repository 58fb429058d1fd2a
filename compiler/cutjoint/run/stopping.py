"""Signals that end a command, or a run before its end time; results written so far are kept."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Timer
from types import FrameType
from typing import Any

from cutjoint.package.system import signal_self


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a run; the message says when."""


class Terminated(SystemExit):
    """The signal ``number`` ended a run or a command; the message says when, or which signal it was."""

    def __init__(self, number: int, message: str = "") -> None:
        super().__init__(128 + number)
        self.number = number
        self.message = message or f"interrupted by {signal.Signals(number).name}"

    def __str__(self) -> str:
        return self.message


@dataclass(eq=False)
class StopRequest:
    """A signal that may have arrived, and a callback for it; stop requests of other threads are included."""

    number: int | None = None
    answer: Callable[[], None] | None = None
    others: "list[StopRequest]" = field(default_factory=list)

    def notify(self, number: int) -> None:
        """Record that the signal has arrived."""
        self.number = number
        if self.answer is not None:
            self.answer()
        for other in tuple(self.others):
            other.notify(number)

    def answer_by(self, answer: Callable[[], None]) -> None:
        """Call ``answer`` when a signal arrives, or at once if one has arrived."""
        self.answer = answer
        if self.number is not None:
            answer()

    def error(self, message: str) -> Interrupted | Terminated:
        """The error to raise for the signal."""
        assert self.number is not None
        return Interrupted(message) if self.number == signal.SIGINT else Terminated(self.number, message)


#: Seconds after which finalizers and callbacks have returned.
_SOON = 0.05


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated(number)


#: Python's own handling of these signals; where a program does otherwise that stays.
_USUAL = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
if hasattr(signal, "SIGHUP"):  # Windows has none
    _USUAL[signal.SIGHUP] = signal.SIG_DFL


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Context in which signals that would end the program raise `Terminated`, so that temporary files are removed."""
    with _resend_lost_signals(), _handled({s: usual for s, usual in _USUAL.items() if usual == signal.SIG_DFL}, _terminate):
        try:
            yield
        except RuntimeError as error:  # Python 3.11 wraps what a signal raises in __set_name__, as while modules are imported
            if isinstance(error.__cause__, KeyboardInterrupt | Terminated):
                raise error.__cause__ from None
            raise


@contextmanager
def _resend_lost_signals() -> Iterator[None]:
    """Context in which a signal is sent again if Python dropped its exception, as in a finalizer or a callback."""
    usual = sys.unraisablehook

    def hook(dropped: "sys.UnraisableHookArgs") -> None:
        error = dropped.exc_value
        if isinstance(error, Terminated | KeyboardInterrupt):
            number = error.number if isinstance(error, Terminated) else signal.SIGINT
            Timer(_SOON, signal_self, (number,)).start()
        else:
            usual(dropped)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = usual


@contextmanager
def stop_requests() -> Iterator[StopRequest]:
    """Context in which signals that would end the program become stop requests; a second one raises `KeyboardInterrupt`."""
    request = StopRequest()

    def handle(number: int, frame: FrameType | None) -> None:
        if request.number is not None:
            raise KeyboardInterrupt
        request.notify(number)

    usual = {s: _terminate if signal.getsignal(s) == _terminate else usual for s, usual in _USUAL.items()}
    with _handled(usual, handle) as handles, _registered(request, handles):
        yield request


#: The requests that the main thread handles, the latest one last.
_HANDLED: list[StopRequest] = []


@contextmanager
def _registered(request: StopRequest, handled: bool) -> Iterator[None]:
    """Context in which a request of another thread receives the signals of the one that is ``handled``."""
    above = None if handled or not _HANDLED else _HANDLED[-1]
    beside = above.others if above is not None else _HANDLED if handled else []
    beside.append(request)
    if above is not None and above.number is not None:
        request.notify(above.number)
    try:
        yield
    finally:
        beside.remove(request)


@contextmanager
def _handled(usual: Mapping[signal.Signals, Any], handle: Callable[[int, FrameType | None], None]) -> Iterator[bool]:
    """Handle by ``handle``, in the main thread, all signals with their ``usual`` handling; give whether there are any."""
    in_main = threading.current_thread() is threading.main_thread()
    taken = {s: found for s, found in usual.items() if in_main and signal.getsignal(s) == found}
    for s in taken:
        signal.signal(s, handle)
    try:
        yield bool(taken)
    finally:
        for s, found in taken.items():
            signal.signal(s, found)
