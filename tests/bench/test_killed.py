"""The processes that make a bench ready end with it, even if it is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

#: A process with a pool of two, which prints their numbers and waits.
SCRIPT = """
import os, time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from cutjoint_bench.prebuild import end_with_parent

if __name__ == "__main__":
    pool = ProcessPoolExecutor(2, mp_context=get_context("spawn"), initializer=end_with_parent)
    waiting = [pool.submit(time.sleep, 600) for _ in range(2)]
    print(*pool._processes, flush=True)
    time.sleep(600)
"""


def is_running(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return "\nState:\tZ" not in Path(f"/proc/{number}/status").read_text(encoding="ascii")


def test_processes_end_with_a_killed_bench(tmp_path: Path) -> None:
    script = tmp_path / "pool.py"
    script.write_text(SCRIPT, encoding="utf-8")
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        numbers = [int(x) for x in process.stdout.readline().split()]
        assert numbers
        time.sleep(3)
        assert all(map(is_running, numbers))
        process.send_signal(signal.SIGKILL)
    until = time.monotonic() + 20
    while any(map(is_running, numbers)) and time.monotonic() < until:
        time.sleep(0.1)
    assert not any(map(is_running, numbers))
