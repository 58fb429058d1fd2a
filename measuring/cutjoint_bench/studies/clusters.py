"""Dask clusters on this machine: one of processes that this one starts, and one of its commands, which can be killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep

from cutjoint.sweeps.cluster import dask

#: Settings of Dask that keep its processes from waking up 50 times a second: docs/how-to/cluster.md recommends them.
QUIET: Mapping[str, str | bool] = {
    "distributed.worker.profile.enabled": False, "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s", "distributed.worker.memory.monitor-interval": "1s",
}  # fmt: skip

#: Seconds that a process may take to start.
_PATIENCE = 60


@contextmanager
def local_cluster(workers: int, settings: Mapping[str, str | bool]) -> Iterator[str]:
    """The address of a cluster of processes that this one started, with settings of Dask."""
    cluster = dask().LocalCluster
    from dask import config

    with config.set(settings), cluster(n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0") as local:
        yield str(local.scheduler_address)


@contextmanager
def process_cluster(workers: int, settings: Mapping[str, str | bool]) -> Iterator[str]:
    """The address of a scheduler and workers that were started by their commands."""
    with TemporaryDirectory() as place:
        processes = Processes(Path(place), settings)
        try:
            processes.start_scheduler()
            for _ in range(workers):
                processes.start_worker()
            processes.wait_for(workers)
            yield processes.address
        finally:
            processes.end()


@dataclass
class Processes:
    """A scheduler and workers as processes of their own on loopback, whose files are in a folder."""

    folder: Path
    settings: Mapping[str, str | bool] = field(default_factory=dict)
    address: str = ""
    _started: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start_scheduler(self) -> subprocess.Popen[bytes]:
        """Start a scheduler and wait until it has an address."""
        log = self.folder / f"{len(self._started)}.log"
        process = self._start(log, "scheduler", "--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0")
        end = monotonic() + _PATIENCE
        while not (lines := [line for line in log.read_text().splitlines() if "Scheduler at:" in line]):
            if monotonic() > end:
                raise TimeoutError(log.read_text())
            sleep(0.1)
        self.address = lines[0].split()[-1]
        return process

    def start_worker(self) -> subprocess.Popen[bytes]:
        """Start a worker of one thread, with its nanny."""
        options = ["--nthreads", "1", "--no-dashboard", "--local-directory", str(self.folder)]
        return self._start(self.folder / f"{len(self._started)}.log", "worker", self.address, *options)

    def wait_for(self, workers: int) -> None:
        """Wait until so many workers are there."""
        with dask().Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=_PATIENCE)

    def _start(self, log: Path, *words: str) -> subprocess.Popen[bytes]:
        command, variables = [sys.executable, "-m", "dask", *words], {**os.environ, **variables_of(self.settings)}
        with log.open("wb") as stream:
            self._started.append(subprocess.Popen(command, stdout=stream, stderr=stream, start_new_session=True, env=variables))
        return self._started[-1]

    def end(self) -> None:
        """End all of them, with what they started."""
        for process in reversed(self._started):
            kill(process)


def variables_of(settings: Mapping[str, str | bool]) -> dict[str, str]:
    """Settings of Dask as variables of the environment."""
    return {f"DASK_{name.upper().replace('.', '__').replace('-', '_')}": str(value) for name, value in settings.items()}


def kill(process: subprocess.Popen[bytes]) -> None:
    """SIGKILL a process and those of its session."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(_PATIENCE)
