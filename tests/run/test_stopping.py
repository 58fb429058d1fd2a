"""Signals that end a command."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from cutjoint.run.stopping import Terminated, ended_by_signals, stop_requests
from tests.conftest import MODELS


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP], ids=lambda n: n.name)
def test_signals_raise_and_are_reported(number: signal.Signals) -> None:
    def work() -> None:
        os.kill(os.getpid(), number)
        time.sleep(10)

    with pytest.raises(Terminated) as stop, ended_by_signals():
        work()
    assert (stop.value.code, str(stop.value)) == (128 + number, f"interrupted by {number.name}")
    assert signal.getsignal(number) == signal.SIG_DFL


class Named:
    """An attribute during whose naming a signal comes, as while the dataclasses of a module are made."""

    def __set_name__(self, owner: type, name: str) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.001)


def test_signals_are_reported_where_python_wraps_what_they_raise() -> None:
    with pytest.raises(Terminated), ended_by_signals():
        type("Owner", (), {"attribute": Named()})


def test_what_is_ignored_stays_so() -> None:
    """As nohup has it."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals(), stop_requests() as request:
            os.kill(os.getpid(), signal.SIGHUP)
        assert request.number is None
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_run_within_a_command_is_asked_to_stop() -> None:
    with ended_by_signals():
        with stop_requests() as request:
            os.kill(os.getpid(), signal.SIGTERM)
        assert request.number == signal.SIGTERM
        with pytest.raises(Terminated):
            os.kill(os.getpid(), signal.SIGTERM)


class Finalised:
    """Something whose finalizer takes its time."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __del__(self) -> None:
        os.kill(os.getpid(), self.number)
        time.sleep(0.001)


#: Calls the program and sends it SIGINT when it begins to import a module.
_IMPORTING = """
import os, signal, sys
module = sys.argv.pop()
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Finder())
from cutjoint.entry import main
sys.argv[0] = "cutjoint"
main()
"""


@pytest.mark.parametrize("module", ["cutjoint.cli", "click", "cutjoint.commands.check", "numpy"])
def test_ctrl_c_while_modules_are_imported(module: str) -> None:
    command = [sys.executable, "-c", _IMPORTING, "check", str(MODELS / "pendulum.yaml"), module]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode in (130, -signal.SIGINT), done.stderr in ("", "interrupted\n")) == (True, True), done.stderr


@pytest.mark.parametrize(("number", "error"), [(signal.SIGTERM, Terminated), (signal.SIGINT, KeyboardInterrupt)])
def test_a_signal_within_a_finalizer_is_not_lost(number: int, error: type[BaseException]) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it

    def work() -> None:
        Finalised(number)
        time.sleep(10)

    try:
        with pytest.raises(error), ended_by_signals():
            work()
    finally:
        signal.signal(signal.SIGINT, before)


def test_requests_of_threads_come_with_that_of_the_main_thread() -> None:
    """Requests made before the signal come with it, and requests made after it."""
    answered, ready, go_on = [], threading.Event(), threading.Event()

    def work(place: int) -> int | None:
        with stop_requests() as request:
            request.answer_by(lambda: answered.append(place))
            ready.set()
            go_on.wait(10)
            return request.number

    with ended_by_signals(), stop_requests() as request, ThreadPoolExecutor(1) as pool:
        earlier = pool.submit(work, 1)
        ready.wait(10)
        os.kill(os.getpid(), signal.SIGTERM)
        assert request.number == signal.SIGTERM
        assert answered == [1]
        later = pool.submit(work, 2)
        go_on.set()
        assert (earlier.result(10), later.result(10)) == (signal.SIGTERM, signal.SIGTERM)
    assert answered == [1, 2]
    assert not request.others
