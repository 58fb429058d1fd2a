"""Sweeps on Dask clusters: the same file as in one process, whoever dies meanwhile."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster, config

import cutjoint
from cutjoint.package.errors import RunError
from cutjoint.sweeps import kernel as kernels
from cutjoint.sweeps.cluster import Cluster
from cutjoint.sweeps.code import build_kernels
from cutjoint.sweeps.reading import read_study
from cutjoint.sweeps.run import perform_study
from cutjoint.sweeps.work import Chunk, Work
from cutjoint_bench.studies.clusters import QUIET, variables_of
from tests.conftest import ROOT, needs_cpp

from .studies import study

pytestmark = needs_cpp

#: Seconds that anything here may take on a busy machine.
PATIENCE = 90.0
#: A study of seconds, in lanes, in chunks enough to be stopped between them.
LONG = {"end": 2.0, "design": {"sobol": 2048}}


@dataclass
class Processes:
    """A scheduler and workers as processes of their own, on loopback."""

    folder: Path
    started: list[subprocess.Popen[bytes]] = field(default_factory=list)
    workers: int = 0

    @property
    def address(self) -> str:
        """Of the scheduler."""
        return (self.folder / "address").read_text(encoding="utf-8")

    def start_scheduler(self, port: int = 0) -> subprocess.Popen[bytes]:
        """Start a scheduler and wait until it answers."""
        log = self.folder / f"scheduler-{len(self.started)}.log"
        options = ["--host", "127.0.0.1", "--port", str(port), "--dashboard-address", "127.0.0.1:0"]
        process = self._start(log, "scheduler", *options)
        found = until(lambda: next((line for line in log.read_text().splitlines() if "Scheduler at:" in line), ""))
        (self.folder / "address").write_text(found.split()[-1], encoding="utf-8")
        return process

    def start_worker(self, **environment: str) -> subprocess.Popen[bytes]:
        """Start a worker of one thread."""
        self.workers += 1
        options = ["--nthreads", "1", "--no-dashboard", "--name", f"worker-{self.workers}", "--local-directory", str(self.folder)]
        return self._start(self.folder / f"worker-{self.workers}.log", "worker", self.address, *options, **environment)

    def _start(self, log: Path, *words: str, **environment: str) -> subprocess.Popen[bytes]:
        command, variables = [sys.executable, "-m", "dask", *words], {**os.environ, **environment}
        with log.open("wb") as stream:
            process = subprocess.Popen(command, stdout=stream, stderr=stream, start_new_session=True, env=variables)
        self.started.append(process)
        return process

    def end(self) -> None:
        """End all of them, with what they started."""
        for process in reversed(self.started):
            kill(process)


def kill(process: subprocess.Popen[bytes]) -> None:
    """SIGKILL a process and those that it started."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(PATIENCE)


def until(find: Callable[[], object]) -> str:
    """Wait for a result; returns it."""
    end = time.monotonic() + PATIENCE
    while not (found := find()):
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.02)
    return str(found)


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    started = Processes(tmp_path)
    try:
        yield started
    finally:
        started.end()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The table of the long study, made in this process."""
    folder = tmp_path_factory.mktemp("whole")
    return cutjoint.sweep(study(folder, **LONG), folder / "out.parquet").path.read_bytes()


def _has_parts(out: Path, number: int) -> Callable[[], bool]:
    return lambda: len(list(out.with_name(f"{out.name}.parts").glob("0*.parquet"))) >= number


def test_a_local_cluster_makes_the_same_file(tmp_path: Path) -> None:
    path, said = study(tmp_path), []
    cutjoint.sweep(path, tmp_path / "alone.parquet")
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:
        cutjoint.sweep(path, tmp_path / "dask.parquet", scheduler=cluster.scheduler_address, note=said.append)
    assert (tmp_path / "dask.parquet").read_bytes() == (tmp_path / "alone.parquet").read_bytes()
    assert any("Dask's dashboard: http://" in line for line in said)


def _call(path: Path, out: Path, address: str) -> subprocess.Popen[bytes]:
    """A sweep in a process of its own."""
    call = "from cutjoint.cli import main; main()"
    words = [sys.executable, "-c", call, "sweep", str(path), "--out", str(out), "--scheduler", address]
    return subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True)


@pytest.mark.heavy
def test_a_worker_that_is_killed(tmp_path: Path, processes: Processes, whole: bytes) -> None:
    processes.start_scheduler()
    first, _ = processes.start_worker(), processes.start_worker()
    out = tmp_path / "out.parquet"
    client = _call(study(tmp_path, **LONG), out, processes.address)
    until(_has_parts(out, 3))
    kill(first)
    assert client.wait(PATIENCE) == 0, client.stderr.read() if client.stderr else ""
    assert out.read_bytes() == whole


@pytest.mark.heavy
def test_a_client_that_is_killed(tmp_path: Path, processes: Processes, whole: bytes) -> None:
    processes.start_scheduler()
    processes.start_worker()
    path, out = study(tmp_path, **LONG), tmp_path / "out.parquet"
    client = _call(path, out, processes.address)
    until(_has_parts(out, 2))
    kill(client)
    done = cutjoint.sweep(path, out, scheduler=processes.address)
    assert 0 < done.performed < 2048
    assert out.read_bytes() == whole


@pytest.mark.heavy
def test_a_scheduler_that_is_killed(tmp_path: Path, processes: Processes, whole: bytes) -> None:
    scheduler = processes.start_scheduler()
    processes.start_worker()
    path, out = study(tmp_path, **LONG), tmp_path / "out.parquet"
    client = _call(path, out, processes.address)
    until(_has_parts(out, 2))
    kill(scheduler)
    assert client.stderr is not None
    said = client.communicate(timeout=PATIENCE)[1].decode()
    assert client.returncode == 1
    assert "the scheduler has gone" in said
    assert "repeat the call to continue" in said
    processes.start_scheduler()
    processes.start_worker()
    done = cutjoint.sweep(path, out, scheduler=processes.address)
    assert 0 < done.performed < 2048
    assert out.read_bytes() == whole


def test_no_scheduler_and_no_workers(tmp_path: Path, processes: Processes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.sweeps.cluster._PATIENCE", 1)
    with pytest.raises(RunError, match=r"--scheduler tcp://127\.0\.0\.1:9: no scheduler answers: .*; start one with `dask scheduler`"):
        cutjoint.sweep(study(tmp_path), tmp_path / "out.parquet", scheduler="tcp://127.0.0.1:9")
    processes.start_scheduler()
    with pytest.raises(RunError, match=r"it has no workers; start some with `dask worker tcp://"):
        cutjoint.sweep(study(tmp_path), tmp_path / "out.parquet", scheduler=processes.address)


def test_workers_that_cannot_run_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A study built for a processor that no worker has: refused by name before its first run."""
    read = read_study(study(tmp_path))

    def for_another(target: object) -> object:
        found = build_kernels(read)
        return tuple(replace(k, target=replace(k.target, features=(*k.target.features, "avx4096"))) for k in found)

    monkeypatch.setattr("cutjoint.sweeps.run.build_kernels", for_another)
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:
        expected = r"no worker can run the study: '0' \(tcp://.*\): the processor has no avx4096; flags in the study, such as"
        with pytest.raises(RunError, match=expected):
            perform_study(read, tmp_path / "out.parquet", scheduler=cluster.scheduler_address)


@pytest.mark.heavy
def test_one_worker_of_two_is_refused(tmp_path: Path) -> None:
    """Chunks go to the worker that can run the library alone."""
    read, said = read_study(study(tmp_path)), []
    work = Work(kernels=build_kernels(read), has_scenes=False, objectives=read.objectives, trajectories=(), every=1)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as local:
        bad = min(local.scheduler.workers)
        with Client(local) as client:
            client.run(_with_another_processor, workers=[bad])
        cluster = Cluster(work, local.scheduler_address, said.append)
        try:
            assert cluster.number == 1
            for i in range(4):
                cluster.submit(Chunk(first=10 * i, values=read.values[10 * i : 10 * i + 10]))
            firsts = set()
            while len(firsts) < 4:
                if rows := cluster.take(1.0):
                    firsts.add(rows.first)
        finally:
            cluster.close()
    assert len(said) == 1
    assert f"({bad}) is refused: the library is for Linux on " in said[0]


def test_a_worker_that_joins_late_has_its_share(tmp_path: Path) -> None:
    """It counts although rows come without a pause."""
    read = read_study(study(tmp_path))
    work = Work(kernels=build_kernels(read), has_scenes=False, objectives=read.objectives, trajectories=(), every=1)
    chunk, end = Chunk(first=0, values=read.values[:1]), time.monotonic() + PATIENCE
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as local:
        cluster = Cluster(work, local.scheduler_address, lambda _: None)
        try:
            assert cluster.number == 1
            local.scale(2)
            for _ in range(8):
                cluster.submit(chunk)
            while cluster.number < 2:
                assert time.monotonic() < end, "it is not counted"
                assert cluster.take(60.0) is not None, "there was a pause"
                cluster.submit(chunk)
        finally:
            cluster.close()


@pytest.mark.heavy
def test_timers_of_workers_stop_for_a_sweep(tmp_path: Path) -> None:
    """Also those of a worker that joins late; after the sweep they go on, in a worker that joins then too."""
    read = read_study(study(tmp_path))
    work = Work(kernels=build_kernels(read), has_scenes=False, objectives=read.objectives, trajectories=(), every=1)
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as local, Client(local) as client:
        until(lambda: list(client.run(_timers).values()) == [{"profile": True, "tick": True}])
        cluster = Cluster(work, local.scheduler_address, lambda _: None)
        try:
            local.scale(2)
            client.wait_for_workers(2, timeout=PATIENCE)
            assert list(client.run(_timers).values()) == [{}, {}]
        finally:
            cluster.close()
        local.scale(3)
        client.wait_for_workers(3, timeout=PATIENCE)
        until(lambda: list(client.run(_timers).values()) == [{"profile": True, "tick": True}] * 3)


def _timers(dask_worker: Any) -> dict[str, bool]:
    """The timers of a worker that look at Python, and whether they run."""
    return {name: timer.is_running() for name, timer in dask_worker.periodic_callbacks.items() if name in ("profile", "tick")}


def _with_another_processor() -> None:
    """Make a worker one with another kind of processor."""
    import platform

    platform.machine = lambda: "abacus"


def test_a_worker_without_the_package(tmp_path: Path, processes: Processes) -> None:
    """It is refused by its name, and the other one makes the table."""
    (tmp_path / "empty" / "cutjoint").mkdir(parents=True)
    (tmp_path / "empty" / "cutjoint" / "__init__.py").touch()
    processes.start_scheduler()
    processes.start_worker(PYTHONPATH=str(tmp_path / "empty"))
    processes.start_worker()
    with Client(processes.address) as client:
        client.wait_for_workers(2, timeout=PATIENCE)
    path, said = study(tmp_path), []
    cutjoint.sweep(path, tmp_path / "alone.parquet")
    cutjoint.sweep(path, tmp_path / "dask.parquet", scheduler=processes.address, note=said.append)
    assert (tmp_path / "dask.parquet").read_bytes() == (tmp_path / "alone.parquet").read_bytes()
    refused = [line for line in said if "refused" in line]
    assert len(refused) == 1
    assert refused[0].startswith("worker 'worker-1' (tcp://")
    assert "No module named 'cutjoint." in refused[0]


def test_a_library_is_loaded_once_and_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "places"))
    (tmp_path / "places").mkdir()
    read = read_study(study(tmp_path))
    kernel, = build_kernels(read)
    kernels._loaded.pop(kernel.digest, None)
    assert kernels.require_loadable([kernel]) == ""
    first = kernels._loaded[kernel.digest]
    kernel.run(read.values[:3])
    assert kernels._loaded[kernel.digest] is first
    assert list((tmp_path / "places").iterdir()) == []
    broken = replace(kernel, content=kernel.content[:100])
    assert kernels.require_loadable([broken]).startswith("the library cannot be loaded: ")


def test_settings_that_are_recommended_are_dasks() -> None:
    """The variables of the environment in docs/how-to/cluster.md are those that were measured, and stand for settings that Dask has."""
    text = (ROOT / "docs" / "how-to" / "cluster.md").read_text(encoding="utf-8")
    assert dict(re.findall(r"\b(DASK_\w+)=(\w+)", text)) == variables_of(QUIET)
    for name in QUIET:
        level = config
        for key in name.split("."):
            level = level[key]
        assert not isinstance(level, dict), name
