"""Runs a simulator binary."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cutjoint.run.results import FailureReport

#: Called with the share of a run that is done, 0 to 1.
Progress = Callable[[float], None]


class SimulatorError(RuntimeError):
    """The simulator could not begin."""


def call_simulator(binary: Path, run_file: Mapping[str, Any], progress: Progress | None = None) -> dict[str, Any]:
    """Run a simulator on a run file and return its summary.

    Raises:
        SimulatorError: it could not begin (a run that fails numerically returns a summary that says so).
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.json"
        path.write_text(json.dumps(run_file), encoding="utf-8")
        process = subprocess.Popen([binary, path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stdout is not None
        assert process.stderr is not None
        summary: dict[str, Any] = {}
        for line in process.stdout:
            record = json.loads(line)
            if set(record) == {"progress"}:
                if progress is not None:
                    progress(record["progress"])
            else:
                summary = record
        complaint = process.stderr.read()
        if process.wait() not in (0, 1) or not summary:
            raise SimulatorError(complaint.strip() or f"the simulator ended with status {process.returncode}")
    return summary


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
