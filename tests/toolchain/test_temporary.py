"""Temporary folders of killed processes are removed by the next process, others are left alone."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cutjoint.toolchain.temporary import remove_stale, temporary_folder

SCRIPT = """
import sys
from pathlib import Path
from cutjoint.toolchain.temporary import temporary_folder
with temporary_folder(Path(sys.argv[1])) as folder:
    (folder / "inner").mkdir()
    (folder / "inner" / "table.csv").write_text("t")
    print(folder, flush=True)
    sys.stdin.read()
"""


@contextmanager
def holder(place: Path) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """A process that has a temporary folder, and the folder."""
    with subprocess.Popen([sys.executable, "-c", SCRIPT, place], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield process, Path(process.stdout.readline().strip())
        process.kill()


def test_a_folder_is_gone_with_its_lock(tmp_path: Path) -> None:
    with temporary_folder(tmp_path) as folder:
        (folder / "inner").mkdir()
    with pytest.raises(ZeroDivisionError), temporary_folder(tmp_path):
        _ = 1 / 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_folder_of_a_dead_process_is_removed(number: int, tmp_path: Path) -> None:
    (tmp_path / "cutjoint-results").mkdir()
    (tmp_path / "other.lock").touch()
    with holder(tmp_path) as (dead, left), holder(tmp_path) as (_, held):
        dead.send_signal(number)
        dead.wait()
        assert (left / "inner" / "table.csv").exists()
        remove_stale(tmp_path)
        assert not left.exists()
        assert (held / "inner" / "table.csv").exists()
        assert {p.name for p in tmp_path.iterdir()} == {"cutjoint-results", "other.lock", held.name, f"{held.name}.lock"}


def test_the_next_process_sweeps(tmp_path: Path) -> None:
    with holder(tmp_path) as (dead, left):
        dead.kill()
        dead.wait()
        assert left.exists()
        with holder(tmp_path):
            assert not left.exists()


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    """Another user may have put a link where a folder is known to be."""
    place, home = tmp_path / "place", tmp_path / "home"
    for folder in (place, home):
        folder.mkdir()
    (home / "thesis.txt").touch()
    (place / "cutjoint-0.lock").touch()
    (place / "cutjoint-0").symlink_to(home)
    remove_stale(place)
    assert (home / "thesis.txt").exists()
