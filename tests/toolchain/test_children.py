"""Nothing that a tool has started outlives who asked for it, however that ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from textwrap import dedent
from time import monotonic, sleep

import pytest

from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain.children import tool

#: A tool that starts others as Ninja does, each in a process group of its own, and one that has lost its parent; then it waits.
TOOL = """
import os, sys, time
def start(group, orphan):
    if os.fork() == 0:
        if group:
            os.setpgid(0, 0)
        if orphan and os.fork():
            os._exit(0)
        time.sleep(60)
        os._exit(0)
for group in (False, True):
    for orphan in (False, True):
        start(group, orphan)
print("at work", flush=True)
time.sleep(60)
"""

#: Uses the tool, by way of the command line's signals or as a script that knows nothing of them.
SCRIPT = """
import os, sys
from contextlib import nullcontext
from cutjoint.run.stopping import ended_by_signals
from cutjoint.toolchain.children import tool
with ended_by_signals() if sys.argv[1] == "command" else nullcontext():
    with tool([sys.executable, "-c", sys.argv[2]], os.environ) as process:
        print(process.stdout.readline(), end="", flush=True)
        print(process.stdout.read())
"""


@pytest.fixture
def mark(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[str]:
    """An entry in the environment of all that a test starts."""
    name = f"CUTJOINT_MARK={tmp_path}"
    monkeypatch.setenv("CUTJOINT_MARK", str(tmp_path))
    yield name
    for pid in alive(name):
        os.kill(pid, signal.SIGKILL)


def alive(mark: str) -> list[int]:
    """The processes with a mark but this one."""
    return [pid for pid in map(int, filter(str.isdigit, os.listdir("/proc"))) if pid != os.getpid() and _has(pid, mark)]


def _has(pid: int, mark: str) -> bool:
    try:
        return mark.encode() in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return False


def wait_until_none_is_alive(mark: str) -> None:
    end = monotonic() + 20
    while left := alive(mark):
        assert monotonic() < end, left
        sleep(0.02)


def test_what_a_tool_says_and_its_status() -> None:
    script = "import os, sys; print('out', flush=True); print('err', file=sys.stderr); sys.exit(3) if not sys.stdin.read() else None"
    with tool([sys.executable, "-c", script], os.environ) as process:
        assert process.stdout is not None
        assert process.stdout.read() == "out\nerr\n"
    assert process.returncode == 3
    with tool([sys.executable, "-c", "import os; os.kill(os.getpid(), 6)"], os.environ) as process:
        process.wait()
    assert process.returncode == 128 + signal.SIGABRT


def test_a_tool_has_the_usual_signals() -> None:
    """Python ignores SIGPIPE, but its children must not."""
    with tool(["grep", "SigIgn", "/proc/self/status"], os.environ) as process:
        assert process.stdout is not None
        assert int(process.stdout.read().split()[1], 16) & 1 << (signal.SIGPIPE - 1) == 0


def test_an_error_ends_all(mark: str) -> None:
    with suppress(ZeroDivisionError), tool([sys.executable, "-c", TOOL], os.environ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "at work\n"
        assert len(alive(mark)) >= 4
        raise ZeroDivisionError
    assert alive(mark) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL], ids=lambda n: n.name)
@pytest.mark.parametrize("who", ["command", "script"])
def test_a_signal_ends_all(who: str, number: signal.Signals, mark: str) -> None:
    with subprocess.Popen([sys.executable, "-c", SCRIPT, who, TOOL], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "at work\n"
        process.send_signal(number)
        status = process.wait()
    wait_until_none_is_alive(mark)
    ends_itself = who == "command" and number not in (signal.SIGINT, signal.SIGKILL)
    assert status == (128 + number if ends_itself else -number)


def test_the_end_of_its_keeper_ends_all(mark: str) -> None:
    with tool([sys.executable, "-c", TOOL], os.environ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "at work\n"
        process.kill()
    assert alive(mark) == []


def test_what_threads_have_begun_ends_with_the_program(mark: str, tmp_path: Path) -> None:
    """Folders too: nobody waits for such threads."""
    script = dedent("""
        import os, sys, threading
        from pathlib import Path
        from cutjoint.toolchain.children import tool
        from cutjoint.toolchain.temporary import temporary_folder
        begun = threading.Event()
        def work():
            with temporary_folder(Path(sys.argv[1])), tool([sys.executable, "-c", sys.argv[2]], os.environ) as process:
                process.stdout.readline()
                begun.set()
                process.stdout.read()
        threading.Thread(target=work, daemon=True).start()
        begun.wait()
        sys.exit(5)
    """)
    (tmp_path / "place").mkdir()
    done = subprocess.run([sys.executable, "-c", script, tmp_path / "place", TOOL], check=False, timeout=60)
    assert done.returncode == 5
    assert alive(mark) == []
    assert list((tmp_path / "place").iterdir()) == []


def test_a_tool_that_cannot_be_started(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere")
    with pytest.raises(ToolchainError, match="cmake cannot be started: No such file"), tool(["cmake"], os.environ):
        pass
