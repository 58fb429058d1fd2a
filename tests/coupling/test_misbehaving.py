"""An FMU that ends, crashes, hangs or prints as it likes: the run names it and the call, and keeps its rows."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.conftest import needs_cpp
from tests.fuzz import controllers

pytest.importorskip("fmpy")
pytestmark = needs_cpp

#: Deeds in a call, and the message about each.
CASES = (
    ("Instantiate", 1, "exit", "it cannot be instantiated: it ended its process with status 0"),
    ("Instantiate", 1, "trap", "it cannot be instantiated: it crashed with SIGSEGV"),
    ("EnterInitializationMode", 1, "abort", "it cannot begin: it crashed with SIGABRT"),
    ("ExitInitializationMode", 1, "fatal", "it cannot begin: "),
    ("GetReal", 1, "nan", "at 0 s its output 'force' is nan"),
    ("SetReal", 3, "quit", "inputs position, angle cannot be given: it ended its process with status 3"),
    ("DoStep", 3, "exit", "the step from 0.02 s failed: it ended its process with status 0"),
    ("DoStep", 7, "deep", "the step from 0.06 s failed: it crashed with SIGSEGV"),
    ("DoStep", 4, "loop", "the step from 0.03 s failed: no answer in 4 s; --call-limit gives it longer"),
    ("DoStep", 4, "codes", r"the step from 0.03 s failed: \x1b[31mred\x1b]0;owned\x07"),
    ("DoStep", 4, "huge", "the step from 0.03 s failed: xxx"),
    ("DoStep", 5, "discard", "the step from 0.04 s failed: "),
    ("DoStep", 5, "child", "the step from 0.04 s failed: "),
)


@pytest.mark.parametrize(("call", "number", "deed", "message"), CASES)
def test_what_it_does_is_reported_and_rows_are_kept(call: str, number: int, deed: str, message: str) -> None:
    (said,) = controllers.check(json.dumps({"call": call, "number": number, "deed": deed}), "4")
    assert said.startswith(message), said


@pytest.mark.parametrize(
    ("call", "deed", "words"),
    [
        ("Terminate", "exit", ("it ended its process with status 0",)), ("FreeInstance", "trap", ("it crashed with SIGSEGV",)),
        ("Terminate", "loop", ("no answer in 4 s",)), ("Terminate", "abort", ("it crashed with SIGABRT",)), ("DoStep", "flood", ()),
    ],
)  # fmt: skip
def test_what_changes_no_value_leaves_the_table_whole(call: str, deed: str, words: tuple[str, ...]) -> None:
    said = controllers.check(json.dumps({"call": call, "number": 1, "deed": deed}), "4")
    assert said == tuple(f"it cannot be terminated: {each}; the table is whole" for each in words)


def test_the_rows_up_to_then_are_named() -> None:
    with TemporaryDirectory() as name:
        done = controllers.call(Path(name), {"MISBEHAVE": "DoStep 3 exit"})
        assert done.returncode == 1
        assert "the rows up to then are in run.partial.csv" in done.stderr
        assert len((Path(name) / "run.partial.csv").read_text(encoding="utf-8").splitlines()) == 4  # a header, and 0, 10 and 20 ms
        assert not (Path(name) / "run.csv").exists()
