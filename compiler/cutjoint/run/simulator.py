"""Runs a simulator binary."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from cutjoint.run.results import FailureReport

#: Called with the share of a run that is done, 0 to 1.
Progress = Callable[[float], None]


class SimulatorError(RuntimeError):
    """The simulator could not begin, or what it wrote is no summary."""


def call_simulator(binary: Path, run_file: Mapping[str, Any], progress: Progress | None = None) -> dict[str, Any]:
    """Run a simulator on a run file and return its summary; it has ended when this returns or raises, also where ``progress`` raises.

    Raises:
        SimulatorError: it could not begin (a run that fails numerically returns a summary that says so), or wrote what is no summary.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.json"
        path.write_text(json.dumps(run_file), encoding="utf-8")
        # what it complains of goes into a file: a pipe that nobody reads would hold it up
        with (Path(folder) / "complaint.txt").open("w+", encoding="utf-8", errors="replace") as complaint:
            status, summary = _follow([str(binary), str(path)], complaint, progress)
            complaint.seek(0)
            if status not in (0, 1) or not summary:
                raise SimulatorError(complaint.read().strip() or f"the simulator ended with status {status}")
    return summary


def _follow(command: Sequence[str], complaint: IO[str], progress: Progress | None) -> tuple[int, dict[str, Any]]:
    """The status that a simulator ends with and the last record that it writes; those before tell its progress."""
    summary: dict[str, Any] = {}
    with _begin(command, stdout=subprocess.PIPE, stderr=complaint, encoding="utf-8", errors="replace") as process:
        try:
            assert process.stdout is not None
            for line in process.stdout:
                record = _read_record(line)
                if set(record) != {"progress"}:
                    summary = record
                elif progress is not None:
                    progress(record["progress"])
            return process.wait(), summary
        finally:
            process.kill()  # who follows it has given up; one that has ended is left alone


def _begin(command: Sequence[str], **how: Any) -> subprocess.Popen[str]:
    """A simulator that has begun.

    Raises:
        SimulatorError: the system does not run it, as where the cache is on a disk whose programs must not be run.
    """
    try:
        return subprocess.Popen(command, **how)
    except OSError as error:
        advice = "set $CUTJOINT_CACHE to a folder whose programs may be run"
        raise SimulatorError(f"the simulator {command[0]} cannot be run: {error.strerror}; {advice}") from error


def _read_record(line: str) -> dict[str, Any]:
    """A line as a record; none if the simulator ended within it."""
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
