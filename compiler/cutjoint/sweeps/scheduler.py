"""Checks the address of a Dask scheduler before anything is compiled for it."""

import asyncio
import re
import socket
from collections.abc import Iterator
from queue import Empty, Queue
from threading import Thread
from typing import Any

from cutjoint.package.errors import RunError

#: Timeout for an answer, s.  The look-up of a name cannot be interrupted and may take as long again.
_PATIENCE = 4.0

#: The largest port number.
_PORTS = 65_535

#: The form of addresses of Dask schedulers.
_ADDRESS = re.compile(r"(?:tcp|tls|ucx|ws|wss)://(?P<host>[\w.-]+|\[[0-9a-fA-F:.]+\]):(?P<port>[0-9]{1,5})", re.ASCII)


def dask() -> Any:
    """Dask's `distributed`.

    Raises:
        RunError: it is not installed.
    """
    try:
        import distributed
    except ImportError:
        raise RunError("--scheduler needs Dask: pip install 'cutjoint[dask]'") from None
    return distributed


def require_address(address: str) -> tuple[str, int]:
    """Check the form of a scheduler's address; its host and port.

    Raises:
        RunError: it is none.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) <= _PORTS:
        raise RunError(f"--scheduler {address[:60]!a}: not an address; write for example tcp://10.0.0.1:8786")
    return found["host"].strip("[]"), int(found["port"])


def require_scheduler(address: str) -> None:
    """Check that a scheduler answers at an address.

    The question goes from a thread of its own: whatever it meets there, it does not outlive the command.

    Raises:
        RunError: none does, and it says what is there instead; or Dask is not installed.
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
    """The reason that there was no answer, in words."""
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
    """An error and its causes."""
    while isinstance(answer, BaseException):
        yield answer
        answer = answer.__cause__
