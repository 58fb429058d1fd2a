"""Runs a simulator binary."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from threading import Timer
from typing import Any

from cutjoint.package.errors import CutjointError
from cutjoint.package.system import number_for_child, passing, path_for_child
from cutjoint.run.result_files import write_all
from cutjoint.run.results import FailureReport
from cutjoint.run.stopping import StopRequest, stop_requests

#: Called with the completed share of a run, 0 to 1.
Progress = Callable[[float], None]

#: Called once a run has taken ten seconds, with its partial summary and the ``time`` (s); an exception ends the run.
Slow = Callable[[Mapping[str, Any]], None]

_SLOW: ContextVar[Slow | None] = ContextVar("slow", default=None)


class SimulatorError(CutjointError, RuntimeError):
    """The simulator could not start, or its output is no summary."""


@contextmanager
def watched(slow: Slow) -> Iterator[None]:
    """Tell of the first run that takes long."""
    token = _SLOW.set(slow)
    try:
        yield
    finally:
        _SLOW.reset(token)


def call_simulator(
    binary: Path, run_file: Mapping[str, Any], progress: Progress | None = None, seconds: float | None = None,
    description: Mapping[str, Any] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Run a simulator on a run file and return its summary; it has ended when this returns or raises, also where ``progress`` raises.

    One that interprets models is given the ``description`` of its model.

    It ends too when this process is killed: then its standard input ends.  After ``seconds``, if given, it is killed.

    Raises:
        SimulatorError: it could not begin, could not write a file, wrote no summary, or took too long; the summary of a run that fails
            numerically says so.
        Interrupted, Terminated: a signal has ended the run.
    """
    # files without names: nothing of them stays if this process is killed.  What a simulator complains of goes into a file, since a pipe
    # that nobody reads would hold it up
    with tempfile.TemporaryFile(buffering=0) as file, tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as complaint:
        try:
            model = {} if description is None else {"model": description}
            write_all(file, json.dumps({**run_file, **model, "ends_with_stdin": True}).encode())
            file.seek(0)
        except OSError as error:
            raise SimulatorError(f"cannot write the run file in {tempfile.gettempdir()}: {error.strerror}") from None
        number = number_for_child(file)
        open_files = [number, *(place["descriptor"] for place in run_file.values() if isinstance(place, Mapping) and "descriptor" in place)]
        command = [str(binary), path_for_child(number)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": complaint, **passing(open_files)}
        # from before the simulator begins: what it writes first may be what somebody waits for with a signal
        begun = partial(_begin, command, **pipes, encoding="utf-8", errors="replace")
        with stop_requests() as request, begun() as process, _killed_after(seconds, process):
            status, summary = _follow(process, request, progress)
        if request.number is not None:
            raise request.error(_when(summary))
        complaint.seek(0)
        if status not in (0, 1) or not summary:
            raise SimulatorError(complaint.read().strip().removeprefix("error: ") or f"the simulator ended with status {status}")
    if summary["status"] == "interrupted":
        raise SimulatorError(_when(summary))
    return summary


@contextmanager
def _killed_after(seconds: float | None, process: subprocess.Popen[str]) -> Iterator[None]:
    """Context that kills a process after so many seconds, if given."""
    timer = None if seconds is None else Timer(seconds, process.kill)
    if timer is not None:
        timer.start()
    try:
        yield
    finally:
        if timer is not None:
            timer.cancel()


def _follow(process: subprocess.Popen[str], request: StopRequest, progress: Progress | None) -> tuple[int, dict[str, Any]]:
    """Follow a simulator to its end; return its status and its last record, the summary.  A stop request closes its input."""
    assert process.stdin is not None
    try:
        request.answer_by(process.stdin.close)
        summary = _read_records(process, progress)
        return process.wait(), summary
    finally:
        process.kill()  # the caller has given up; a process that has ended is not affected


def _read_records(process: subprocess.Popen[str], progress: Progress | None) -> dict[str, Any]:
    """The summary of a run; earlier records go to ``progress``."""
    assert process.stdout is not None
    summary: dict[str, Any] = {}
    for line in process.stdout:
        record = _read_record(line)
        if "progress" in record:
            if "slow" in record and (tell := _SLOW.get()) is not None:
                _SLOW.set(None)
                tell(record["slow"])
            if progress is not None:
                progress(record["progress"])
        else:
            summary = record
    return summary


def _when(summary: Mapping[str, Any]) -> str:
    """The time at which a run was interrupted, in words, if its summary has it."""
    time = summary.get("time")
    return "interrupted" if time is None else f"interrupted at t = {time:.6g} s"


def _begin(command: Sequence[str], **how: Any) -> subprocess.Popen[str]:
    """A simulator that has begun; the system may not run it, as where the cache is on a disk whose programs must not be run."""
    try:
        return subprocess.Popen(command, **how)
    except OSError as error:
        advice = "set $CUTJOINT_CACHE to a folder whose programs may be run"
        raise SimulatorError(f"the simulator {command[0]} cannot be run: {error.strerror}; {advice}") from error


def _read_record(line: str) -> dict[str, Any]:
    """A line as a record; empty if the simulator ended while writing it."""
    try:
        record = json.loads(line)
    except json.JSONDecodeError:
        record = None if line.endswith("\n") else {}
    if not isinstance(record, dict):
        raise SimulatorError(f"the simulator wrote a line that is no record: {line[:200].rstrip()!r}")
    return record


def failure_of(summary: Mapping[str, Any]) -> FailureReport | None:
    """The failure that a summary reports, if any."""
    if summary["status"] == "done":
        return None
    return FailureReport(
        message=summary["message"], time=_number(summary["time"]), step=summary["step"], element=summary["element"],
        residual=_number(summary["residual"]), advice=summary["advice"], guards=tuple(summary.get("guards", ())),
    )  # fmt: skip


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
