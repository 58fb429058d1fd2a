"""Addresses at which no scheduler of Dask answers: refused, silent, other servers, other protocols."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import pytest
from click.testing import CliRunner
from distributed import LocalCluster

from cutjoint.cli import main
from cutjoint.package.errors import RunError
from cutjoint.sweeps import cluster as module

from .studies import study

#: Says something on a connection, or nothing.
Speaker = Callable[[socket.socket], None]


def _http(connection: socket.socket) -> None:
    connection.recv(4096)
    connection.sendall(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")


def _tls(connection: socket.socket) -> None:
    """The alert of a TLS server to a client that speaks plainly."""
    connection.recv(4096)
    connection.sendall(b"\x15\x03\x03\x00\x02\x02\x46")


def _read(connection: socket.socket) -> None:
    while connection.recv(4096):
        pass


SPEAKERS: dict[str, tuple[Speaker, str]] = {
    "closing": (lambda connection: None, "Connection reset by peer|another protocol|closed"),
    "http": (_http, "another protocol"),
    "tls": (_tls, "another protocol|Connection reset by peer"),
    "greeting": (lambda c: c.sendall(b"SSH-2.0-OpenSSH_9.2\r\n"), "another protocol|Connection reset by peer"),
    "garbage": (lambda c: c.sendall(os.urandom(5000)), "another protocol|Connection reset by peer"),
    "zeros": (lambda c: c.sendall(bytes(5000)), "another protocol|Connection reset by peer"),
    "silent": (_read, "no answer in 0.5 s"),
}


@contextmanager
def _server(speak: Speaker) -> Iterator[int]:
    """A server on loopback; its port."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        ended = Event()

        def serve() -> None:
            with suppress(OSError):
                while not ended.is_set():
                    Thread(target=answer, args=(listening.accept()[0],), daemon=True).start()

        def answer(connection: socket.socket) -> None:
            with connection, suppress(OSError):
                speak(connection)

        Thread(target=serve, daemon=True).start()
        yield listening.getsockname()[1]
        ended.set()


def _refused(address: str, reason: str) -> None:
    with pytest.raises(RunError, match=f"--scheduler {address}: no scheduler answers: .*({reason}).*; start one with `dask scheduler`"):
        module.require_scheduler(address)


@pytest.mark.parametrize("name", SPEAKERS)
def test_what_answers_is_no_scheduler(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    speak, reason = SPEAKERS[name]
    monkeypatch.setattr(module, "_PATIENCE", 0.5 if name == "silent" else 20.0)
    with _server(speak) as port:
        _refused(f"tcp://127.0.0.1:{port}", reason)


@pytest.mark.parametrize("scheme", ["tls", "wss", "ucx"])
def test_other_protocols_are_reported(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_PATIENCE", 20.0)
    with _server(_http) as port:
        _refused(f"{scheme}://127.0.0.1:{port}", "Dask has not what this kind of address needs|SSL|another protocol")


def test_nothing_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_PATIENCE", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
    _refused(f"tcp://127.0.0.1:{port}", "Connection refused|no answer in")
    _refused("tcp://no-such-host.invalid:8786", "the host's name is not known")


_ODD = ["http://127.0.0.1:8786", "127.0.0.1:8786", "tcp://127.0.0.1:0", "tcp://127.0.0.1:65536", "tcp://a b:1", "tcp://:1"]


@pytest.mark.parametrize("address", _ODD)
def test_what_is_no_address(address: str) -> None:
    with pytest.raises(RunError, match="not an address; write for example tcp://"):
        module.require_scheduler(address)


def test_the_wait_is_bounded() -> None:
    """The longest of all is within the ten seconds that are promised."""
    assert 2 * module._PATIENCE < 10


def test_a_scheduler_passes_and_a_worker_does_not() -> None:
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:
        module.require_scheduler(cluster.scheduler_address)
        (worker,) = cluster.scheduler_info["workers"]
        _refused(worker, "a worker of Dask is there")


def test_the_command_ends_with_a_message(tmp_path: Path) -> None:
    """Before anything is compiled."""
    with _server(_http) as port:
        words = ["sweep", str(study(tmp_path)), "--out", str(tmp_path / "out.parquet"), "--scheduler", f"tcp://127.0.0.1:{port}"]
        done = CliRunner().invoke(main, words)
    assert done.exit_code == 1
    assert "no scheduler answers" in done.output.replace("\n", " ")
    assert not (tmp_path / "out.parquet.parts").exists()
