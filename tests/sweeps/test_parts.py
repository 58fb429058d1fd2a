"""Parts of a sweep that are damaged, renamed, lost, foreign: reported, set aside and made again, or the call fails."""

from __future__ import annotations

import random
from io import BytesIO
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from cutjoint.sweeps.table import is_sealed, seal
from tests.conftest import needs_cpp

from .damaged import ASIDE, CUTS, DAMAGES, OUT, PARTS, RUNS, Harm, begin, call, files, name_of, require_sound, whole, write_study

pytestmark = needs_cpp

#: Damages without a message, as no rows and no file of a user's are concerned, or the rows that go are reported where they are made again.
_SILENT = {"lose", "lose all", "unfinished", "lose manifest"}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_before_a_call(damage: str, tmp_path: Path) -> None:
    for seed in range(4):
        folder = tmp_path / str(seed)
        folder.mkdir()
        harm = Harm(begin(folder), random.Random(seed))
        harm.do(damage)
        done = call(folder)
        require_sound(folder, done, harm.users)
        assert done.exit_code == (damage == "another manifest"), done.output
        if damage in _SILENT:
            assert not (folder / ASIDE).exists()
        elif done.exit_code == 0 and (folder / ASIDE).exists():
            assert "it is now" in done.output
        if damage in ("flip", "cut", "append", "empty", "garbage", "another seed", "rewrite", "beyond", "backwards", "swap", "folder"):
            assert (folder / ASIDE).exists() or not harm.users, damage


@pytest.mark.parametrize("damage", ["lose", "flip", "rename", "folder", "lose manifest", "overlap", "another seed", "odd name"])
def test_damage_while_rows_come(damage: str, tmp_path: Path) -> None:
    for seed in range(3):
        folder = tmp_path / str(seed)
        folder.mkdir()
        write_study(folder)
        harm = Harm(folder / PARTS, random.Random(seed))
        done = call(folder, lambda number: harm.do(damage) if number in (2, 4) else None)  # noqa: B023
        require_sound(folder, done, harm.users)
        assert done.exit_code == 0, done.output
        if damage in ("lose", "flip"):
            assert "completed runs are missing" in done.output.replace("\n", " ")


def test_parts_that_vanish_again_and_again(tmp_path: Path) -> None:
    """The call fails, with what it has; the next one makes the table."""
    write_study(tmp_path)
    harm = Harm(tmp_path / PARTS, random.Random(0))
    done = call(tmp_path, lambda number: harm.do("lose all"))
    assert done.exit_code == 1
    assert f"{RUNS} completed runs are missing" in done.output.replace("\n", " ")
    assert not (tmp_path / OUT).exists()
    assert call(tmp_path).exit_code == 0
    assert (tmp_path / OUT).read_bytes() == whole()


def test_no_byte_of_a_part_can_change(tmp_path: Path) -> None:
    """Each bit that is not as it was written is found, and each other label; readers pass over the digest."""
    name = name_of(0, CUTS[0])
    content = files()[name]
    (tmp_path / name).write_bytes(content)
    assert pq.read_table(tmp_path / name).num_rows == CUTS[0]
    key = files()["manifest.json"].decode().split('"key": "')[1][:64]
    label = f"{key} 0 {CUTS[0]}"
    assert is_sealed(BytesIO(content), label)
    assert not is_sealed(BytesIO(content), f"{key} 0 {CUTS[0] + 1}")
    for at in range(len(content)):
        changed = content[:at] + bytes([content[at] ^ 1 << at % 8]) + content[at + 1 :]
        assert not is_sealed(BytesIO(changed), label), at
        assert not is_sealed(BytesIO(content[:at]), label), at


def test_a_whole_table_that_was_damaged_is_made_again(tmp_path: Path) -> None:
    write_study(tmp_path)
    assert call(tmp_path).exit_code == 0
    assert "all runs were already done" in call(tmp_path).output
    content = whole()
    for at in (100, len(content) // 2, len(content) - 50):
        (tmp_path / OUT).write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
        done = call(tmp_path)
        assert "is no table of this sweep, or a damaged one" in done.output.replace("\n", " ")
        assert done.exit_code == 0
        assert (tmp_path / OUT).read_bytes() == content


def test_files_of_others_stay(tmp_path: Path) -> None:
    """Hidden ones where they are, others beside, also a second one of the same name."""
    for content in (b"one", b"two"):
        parts = begin(tmp_path) if not (tmp_path / PARTS).exists() else tmp_path / PARTS
        (parts / "notes.txt").write_bytes(content)
        (parts / ".hidden").write_bytes(content)
        assert call(tmp_path).exit_code == 0
        (tmp_path / OUT).unlink()
        assert (parts / ".hidden").read_bytes() == content
        assert [path.name for path in parts.iterdir()] == [".hidden"]
    assert sorted(path.read_bytes() for path in (tmp_path / ASIDE).iterdir()) == [b"one", b"two"]


def test_large_files_are_digested_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    file = BytesIO(files()[name_of(0, CUTS[0])])
    seal(file, "again")
    monkeypatch.setattr("cutjoint.sweeps.table._BLOCK", 7)
    assert is_sealed(file, "again")
