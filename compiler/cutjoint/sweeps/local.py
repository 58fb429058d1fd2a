"""Workers of a sweep: the threads of this process.  The libraries' code runs beside Python's."""

from __future__ import annotations

import os
from concurrent.futures import Future, ThreadPoolExecutor
from queue import Empty, Queue
from typing import Protocol

from cutjoint.sweeps.work import Chunk, Rows, Work


class Workers(Protocol):
    """Workers that perform chunks, several at a time."""

    @property
    def number(self) -> int:
        """The number of chunks that are performed at a time."""

    def submit(self, chunk: Chunk) -> None:
        """Begin to perform a chunk."""

    def take(self, seconds: float) -> Rows | None:
        """The rows of a chunk that is done, None if there is none in this time; what went wrong with one is raised."""

    def close(self) -> None:
        """Begin no more chunks."""


def processors() -> int:
    """The number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


class Threads:
    """Threads of this process."""

    def __init__(self, work: Work, number: int) -> None:
        self.number = number
        self._work, self._done = work, Queue[Future[Rows]]()
        self._pool = ThreadPoolExecutor(number)

    def submit(self, chunk: Chunk) -> None:
        """Begin to perform a chunk."""
        self._pool.submit(self._work.perform, chunk).add_done_callback(self._done.put)

    def take(self, seconds: float) -> Rows | None:
        """The rows of a chunk that is done, None if there is none in this time."""
        try:
            return self._done.get(timeout=seconds).result()
        except Empty:
            return None

    def close(self) -> None:
        """Begin no more chunks, and wait for those that were begun."""
        self._pool.shutdown(cancel_futures=True)
