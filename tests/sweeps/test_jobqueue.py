"""The recipe for batch systems in docs/how-to/cluster.md, by a queue of one machine that runs what is submitted to it."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

import cutjoint
from tests.conftest import ROOT, needs_cpp

from .studies import study

pytestmark = needs_cpp

pytest.importorskip("dask_jobqueue", reason="dask-jobqueue is not installed")

#: Runs a job's script in the background, a second later.
_SUBMIT = """#!/bin/sh
cp "$1" "$QUEUE/$$.sh"
(sleep 1; exec setsid bash "$QUEUE/$$.sh") > "$QUEUE/$$.log" 2>&1 &
echo $! >> "$QUEUE/jobs"
echo "Submitted batch job $!"
"""


def _recipe() -> str:
    """The Python of docs/how-to/cluster.md, with jobs that this machine has room for."""
    page = (ROOT / "docs" / "how-to" / "cluster.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    text, = (block for block in blocks if "SLURMCluster" in block)
    for asked, here in (("cores=32", "cores=1"), ('memory="64GB"', 'memory="1GB"'), ("jobs=10", "jobs=2")):
        assert asked in text
        text = text.replace(asked, here)
    return str(text)


@pytest.fixture
def queue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of a queue's jobs, which end with the test."""
    folder = tmp_path / "queue"
    folder.mkdir()
    for name, text in (("sbatch", _SUBMIT), ("scancel", "#!/bin/sh\n")):
        (folder / name).write_text(text, encoding="utf-8")
        (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("QUEUE", str(folder))
    yield folder
    for job in (folder / "jobs").read_text(encoding="utf-8").split():
        with suppress(ProcessLookupError):
            os.killpg(int(job), signal.SIGKILL)


def test_the_recipe_makes_the_same_file(queue: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cutjoint.sweep(study(tmp_path), "alone.parquet")
    names: dict[str, object] = {}
    exec(_recipe(), names)
    names["cluster"].close()  # type: ignore[attr-defined]
    assert (tmp_path / "study.parquet").read_bytes() == (tmp_path / "alone.parquet").read_bytes()
    jobs = [path.read_text(encoding="utf-8") for path in queue.glob("*.sh")]
    assert len(jobs) == 2
    assert all("#SBATCH -t 02:00:00" in job and "export DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED=False" in job for job in jobs)
