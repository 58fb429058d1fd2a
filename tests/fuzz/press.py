"""The press of the README in a folder of its own, and the command line on it as another process."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import cutjoint
from cutjoint.compile.pipeline import compile_model
from cutjoint.run.artifact import Artifact
from tests.conftest import ROOT

MODEL = "press.yaml"
SECONDS = 60.0


@cache
def press() -> str:
    """The text of the model."""
    found = re.search(r"```yaml\n(cutjoint: 1\nname: press\n.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found[1]


def compile_press(folder: Path) -> Artifact:
    """The press, compiled, or found in the cache."""
    (folder / MODEL).write_text(press(), encoding="utf-8")
    return compile_model(folder / MODEL)


def command(*words: object) -> list[str]:
    """The words that start the command line in another process."""
    return [sys.executable, "-c", "from cutjoint.cli import main; main()", *map(str, words)]


def environment(**more: str) -> dict[str, str]:
    """This process's environment, with this source tree and ``more``."""
    return {**os.environ, "PYTHONPATH": str(Path(cutjoint.__file__).parents[1]), **more}


def run(words: Sequence[object], folder: Path, more: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command line in a folder to its end."""
    return subprocess.run(
        command(*words), cwd=folder, env=environment(**(more or {})), capture_output=True, text=True, errors="replace", check=False,
        timeout=SECONDS * 10,
    )  # fmt: skip


def require_reported(done: subprocess.CompletedProcess[str]) -> None:
    """A call ended as it should: done, or with a message and status 1 or 2."""
    assert done.returncode in (0, 1, 2), f"status {done.returncode}: {done.stderr[-600:]}"
    assert "Traceback" not in done.stderr, done.stderr[-600:]
    assert "Warning" not in done.stderr, done.stderr[-600:]
    assert done.returncode == 0 or done.stderr.strip(), f"status {done.returncode} without a message"
