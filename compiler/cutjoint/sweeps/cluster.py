"""Workers of a sweep: those of a Dask cluster, by the address of its scheduler.

A plugin brings the libraries to each worker, once, also to those that come later.  A chunk that was on a worker that died is performed
on another one; rows follow from values alone, so that it does not matter how often.
"""

import asyncio
import pickle
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from hashlib import sha256
from queue import Empty, Queue
from threading import Thread
from time import monotonic
from typing import Any

from cutjoint.package.errors import RunError
from cutjoint.package.extensions import find_package
from cutjoint.package.locations import __version__
from cutjoint.sweeps.kernel import require_loadable
from cutjoint.sweeps.work import Chunk, Rows, Work

#: Timeout for an answer, s.  The look-up of a name cannot be interrupted and may take as long again.
_PATIENCE = 4.0

#: The form of addresses of Dask schedulers.
_ADDRESS = re.compile(r"(?:tcp|tls|ucx|ws|wss)://(?P<host>[\w.-]+|\[[0-9a-fA-F:.]+\]):(?P<port>[0-9]{1,5})", re.ASCII)
#: Timeout for finding a scheduler, s.
_WAIT = 10
#: Timeout for cancelling tasks at the end, s.
_LEAVE = 2
#: Interval for asking the scheduler for its workers, s.
_OFTEN = 1.0
#: Timers of Dask's workers, fifty or a hundred times a second, for its dashboard: the profile of tasks, which ends at the call of a
#: library, and the delays of the event loop.  They are stopped in a worker while it has a sweep.
_TIMERS = "profile", "tick"


def dask() -> Any:
    """Dask's `distributed`. Raises RunError: it is not installed."""
    return find_package("distributed", otherwise=RunError("--scheduler needs Dask: pip install 'cutjoint[dask]'"))


def require_address(address: str) -> tuple[str, int]:
    """Check the form of a scheduler's address; its host and port. Raises RunError: it is none."""
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) <= 65_535:
        raise RunError(f"--scheduler {address[:60]!a}: not an address; write for example tcp://10.0.0.1:8786")
    return found["host"].strip("[]"), int(found["port"])


def require_scheduler(address: str) -> None:
    """Check that a scheduler answers at an address.

    The question goes from a thread of its own: whatever it meets there, it does not outlive the command. Raises RunError: none does, and it
    says what is there instead; or Dask is not installed.
    """
    host, port = require_address(address)
    answers: Queue[Any] = Queue()
    Thread(target=_ask, args=(dask(), address, host, port, answers), daemon=True).start()
    try:
        answer = answers.get(timeout=2 * _PATIENCE)
    except Empty:
        answer = TimeoutError()
    kind = answer.get("type") if isinstance(answer, dict) else None
    if kind != "Scheduler":
        reason = _describe(answer) if kind is None else f"a {str(kind)[:20].lower()} of Dask is there"
        raise RunError(f"--scheduler {address}: no scheduler answers: {reason}; start one with `dask scheduler`, and write its address")


def _ask(distributed: Any, address: str, host: str, port: int, answers: Queue[Any]) -> None:
    """Put the answer or the error into a queue; servers other than Dask cause errors of all kinds."""
    try:
        socket.getaddrinfo(host, port)
        answers.put(asyncio.run(asyncio.wait_for(_identify(distributed, address), _PATIENCE)))
    except BaseException as error:
        answers.put(error)


async def _identify(distributed: Any, address: str) -> Any:
    """The answer of a Dask server about itself."""
    connection = distributed.Security().get_connection_args("client")
    comm = await distributed.comm.connect(address, timeout=_PATIENCE / 2, **connection)
    try:
        await comm.write({"op": "identity", "reply": True})
        return await comm.read()
    finally:
        comm.abort()


def _describe(answer: Any) -> str:
    if isinstance(answer, socket.gaierror):
        return f"the host's name is not known ({answer.strerror})"
    causes = list(_causes(answer))
    if reason := next((cause.strerror for cause in causes if isinstance(cause, OSError) and cause.strerror), ""):
        return reason
    if any(isinstance(cause, TimeoutError) for cause in causes):
        return f"no answer in {_PATIENCE:g} s"
    said = " ".join(str(answer).split())[:160]
    if isinstance(answer, TypeError | ImportError):
        return f"Dask has not what this kind of address needs ({said})"
    return f"what is there speaks another protocol ({type(answer).__name__}{f': {said}' if said else ''})"


def _causes(answer: Any) -> Iterator[BaseException]:
    while isinstance(answer, BaseException):
        yield answer
        answer = answer.__cause__


#: In each worker: its work by digest.
_works: dict[str, Work] = {}


class WorkPlugin:
    """Brings work to a worker, and stops timers there: Dask calls ``setup`` on each, and ``teardown`` at the end of the sweep."""

    idempotent = False

    def __init__(self, key: str, work: Work, name: str) -> None:
        self.name = name
        self._key, self._work = key, work
        self._stopped: dict[str, Any] = {}

    def setup(self, worker: Any) -> None:
        """Store the work by its digest.  A worker starts its timers after this, so that unwanted ones are removed here."""
        _works[self._key] = self._work
        self._stopped = {name: worker.periodic_callbacks.pop(name) for name in _TIMERS if name in worker.periodic_callbacks}
        for timer in self._stopped.values():
            timer.stop()

    def teardown(self, worker: Any) -> None:
        """Restart the timers.  The work stays, since another sweep may have the same."""
        worker.periodic_callbacks.update(self._stopped)
        for timer in self._stopped.values():
            timer.start()


def find_fault(key: str, version: str) -> str:
    """The reason that this worker cannot perform the work of a client of that version; "" if it can."""
    if version != __version__:
        return f"it has cutjoint {__version__}, not {version}; install the same version"
    return "it lacks the libraries" if key not in _works else require_loadable(_works[key].kernels)


def perform(key: str, version: str, chunk: Chunk) -> Rows | str:
    """The rows of a chunk, or the reason that this worker cannot compute them."""
    return find_fault(key, version) or _works[key].perform(chunk)


class Cluster:
    """The workers of a Dask cluster; ``note`` is called with each refused worker.
    Raises RunError: Dask is not installed, there is no scheduler at the address, or none of its workers can run the libraries."""

    def __init__(self, work: Work, address: str, note: Callable[[str], None]) -> None:
        self._dask, self._address, self._note = dask(), address, note
        self._key = sha256("".join(kernel.digest for kernel in work.kernels).encode() + pickle.dumps(work.tasks)).hexdigest()
        self._done: Queue[Any] = Queue()
        self._chunks: dict[Any, tuple[Chunk, frozenset[str]]] = {}
        self._refused: dict[str, str] = {}
        self._fit: set[str] = set()
        self._present: dict[str, int] = {}
        self._next_poll = 0.0
        try:
            self._client = self._dask.Client(address, timeout=_WAIT, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise RunError(f"--scheduler {address}: no scheduler answers: {error}; start one with `dask scheduler`") from None
        self._plugin = f"cutjoint-{self._key[:16]}-{self._client.id}"
        try:
            with suppress(Exception):  # errors of a worker are found below, with its name
                plugin = type("SweepPlugin", (WorkPlugin, self._dask.WorkerPlugin), {})
                self._client.register_plugin(plugin(self._key, work, self._plugin))
            self._client.wait_for_workers(1, timeout=_WAIT)
            self._poll()
        except TimeoutError:
            self.close()
            raise RunError(f"--scheduler {address}: it has no workers; start some with `dask worker {address}`") from None
        except BaseException:
            self.close()
            raise

    @property
    def number(self) -> int:
        """The number of chunks that run at the same time."""
        return max(1, sum(number for worker, number in self._present.items() if worker in self._fit))

    @property
    def dashboard(self) -> str:
        """The address of Dask's dashboard."""
        return str(self._client.dashboard_link)

    def submit(self, chunk: Chunk) -> None:
        """Begin to perform a chunk."""
        allowed = frozenset(self._fit) if self._refused else frozenset()
        future = self._client.submit(perform, self._key, __version__, chunk, workers=list(allowed) or None, pure=False)
        self._chunks[future.key] = (chunk, allowed)
        future.add_done_callback(self._done.put)

    def take(self, seconds: float) -> Rows | None:
        """The rows of a chunk that is done, None if there is none in this time.
        Raises RunError: the scheduler has gone, or workers died of a chunk."""
        if monotonic() >= self._next_poll:
            self._poll()
        try:
            future = self._done.get(timeout=seconds)
        except Empty:
            return None
        chunk, _ = self._chunks.pop(future.key)
        try:
            rows = future.result(timeout=60)
        except self._dask.KilledWorker:
            runs = f"runs {chunk.first} to {chunk.first + len(chunk.values) - 1}"
            raise RunError(f"{runs}: several workers died of them, one after the other; their logs may say why") from None
        except (CancelledError, OSError, TimeoutError):
            raise RunError(f"--scheduler {self._address}: the scheduler has gone") from None
        if isinstance(rows, str):
            for worker in next(iter(self._client.who_has([future]).values()), ()):
                self._refuse(worker, rows)
            self._require_fit()
            self.submit(chunk)
            return None
        assert isinstance(rows, Rows)
        return rows

    def close(self) -> None:
        """Disconnect from the cluster."""
        with suppress(Exception):  # the scheduler may be gone
            self._client.sync(self._client.scheduler.unregister_worker_plugin, name=self._plugin, callback_timeout=_LEAVE)
        self._client.close(timeout=_LEAVE)

    def _check_workers(self, workers: set[str]) -> None:
        """Find out which of new workers can run the libraries. Raises RunError: none can."""
        found = self._client.run(find_fault, self._key, __version__, workers=sorted(workers), on_error="return")
        for worker, fault in found.items():
            if said := str(fault):  # the message of an exception
                self._refuse(worker, said)
            else:
                self._fit.add(worker)
        self._require_fit()

    def _refuse(self, worker: str, why: str) -> None:
        self._fit.discard(worker)
        if worker not in self._refused:
            self._refused[worker] = why
            self._note(f"worker {self._name(worker)} is refused: {why}")

    def _require_fit(self) -> None:
        if self._fit:
            return
        refused = "; ".join(f"{self._name(worker)}: {why}" for worker, why in self._refused.items())
        advice = "flags in the study, such as -O3 -march=x86-64-v2, build for other processors"
        raise RunError(f"--scheduler {self._address}: no worker can run the study: {refused}; {advice}")

    def _name(self, worker: str) -> str:
        known = self._client.scheduler_info(n_workers=-1)["workers"].get(worker, {})
        name = str(known.get("name", worker))
        return worker if name == worker else f"'{name}' ({worker})"

    def _poll(self) -> None:
        """See whether the scheduler is there; judge new workers, and have chunks performed anew whose workers have all gone."""
        try:
            self._present = dict(self._client.nthreads())
        except (OSError, TimeoutError, CancelledError):
            raise RunError(f"--scheduler {self._address}: the scheduler has gone") from None
        if new := self._present.keys() - self._fit - self._refused.keys():
            self._check_workers(new)
        lost = [(key, chunk) for key, (chunk, allowed) in self._chunks.items() if allowed and not allowed & self._present.keys()]
        for key, chunk in lost:
            del self._chunks[key]
            self.submit(chunk)
        self._next_poll = monotonic() + _OFTEN
