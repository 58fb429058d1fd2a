"""Commands that a signal ends while they derive, compile, run or sweep: the earlier table or a whole new one, partial tables that can be
read, parts from which a sweep goes on, no process left and no folder."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow.parquet

from tests.edges.calling import compile_first
from tests.listening import listen

from .caches import FLAGS, template
from .press import MODEL, command, environment, press, run

_EARLIER = "t,earlier\n0,1\n"
_END = 3000.0
#: Calls that run what is compiled, and such that compile it before.
_RUNNING = (
    ["simulate", MODEL, "--out", "run.csv", "--end", str(_END)],
    ["simulate", MODEL, "--out", "run.csv", "--end", str(_END), "--steps", "steps.csv"],
    ["batch", MODEL, "cases.csv", "--out", "run.csv", "--end", "100"],
)
_COMPILING = (
    ["simulate", MODEL, "--out", "run.csv", "--end", str(_END)],
    ["compile", MODEL, "--out", "made"],
    ["modes", MODEL, "--out", "modes.json"],
    ["sweep", "study.yaml", "--out", "table.parquet"],
)
#: A study of so many runs.
_RUNS = 2000
_STUDY = f"""
cutjoint_study: 1
model: {MODEL}
end: 1
parameters: {{stiffness: {{from: 1000, to: 3000, count: {_RUNS}}}}}
design: grid
objectives: {{top: {{maximum: slider.x}}}}
"""
#: A compiler that takes longer than anybody waits for what is left.
_SLOW_COMPILER = """#!/bin/sh
case "$SLOW $*" in "1 "*" -c "*) sleep 60;; esac
exec g++ "$@"
"""
#: Seconds in which Python starts on a busy machine.
_START = 2.0
#: Seconds in which what a killed run has begun ends.
_GRACE = 15.0


def make(rng: random.Random) -> str:
    """A signal, how long after the start it comes (s), whom it reaches, the call, whether its cache lacks the model's code, and whether the
    compiler is slow then, as JSON."""
    if private := rng.random() < 0.6:
        template()
        words, most = rng.choice(_COMPILING), 9.0
    else:
        compile_first()
        words, most = rng.choice(_RUNNING), 4.0
    name = rng.choice(("SIGINT", "SIGTERM", "SIGKILL", "SIGHUP"))
    everybody = name == "SIGINT" or rng.random() < 0.3
    case = {"signal": name, "after": round(rng.uniform(0.05, most), 3), "everybody": everybody, "words": words, "private": private}
    return json.dumps({**case, "slow": private and rng.random() < 0.6})


def check(text: str) -> tuple[str, ...]:
    """The status of a stopped command, in words; fails where something is lost, left or still running."""
    case = json.loads(text)
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "tmp").mkdir()
        (folder / MODEL).write_text(press(), encoding="utf-8")
        (folder / "cases.csv").write_text("stiffness\n" + "\n".join(map(str, range(1000, 3000))) + "\n", encoding="utf-8")
        (folder / "study.yaml").write_text(_STUDY, encoding="utf-8")
        (folder / "run.csv").write_text(_EARLIER, encoding="utf-8")
        more = _private(folder) if case.get("private") else {"TMPDIR": str(folder / "tmp")}
        status, said = _stop(case, folder, {**more, **({"SLOW": "1"} if case.get("slow") else {})})
        require_none_left(folder)
        _require_tables(folder)
        _require_ended(status, said, case, folder)
        assert (folder / MODEL).read_text(encoding="utf-8") == press(), "the model has changed"
        again = _again(case["words"], folder, more)
        assert again.returncode == 0, again.stderr[-600:]
        assert not _temporary(folder), f"left: {_temporary(folder)}"
    return (f"status {status}",) if status else ()


def _private(folder: Path) -> dict[str, str]:
    """The variables of a cache in the folder that has all but what is made for the model."""
    kept, _ = template()
    shutil.copytree(kept, folder / "cache", ignore=shutil.ignore_patterns("object-*", "runs", "seconds"))
    for simulator in (folder / "cache").glob("*/simulator"):
        if not simulator.parent.name.startswith("interpreter"):
            shutil.rmtree(simulator.parent)
    (folder / "c++").write_text(_SLOW_COMPILER, encoding="utf-8")
    (folder / "c++").chmod(0o755)
    return {"TMPDIR": str(folder / "tmp"), "CUTJOINT_CACHE": str(folder / "cache"), "CXX": str(folder / "c++"), **FLAGS}


def _again(words: list[str], folder: Path, more: Mapping[str, str]) -> subprocess.CompletedProcess[str]:
    """Run the command once more to its end, which finds nothing in its way, or a short run; a sweep then has all rows."""
    if words[0] == "simulate":
        return run(["simulate", MODEL, "--out", "again.csv", "--end", "0.01"], folder, more)
    done = run(words, folder, more)
    if words[0] == "sweep" and not done.returncode:
        assert pyarrow.parquet.read_table(folder / "table.parquet")["run"].to_pylist() == list(range(_RUNS))
    return done


def _temporary(folder: Path) -> list[str]:
    """Names of temporary folders and their locks."""
    return sorted(p.name for pattern in ("tmp/*", "cache/cutjoint-*") for p in folder.glob(pattern))


def _require_ended(status: int, said: str, case: Mapping[str, Any], folder: Path) -> None:
    """A command that a signal has ended says so, has the status of convention, and has put nothing anywhere that is temporary."""
    number = signal.Signals[str(case["signal"])]
    if number == signal.SIGKILL:
        return
    assert status in (0, 128 + number, -number), f"status {status}: {said[-600:]}"
    if status == -number:  # before the command has begun, or after its end
        assert float(case["after"]) < _START or _is_done(case["words"], folder), f"{number.name} ended it at once"
        return
    assert "Traceback" not in said, said[-600:]
    assert not status or "interrupted" in said, said[-600:]
    assert not _temporary(folder), f"left at once: {_temporary(folder)}"
    assert status or _is_done(case["words"], folder), "status 0, and no table"


def _is_done(words: list[str], folder: Path) -> bool:
    """True if the command's output is there."""
    out = folder / words[words.index("--out") + 1]
    return out.exists() and (out.name != "run.csv" or out.read_text(encoding="utf-8") != _EARLIER)


def _stop(case: Mapping[str, Any], folder: Path, more: Mapping[str, str]) -> tuple[int, str]:
    """Start a call, send it the signal, and wait for its end: status and what it says on standard error."""
    words, number = case["words"], signal.Signals[str(case["signal"])]
    assert isinstance(words, list)
    with (folder / "said.txt").open("w+", encoding="utf-8", errors="replace") as said:
        process = subprocess.Popen(
            command(*words), cwd=folder, env=environment(**more), stdout=subprocess.DEVNULL, stderr=said,
            start_new_session=True, preexec_fn=listen,
        )  # fmt: skip
        try:
            time.sleep(float(str(case["after"])))
            if process.poll() is None:
                (os.killpg if case["everybody"] else os.kill)(process.pid, number)
            with suppress(subprocess.TimeoutExpired):
                return process.wait(_GRACE), (folder / "said.txt").read_text(encoding="utf-8", errors="replace")
            raise AssertionError(f"goes on: {(folder / 'said.txt').read_text(encoding='utf-8', errors='replace')[-600:]}")
        finally:
            process.kill()


def require_none_left(folder: Path) -> None:
    """No process that works in the folder is left after a while."""
    end = time.monotonic() + _GRACE
    while left := [pid for pid in os.listdir("/proc") if pid.isdigit() and _works_in(pid, folder)]:
        if time.monotonic() > end:
            for pid in left:
                os.kill(int(pid), signal.SIGKILL)
            raise AssertionError(f"still running: {left}")
        time.sleep(0.2)


def _works_in(pid: str, folder: Path) -> bool:
    try:
        return Path(os.readlink(f"/proc/{pid}/cwd")).is_relative_to(folder)
    except OSError:
        return False


def _require_tables(folder: Path) -> None:
    """The earlier table or a whole new one; what there is of an unfinished one has whole rows."""
    found = (folder / "run.csv").read_text(encoding="utf-8")
    if found != _EARLIER:
        _require_rows(folder / "run.csv")
        if "run.failure" not in found.split("\n", 1)[0]:
            last = float(found.splitlines()[-1].split(",")[0])
            assert abs(last - _END) < 1e-6, f"the earlier table is gone, and the new one ends at {last} s"
    for partial in folder.glob("*.partial.csv"):
        _require_rows(partial)


def _require_rows(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    if lines and "run.failure" not in lines[0]:
        rows = np.loadtxt(lines[1:], delimiter=",", ndmin=2) if lines[1:] else np.zeros((0, lines[0].count(",") + 1))
        assert rows.shape[1] == lines[0].count(",") + 1
    assert len({line.count(",") for line in lines}) <= 1, f"{path.name}: a row is cut"
