"""The end of a simulator that does not do as it should, and of one that nobody follows any longer."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from textwrap import dedent

import pytest

from cutjoint.run.simulator import SimulatorError, call_simulator
from tests.toolchain.test_paths import can_mount, run_mounted

Script = Callable[[str], Path]


@pytest.fixture
def script(tmp_path: Path) -> Script:
    """A program in Python in a simulator's place."""

    def write(text: str) -> Path:
        path = tmp_path / "simulator"
        path.write_text(f"#!{sys.executable}\nimport os, signal, sys, time\n{dedent(text)}", encoding="utf-8")
        path.chmod(0o755)
        return path

    return write


def test_the_last_record_is_the_summary(script: Script) -> None:
    shares: list[float] = []
    binary = script("""print('{"progress": 0.5}\\n{"progress": 1}\\n{"status": "done", "steps": 3}')""")
    assert call_simulator(binary, {}, shares.append) == {"status": "done", "steps": 3}
    assert shares == [0.5, 1]


def test_many_complaints_hold_nobody_up(script: Script) -> None:
    """More than a pipe takes, before the first line of output."""
    binary = script("""
        signal.alarm(60)
        sys.stderr.write("far too much\\n" * 100_000)
        sys.stderr.flush()
        print('{"status": "done"}')
    """)
    assert call_simulator(binary, {}) == {"status": "done"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("print('hello', flush=True); time.sleep(60)", "the simulator wrote a line that is no record: 'hello'"),
        ("print('[1, 2]')", r"the simulator wrote a line that is no record: '\[1, 2\]'"),
        ("print('{\"status\": ', end='', flush=True); os.kill(os.getpid(), signal.SIGKILL)", "the simulator ended with status -9"),
        ("sys.exit('error: no such file')", "no such file"),
        ("print('{\"status\": \"done\"}'); sys.exit(2)", "the simulator ended with status 2"),
    ],
)
def test_what_is_no_summary_is_reported(text: str, message: str, script: Script) -> None:
    with pytest.raises(SimulatorError, match=f"^{message}$"):
        call_simulator(script(text), {})


def test_a_simulator_that_nobody_follows_is_ended(script: Script, tmp_path: Path) -> None:
    binary = script(f"""
        open({str(tmp_path / "pid")!r}, "w").write(str(os.getpid()))
        print('{{"progress": 0}}', flush=True)
        time.sleep(60)
    """)

    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        call_simulator(binary, {}, stop)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


@pytest.mark.parametrize(
    ("content", "mode", "reason"),
    [
        (b"", 0o755, "Exec format error"),
        (b"\x7fELF\x02\x01\x01", 0o755, "Exec format error"),
        (b"no program", 0o755, "Exec format error"),
        (b"#!/nowhere/sh\n", 0o755, "No such file or directory"),
        (b"#!/bin/sh\n", 0o644, "Permission denied"),
    ],
)
def test_what_cannot_be_run_is_reported(content: bytes, mode: int, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "simulator"
    path.write_bytes(content)
    path.chmod(mode)
    with pytest.raises(SimulatorError) as caught:
        call_simulator(path, {})
    advice = "set $CUTJOINT_CACHE to a folder whose programs may be run"
    assert str(caught.value) == f"the simulator {path} cannot be run: {reason}; {advice}"


@can_mount
def test_a_disk_whose_programs_must_not_be_run(script: Script, tmp_path: Path) -> None:
    call = f"from cutjoint.run import simulator; simulator.call_simulator(simulator.Path({str(script('pass'))!r}), {{}})"
    done = run_mounted(tmp_path, call, "noexec")
    assert done.stderr.splitlines()[-1].startswith("cutjoint.run.simulator.SimulatorError: the simulator ")
    assert "cannot be run: Permission denied; set $CUTJOINT_CACHE" in done.stderr
