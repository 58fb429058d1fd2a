"""Tools that this process starts; none outlives it or the call that waits for it (`supervisor`)."""

import atexit
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain import supervisor

#: The supervisors of running tools, including those of threads that nobody waits for.
_at_work: set[subprocess.Popen[str]] = set()


@contextmanager
def tool(command: Sequence[str], environment: Mapping[str, str], folder: Path = Path(os.sep)) -> Iterator[subprocess.Popen[str]]:
    """A tool that runs in a folder of ours, since tools take files of the present one for their own.
    Its standard output has its errors too.  It, and all that it has started, ends at the latest with this block. Raises ToolchainError: the
    system starts no process."""
    kept = [sys.executable, "-I", "-S", str(Path(supervisor.__file__).absolute()), *command]
    try:
        process = subprocess.Popen(
            kept, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment, encoding="utf-8",
            errors="replace", cwd=folder, start_new_session=True,
        )  # fmt: skip
    except OSError as error:
        raise ToolchainError(f"{command[0]} cannot be started: {error.strerror or error}") from error
    _at_work.add(process)
    try:
        yield process
    finally:
        _end(process)
        _at_work.discard(process)


def call(command: Sequence[str], environment: Mapping[str, str], folder: Path) -> tuple[int, str]:
    """The status of a tool and all that it prints; errors as of `tool`."""
    with tool(command, environment, folder) as process:
        assert process.stdout is not None
        said = process.stdout.read()
        return process.wait(), said


def _end(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.close()
    process.wait()
    if process.returncode < 0:  # killed itself
        supervisor.end_session(process.pid)
    assert process.stdout is not None
    process.stdout.close()


@atexit.register
def _end_all() -> None:
    for process in list(_at_work):
        _end(process)
