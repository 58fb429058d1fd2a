"""Work in another thread, while this one derives equations or waits for a simulator or a compiler."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from contextvars import copy_context
from threading import RLock, Thread
from typing import TypeVar

Result = TypeVar("Result")

#: Held by a thread that derives equations: SymPy is not made for several.
DERIVING = RLock()


def begin(work: Callable[[], Result]) -> Future[Result]:
    """Begin some work.  Nobody waits for it when the program ends, by Ctrl-C or otherwise."""
    future: Future[Result] = Future()
    context = copy_context()  # who listens to the compiler

    def perform() -> None:
        try:
            future.set_result(context.run(work))
        except BaseException as error:
            future.set_exception(error)

    Thread(target=perform, daemon=True).start()
    return future
