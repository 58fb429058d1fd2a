"""Work in other threads: its result, its errors, who listens, and that a program need not wait for it."""

from __future__ import annotations

import subprocess
import sys
from contextvars import ContextVar
from threading import Event, current_thread, main_thread

import pytest

from cutjoint.reduce.trials import begin

WORD: ContextVar[str] = ContextVar("word", default="")


def test_work_goes_on_beside_this_thread() -> None:
    begun, go = Event(), Event()

    def work() -> bool:
        begun.set()
        assert go.wait(10)
        return current_thread() is not main_thread()

    future = begin(work)
    assert begun.wait(10)
    assert not future.done()
    go.set()
    assert future.result(10)


def test_an_error_comes_with_the_result() -> None:
    future = begin(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        future.result(10)


def test_it_has_the_context_of_who_began_it() -> None:
    token = WORD.set("heard")
    try:
        assert begin(WORD.get).result(10) == "heard"
    finally:
        WORD.reset(token)


def test_a_program_ends_before_its_work() -> None:
    script = "from cutjoint.reduce.trials import begin; import time; begin(lambda: time.sleep(60)); print('ends')"
    ended = subprocess.run([sys.executable, "-c", script], timeout=30, check=True, capture_output=True, text=True)
    assert ended.stdout == "ends\n"
