"""Runs that a signal ends: the earlier table or a whole new one, partial tables that can be read, no process left and no folder."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from tests.edges.calling import compile_first
from tests.listening import listen

from .press import MODEL, command, environment, press, run

_EARLIER = "t,earlier\n0,1\n"
_END = 3000.0
#: Seconds in which what a killed run has begun ends.
_GRACE = 15.0


def make(rng: random.Random) -> str:
    """A signal, how long after the start it comes (s), whom it reaches, and the call, as JSON."""
    compile_first()
    words = rng.choice((
        ["simulate", MODEL, "--out", "run.csv", "--end", str(_END)],
        ["simulate", MODEL, "--out", "run.csv", "--end", str(_END), "--steps", "steps.csv"],
        ["simulate", MODEL, "--out", "run.csv", "--end", "100", "--batch", "cases.csv"],
    ))  # fmt: skip
    name = rng.choice(("SIGINT", "SIGTERM", "SIGKILL", "SIGHUP"))
    everybody = name == "SIGINT" or rng.random() < 0.3
    return json.dumps({"signal": name, "after": round(rng.uniform(0.05, 4), 3), "everybody": everybody, "words": words})


def check(text: str) -> tuple[str, ...]:
    """How a run that was stopped ended; fails where something is lost, left or still running."""
    case = json.loads(text)
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "tmp").mkdir()
        (folder / MODEL).write_text(press(), encoding="utf-8")
        (folder / "cases.csv").write_text("stiffness\n" + "\n".join(map(str, range(1000, 3000))) + "\n", encoding="utf-8")
        (folder / "run.csv").write_text(_EARLIER, encoding="utf-8")
        status, said = _stop(case, folder)
        _require_none_left(folder)
        _require_tables(folder)
        assert status != 0 or (folder / "run.csv").read_text(encoding="utf-8") != _EARLIER, "status 0, and no table"
        if case["signal"] != "SIGKILL":
            assert "Traceback" not in said, said[-600:]
        assert (folder / MODEL).read_text(encoding="utf-8") == press(), "the model has changed"
        again = run(["simulate", MODEL, "--out", "again.csv", "--end", "0.01"], folder, {"TMPDIR": str(folder / "tmp")})
        assert again.returncode == 0, again.stderr[-600:]
        assert not list((folder / "tmp").iterdir()), f"left: {[p.name for p in (folder / 'tmp').iterdir()]}"
    return (f"status {status}",) if status else ()


def _stop(case: dict[str, object], folder: Path) -> tuple[int, str]:
    """Start a call, send it the signal, and wait for its end: status and what it says on standard error."""
    words, number = case["words"], signal.Signals[str(case["signal"])]
    assert isinstance(words, list)
    with (folder / "said.txt").open("w+", encoding="utf-8", errors="replace") as said:
        process = subprocess.Popen(
            command(*words), cwd=folder, env=environment(TMPDIR=str(folder / "tmp")), stdout=subprocess.DEVNULL, stderr=said,
            start_new_session=True, preexec_fn=listen,
        )  # fmt: skip
        try:
            time.sleep(float(str(case["after"])))
            if process.poll() is None:
                (os.killpg if case["everybody"] else os.kill)(process.pid, number)
            return process.wait(_GRACE), (folder / "said.txt").read_text(encoding="utf-8", errors="replace")
        finally:
            process.kill()


def _require_none_left(folder: Path) -> None:
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
