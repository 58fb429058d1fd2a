"""A running simulation in a browser: its host sends poses as datagrams, and a page follows them.

A datagram is, in little-endian order, the digest of the poses (64 bits), the time (s), and the table of poses as the C interface and
`Simulation.poses` have it, all doubles.  What comes is shown as soon as the page can; what is lost is not missed.
"""

import json
import socket
import struct
from collections.abc import Callable, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Condition, Thread

import numpy as np

from cutjoint.formulate.recursive.quantities import NUMBERS_PER_POSE, digest_of_poses, posed_elements
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError

#: Seconds between updates of a page, and between keep-alive messages.
_PAUSE, _LIFE = 1 / 60, 5.0


class Poses:
    """The last poses of the bodies of a model that came; ``report`` is called with each new kind of trouble."""

    def __init__(self, model: Model, report: Callable[[str], None]) -> None:
        self._bodies, names = len(model.bodies), posed_elements(model)
        self._digest, self._count = digest_of_poses(model.name, names), len(names)
        self._model, self._report, self._reported = model.name, report, set[str]()
        self._changed, self._number, self._text = Condition(), 0, ""

    def receive(self, datagram: bytes) -> bool:
        """Take a datagram; False where it is none of the model's."""
        trouble = self._fault_of(datagram)
        if not trouble:
            numbers = np.frombuffer(datagram, dtype="<f8", offset=8)
            poses = numbers[1:].reshape(self._count, NUMBERS_PER_POSE)[: self._bodies, :7]
            with self._changed:
                self._number, self._text = self._number + 1, json.dumps([numbers[0], *poses.tolist()], allow_nan=False)
                self._changed.notify_all()
        elif trouble not in self._reported:
            self._reported.add(trouble)
            self._report(trouble)
        return not trouble

    def _fault_of(self, datagram: bytes) -> str:
        whole = 16 + 8 * NUMBERS_PER_POSE * self._count
        if len(datagram) < 16 or struct.unpack_from("<Q", datagram)[0] != self._digest:
            return f"a datagram is none of '{self._model}': its digest is another; send those of a host that is compiled from this model"
        if len(datagram) != whole:
            return f"a datagram of '{self._model}' has {len(datagram)} bytes, not {whole}: a digest, the time and {self._count} poses"
        if not np.isfinite(np.frombuffer(datagram, dtype="<f8", offset=8)).all():
            return f"a datagram of '{self._model}' has a number that is not finite"
        return ""

    def wait(self, after: int) -> tuple[int, str]:
        """The number and the text of the last poses behind number ``after``, or of those before where none come in some seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > after, timeout=_LIFE)
            return self._number, self._text


class LiveView:
    """A page at ``http://localhost:port/`` that follows datagrams at the UDP port of the same number; 0 is any free one.

    Both are on this machine alone, unless it is open to others: then on all of its addresses. Raises RunError: the port is taken, or may
    not be had.
    """

    def __init__(self, model: Model, page: str, port: int, *, is_open: bool = False, report: Callable[[str], None]) -> None:
        address, self._poses = "" if is_open else "127.0.0.1", Poses(model, report)
        try:
            self._server = ThreadingHTTPServer((address, port), _handler(self._poses, page.encode(), is_open=is_open))
            self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self.port = self._server.server_address[1]
            self._line.bind((address, self.port))
        except OSError as error:
            raise RunError(f"--live {port}: {error.strerror}; name another port") from None
        self._server.daemon_threads = True

    def serve(self) -> None:
        """Show what comes until `close`, or an interrupt."""
        Thread(target=self._listen, daemon=True).start()
        self._server.serve_forever(poll_interval=0.1)

    def close(self) -> None:
        """End `serve`, from another thread."""
        self._server.shutdown()
        self._server.server_close()
        self._line.close()

    def _listen(self) -> None:
        while True:
            try:
                self._poses.receive(self._line.recv(65536))
            except OSError:
                return


def _handler(poses: Poses, page: bytes, *, is_open: bool) -> type[BaseHTTPRequestHandler]:
    """The answers to a browser: the page, and events with poses."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            name = self.headers.get("Host", "").rpartition(":")[0]
            if not is_open and name not in ("localhost", "127.0.0.1"):
                self.send_error(403)  # a foreign host name that resolves to this address
            elif self.path == "/":
                self._begin("text/html; charset=utf-8", ("Content-Length", str(len(page))))
                self.wfile.write(page)
            elif self.path == "/poses":
                self._begin("text/event-stream", ("Cache-Control", "no-store"))
                self._follow()
            else:
                self.send_error(404)

        def _begin(self, kind: str, *headers: Sequence[str]) -> None:
            self.send_response(200)
            for key, value in (("Content-Type", kind), *headers):
                self.send_header(key, value)
            self.end_headers()

        def _follow(self) -> None:
            last, pause = 0, Condition()
            try:
                while True:
                    number, text = poses.wait(last)
                    self.wfile.write(f"data: {text}\n\n".encode() if number > last else b": waiting\n\n")
                    last = number
                    with pause:
                        pause.wait(_PAUSE)
            except OSError:
                return  # the page was closed

        def log_message(self, format: str, *args: object) -> None:
            """Log nothing."""

    return Handler
