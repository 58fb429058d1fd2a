"""The program in this process and in one of its own, and the files that it leaves."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

import pytest
from click.testing import CliRunner, Result

from cutjoint.cli import main
from tests.listening import listen

#: Seconds in which a program that does as it should has long come to what a test waits for.
PATIENCE = 120


def call(*arguments: object) -> Result:
    """The program in this process."""
    return CliRunner().invoke(main, [str(a) for a in arguments])


def launch(*arguments: object, limit: int | None = None, **how: object) -> subprocess.Popen[str]:
    """The program in a process of its own, whose files may have ``limit`` bytes; it keeps no bytecode then, which would be cut off too."""

    def prepare() -> None:
        listen()
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.Popen(
        [sys.executable, *(() if limit is None else ("-B",)), "-c", "from cutjoint.cli import main; main()", *map(str, arguments)],
        text=True, preexec_fn=prepare,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **how},  # type: ignore[arg-type]
    )  # fmt: skip


def run(*arguments: object, limit: int | None = None) -> tuple[int, str]:
    """Status and messages of the program in a process of its own."""
    with launch(*arguments, limit=limit) as process:
        _, messages = process.communicate(timeout=PATIENCE)
    assert "Traceback" not in messages
    return process.returncode, messages


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    end = monotonic() + PATIENCE
    while not condition():
        assert monotonic() < end
        sleep(0.02)


def has_content(path: Path) -> bool:
    """True if there is a file with something in it."""
    return path.exists() and path.stat().st_size > 0


def files(folder: Path) -> list[str]:
    """The names of what is in a folder besides models and tables of cases."""
    return sorted(p.name for p in folder.iterdir() if p.suffix != ".yaml" and p.name != "cases.csv")


@contextmanager
def small_disk(place: Path) -> Iterator[Path]:
    """A file system of 64 kB."""
    place.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", place], check=False, capture_output=True).returncode != 0:
        pytest.skip("nothing can be mounted here")
    try:
        yield place
    finally:
        subprocess.run(["umount", place], check=True)
