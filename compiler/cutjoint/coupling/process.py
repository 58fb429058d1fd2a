"""Calls of an FMU in a process of its own (`slave`), which may end, hang or print anything."""

import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

from cutjoint.model.text import printable
from cutjoint.package.errors import RunError
from cutjoint.toolchain.supervisor import end_session

_START = "from cutjoint.coupling.slave import main; main()"

#: Time limits, s: for a process to exit, and for Python to start on a busy machine.
_LEAVE, _BEGIN = 15.0, 120.0
#: Bytes of an FMU's output that are stored.
_KEPT = 300
#: The largest length of an answer, in characters.
_MOST = 1_000_000


class ControllerError(RunError):
    """An FMU refused a call, did not return from it, or could not take a step."""


class SlaveProcess:
    """The process of the FMU in a folder, with a time limit for each call.  It starts with the first call, and again after a timeout."""

    def __init__(self, path: Path, folder: Path, seconds: float) -> None:
        self._path, self._folder, self._seconds = path, folder, seconds
        self._process: subprocess.Popen[bytes] | None = None
        self._printed, self.fault = b"", ""

    def call(self, what: str, name: str, *arguments: Any) -> Any:
        """The result of a method of `Slave`; errors say that ``what`` did not work.
        Raises ControllerError: the FMU refused it, ended or crashed its process, or took too long."""
        try:
            if self._process is None:
                self._begin()
            found = self._ask(name, arguments)
        except BaseException as error:
            reason = self._reason(error)
            if not isinstance(error, OSError | ValueError):
                raise
            raise ControllerError(f"{self._path}: {what}: {reason}") from None
        if "error" in found:
            raise ControllerError(f"{self._path}: {what}: {printable(str(found['error']))}")
        return found.get("value")

    def close(self) -> None:
        """End the instance as the standard requires, also after a failed call; `fault` describes its errors."""
        if self._process is not None:
            self._connection.settimeout(min(self._seconds, _LEAVE))
            try:
                reason = printable(str(self._ask("close", ()).get("error", "")))
            except (OSError, ValueError) as error:
                reason = f"no answer in {min(self._seconds, _LEAVE):g} s" if isinstance(error, TimeoutError) else self._reason(error)
                self.kill()
            else:
                self._connection.settimeout(self._seconds)
            self.fault = f"{self._path}: it cannot be terminated: {reason}" if reason else self.fault

    def kill(self) -> int:
        """End the process and its children; returns its status."""
        process, self._process = self._process, None
        if process is None:
            return 0
        self._connection.close()
        self._lines.close()
        with suppress(subprocess.TimeoutExpired):  # one that has just ended itself has its own status
            process.wait(0.2)
        end_session(process.pid)
        status = process.wait()
        assert process.stdin is not None
        process.stdin.close()
        self._listener.join(2.0)
        return status

    def _begin(self) -> None:
        self._connection, theirs = socket.socketpair()
        self._connection.settimeout(_BEGIN)
        self._lines, self._printed = self._connection.makefile("r", encoding="utf-8"), b""
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        with theirs:
            command = [sys.executable, "-P", "-c", _START, str(theirs.fileno()), str(self._folder)]
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment,
                pass_fds=[theirs.fileno()], start_new_session=True,
            )  # fmt: skip
        self._listener = Thread(target=self._listen, args=(self._process.stderr,), daemon=True)
        self._listener.start()
        self._receive()
        self._connection.settimeout(self._seconds)

    def _listen(self, printed: Any) -> None:
        """Store the end of the FMU's output."""
        with printed:
            while some := printed.read1():
                self._printed = (self._printed + some)[-_KEPT:]

    def _ask(self, name: str, arguments: tuple[Any, ...]) -> dict[str, Any]:
        """The answer of the process; raises OSError or ValueError if there is none."""
        self._connection.sendall((json.dumps([name, *arguments]) + "\n").encode())
        return self._receive()

    def _receive(self) -> dict[str, Any]:
        line = self._lines.readline(_MOST)
        if not line:
            raise ConnectionResetError
        found = json.loads(line)
        if not isinstance(found, dict):
            raise ValueError
        return found

    def _reason(self, error: BaseException) -> str:
        """The reason that there is no answer; the process is ended."""
        status = self.kill()
        if isinstance(error, TimeoutError):
            return f"no answer in {self._seconds:g} s; --call-limit gives it longer"
        ended = f"it crashed with {signal.Signals(-status).name}" if status < 0 else f"it ended its process with status {status}"
        last = printable(self._printed.decode(errors="replace").strip().rpartition("\n")[2])
        return f"{ended}{f'; it printed last: {last}' if last else ''}"
