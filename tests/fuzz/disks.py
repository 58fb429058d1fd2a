"""Runs whose files meet the end of a disk or of a quota: a message, and what was there before is still there."""

from __future__ import annotations

import json
import os
import random
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from tests.edges.calling import compile_first

from .press import MODEL, command, environment, press, require_reported

_EARLIER = "t,earlier\n0,1\n"
SECONDS = 60.0


def make(rng: random.Random) -> str:
    """The size of the disk in kB, the calls' options and the table that was there before, as JSON."""
    compile_first()
    options = rng.choice((
        ["simulate", MODEL, "--out", "full/run.csv"],
        ["simulate", MODEL, "--out", "run.csv", "--steps", "full/run.csv"],
        ["simulate", MODEL, "--out", "full/run.csv", "--plots", "full/plots"],
        ["batch", MODEL, "cases.csv", "--out", "full/run.csv"],
        ["realtime", MODEL, "--end", "0.2", "--out", "full/run.csv"],
        ["explain", MODEL, "--out", "full/run.csv"],
        ["modes", MODEL, "--out", "full/run.csv"],
        ["schema", "--out", "full/run.csv"],
    ))  # fmt: skip
    return json.dumps({"kilobytes": rng.choice((4, 8, 12, 16, 24, 32, 64, 128)), "words": options, "rows": rng.choice((2, 20, 400))})


def check(text: str) -> tuple[str, ...]:
    """The reason for an early end; fails where a call says nothing, ends as done with a part of its table, or has cost the earlier one."""
    case = json.loads(text)
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / MODEL).write_text(press(), encoding="utf-8")
        (folder / "cases.csv").write_text("stiffness\n" + "\n".join(str(1000 + i) for i in range(case["rows"])) + "\n", encoding="utf-8")
        with _small_disk(folder / "full", case["kilobytes"]):
            (folder / "full" / "run.csv").write_text(_EARLIER, encoding="utf-8")
            done = subprocess.run(
                command(*case["words"]), cwd=folder, env=environment(), capture_output=True, text=True, errors="replace", check=False,
                timeout=SECONDS,
            )  # fmt: skip
            require_reported(done)
            found = (folder / "full" / "run.csv").read_text(encoding="utf-8")
            if done.returncode == 0 or _only_pictures_are_missing(done, found):
                _require_whole(case, found)
            else:
                assert found == _EARLIER, f"status {done.returncode}, and the earlier file is gone: {found[-80:]!r}"
    return (done.stderr.strip().splitlines()[0],) if done.returncode else ()


def _only_pictures_are_missing(done: subprocess.CompletedProcess[str], found: str) -> bool:
    """Plots are drawn of a table that is there; a disk that is too small for them leaves the table, and the message names a plot."""
    return found != _EARLIER and "full/plots" in done.stderr


def _require_whole(case: dict[str, list[str]], found: str) -> None:
    """Require that a file of a finished call has all its rows, and numbers in each."""
    assert found != _EARLIER, "status 0, and the earlier file stands there"
    if case["words"][0] == "batch":
        assert found.count("\n") == case["rows"] + 1, f"{found.count(chr(10)) - 1} rows of {case['rows']}"
    elif case["words"][0] == "simulate":
        rows = np.loadtxt(found.splitlines(), delimiter=",", skiprows=1)
        assert abs(rows[-1, 0] - 2) < 1e-9, f"done, but its table ends at {rows[-1, 0]} s"


@contextmanager
def _small_disk(folder: Path, kilobytes: int) -> Iterator[None]:
    """A file system of its own, where one may be mounted."""
    folder.mkdir()
    if os.geteuid() or subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", folder], check=False).returncode:
        raise PermissionError("a small disk is a tmpfs, which this user may not mount")
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)
